"""What stands at the top of an exported observer: its interface, and what it costs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from hgorun.export.c_cost import costs
from hgorun.export.c_memory import bytes_of, members
from hgorun.export.c_source import Source
from hgorun.export.names import identifier, plain
from hgorun.export.observer import Exported
from hgorun.export.said import starts, units_said
from hgorun.observers.capabilities import Switching
from hgorun.version import __version__

LARGE = 100_000  # bytes that may be too many for a stack
_SMALLEST = 1024  # steps that a prediction may take at least
_LONG = 1e6  # beside such a number a float, which has seven digits, has none for what a sample tells


def max_steps(observer: Exported) -> int:
    """How many steps a prediction may take: four times the longest gap of the run."""
    needed = int(4 * observer.gap / observer.step) + 1
    return max(_SMALLEST, 1 << (needed - 1).bit_length())


def top(source: Source) -> str:
    """The comment that both files begin with."""
    observer = source.observer
    text = [
        f"Observer {observer.label} ({observer.design.observer.type}) of {observer.run}, by hgorun {__version__}.",
        "",
    ]
    text += _described(source)
    return "/*\n" + "\n".join(f" * {plain(line)}".rstrip() for line in text) + "\n */\n"


def _described(source: Source) -> Iterator[str]:
    observer, found = source.observer, costs(source)
    clock = f"; t = 0 is {observer.origin:g} on the clock of the configuration" if observer.origin else ""
    yield f"Times are in {observer.unit}, counted from the start{clock}."
    yield from units_said(observer)
    if begun := starts(observer):
        yield f"It starts at {begun}."
    if observer.flows:
        yield f"Integrated by {observer.method.name}, no step longer than {observer.step!r}."
        if observer.beside:
            others = ", ".join(observer.beside)
            yield f"That step was found for it and {others} together; exported alone it may take longer ones."
        first = f", and the first {observer.early.times.size}, which are shorter" if observer.early.times.size else ""
        yield f"A prediction takes at most {source.upper}MAX_STEPS of them{first}."
    if observer.pieces:
        yield f"History: {observer.pieces} steps, for what is known late."
    yield ""
    yield "At most, in operations (all loops have bounds, nothing is allocated, no recursion):"
    for name, cost in found.items():
        yield f"  {name + ':':<9} {cost}"
    for name in _long(observer) if source.real.single else ():
        yield f"The start of {name} is so large that the first estimates in float have fewer digits than later ones."
    if source.real.single and _switches(observer):
        yield "Its equations jump where a sign changes: near that, float may take the other side, as other steps do."
    yield f"Memory: {bytes_of(source)} bytes, in one structure without pointers: memcpy keeps and restores it."
    if bytes_of(source) > LARGE:
        yield "Declare it static: so much memory does not fit on every stack."


def _long(observer: Exported) -> Iterator[str]:
    """Covariances and other gains that begin so large that float loses what is added to them."""
    design, states = observer.design, observer.block.states
    for name, role in design.observer.roles(design.form).items():
        values = observer.start[states[name].start :][: states[name].size]
        if role == "gain" and np.max(np.abs(values), initial=0.0) > _LONG:
            yield name


def _switches(observer: Exported) -> bool:
    """Whether steps go across a discontinuity, back and forth."""
    return observer.flows and isinstance(observer.design.observer, Switching) and observer.design.observer.switches


def header(source: Source) -> str:
    """The file ``<label>.h``."""
    observer, p, u, real = source.observer, source.prefix, source.upper, source.real.name
    lines = [top(source), f"#ifndef {u}H", f"#define {u}H", "", "#include <stdint.h>"]
    lines += ["", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    lines += [f"#define {u}STATES {len(observer.states)}U /* {plain(', '.join(observer.states))} */"]
    lines += [f"#define {u}OUTPUTS {len(observer.outputs)}U"]
    for i, (output, name) in enumerate(zip(observer.outputs, _in_capitals(observer), strict=True)):
        lines.append(f"#define {u}OUTPUT_{name} {1 << i}U /* {_how(output.sampled, output.continuous)} */")
    lines.append(f"#define {u}ALL {(1 << len(observer.outputs)) - 1}U")
    if observer.inputs:
        lines.append(f"#define {u}INPUTS {len(observer.inputs)}U /* {plain(', '.join(observer.inputs))} */")
    if observer.flows:
        lines += [f"#ifndef {u}MAX_STEPS", f"#define {u}MAX_STEPS {max_steps(observer)}U", "#endif"]
    if observer.pieces:
        lines.append(f"#define {u}HISTORY {observer.pieces}U")
    lines += ["", "/* what the functions return */"]
    for number, (name, meaning) in enumerate(STATUS.items()):
        lines.append(f"#define {u}{name} {number}U /* {meaning} */")
    if observer.flows:
        lines += [
            "",
            "/* what an output is */",
            f"#define {u}SILENT 0U",
            f"#define {u}HELD 1U",
            f"#define {u}CONTINUOUS 2U",
        ]
    lines += ["", *_types(source), *_prototypes(source, real, p)]
    lines += ["#ifdef __cplusplus", "}", "#endif", "", "#endif", ""]
    return "\n".join(lines)


STATUS = {  # of a function, and its meaning
    "OK": "done",
    "OLD": "a sample older than one that was used, or than what is remembered: left out",
    "NOT_FINITE": "a number that is none, or an estimate that is lost",
    "BAD_TIME": "a time that goes back, or is none: nothing was done",
    "TOO_FAR": "more steps than a prediction may take: nothing was done",
    "INCOMPLETE": "this observer needs all outputs at once: nothing was done",
    "BAD_GAP": "a sample that is no whole number of periods after the last one: nothing was done",
}


def _in_capitals(observer: Exported) -> list[str]:
    """The outputs as macros have them: in capitals, but for those that differ in small and capital letters alone."""
    names = [identifier(output.name) for output in observer.outputs]
    count = Counter(map(str.upper, names))
    return [name if count[name.upper()] > 1 else name.upper() for name in names]


def _how(sampled: bool, continuous: bool) -> str:
    return "sampled, or continuous" if sampled and continuous else "sampled" if sampled else "continuous"


def _types(source: Source) -> Iterator[str]:
    observer, p, real = source.observer, source.prefix, source.real.name
    if observer.continuous or observer.inputs:
        yield f"typedef struct {{\n    double since;\n    double until;\n    {real} level;\n    {real} slope;"
        yield f"    {real} last;\n}} {p}line;\n"
    if observer.pieces:
        size = len(observer.remembered)
        yield "typedef struct {\n    double from;\n    double to;"
        yield from (f"    {real} {name}[{size}];" for name in ("s0", "r0", "s1", "r1"))
        yield f"}} {p}piece;\n"
    yield "/* all that the observer knows: to be copied whole, not to be written to; static where the stack is small */"
    yield "typedef struct {"
    yield from map(str, members(source))
    yield f"}} {p}observer;\n"


def _prototypes(source: Source, real: str, p: str) -> Iterator[str]:
    observer = source.observer
    begun = starts(observer)
    yield f"/* At the start of the run{plain(f': {begun}') if begun else ''}. */\nvoid {p}init({p}observer *s);\n"
    yield f"/* Go on to time t. */\nuint32_t {p}predict({p}observer *s, double t);\n"
    if observer.sampled:
        late = ("it may be earlier than now" if observer.remembered else "now") + "; a later one counts as now"
        steps = observer.jump is not None and not observer.corrected
        whole = "\n * All outputs at once, and once at a time: a second sample of it is OLD." if steps else ""
        if observer.period is not None:
            whole = f"\n * Whole periods of {observer.period!r} after the last one: at other times BAD_GAP."
        yield (
            f"/* Samples that arrive now. taken: the time they were measured, {late}.\n"
            f" * y: one value an output; which: a bit for each output that has one (ALL for all).{whole} */"
        )
        yield f"uint32_t {p}update({p}observer *s, double taken, const {real} y[], uint32_t which);\n"
    if observer.continuous:
        yield (
            "/* What continuous outputs are. With t ahead of now (call it before predict), they go to y on straight\n"
            " * lines, and stay there; otherwise, and the first time, they are y from now on, as with an earlier t. */"
        )
        yield f"uint32_t {p}measure({p}observer *s, double t, const {real} y[], uint32_t which);\n"
    if observer.inputs:
        yield "/* What the inputs are: as for measure. Zero until they are told. */"
        yield f"uint32_t {p}input({p}observer *s, double t, const {real} u[]);\n"
    if observer.compares:
        yield "/* Nothing is known of these outputs until they are told again. */"
        yield f"void {p}silence({p}observer *s, uint32_t which);\n"
    yield "/* The estimate now, in the coordinates of the plant. */"
    yield f"void {p}estimate(const {p}observer *s, {real} xhat[]);\n"
