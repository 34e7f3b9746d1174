"""What stands at the top of an exported observer: its interface, and what it costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from hgorun.export.c_source import Source
from hgorun.export.names import identifier
from hgorun.export.observer import Exported
from hgorun.version import __version__

LARGE = 100_000  # bytes that may be too many for a stack
_SMALLEST = 1024  # steps that a prediction may take at least


@dataclass(frozen=True)
class Cost:
    """Operations in the worst case.

    Attributes
    ----------
    plain : int
        Sums, products, comparisons.
    divisions : int
        Quotients and square roots.
    functions : int
        Calls of functions of libm.
    """

    plain: int = 0
    divisions: int = 0
    functions: int = 0

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.plain + other.plain, self.divisions + other.divisions, self.functions + other.functions)

    def times(self, count: int) -> Cost:
        """So many times the same."""
        return Cost(count * self.plain, count * self.divisions, count * self.functions)

    def __str__(self) -> str:
        return f"{self.plain} sums and products, {self.divisions} divisions and roots, {self.functions} calls of libm"


def costs(source: Source) -> Mapping[str, Cost]:
    """What a step, a sample and an estimate cost at most."""
    observer, functions = source.observer, source.functions.all
    equations, size, q = observer.equations, observer.size, len(observer.outputs)
    of_time = [k for name in equations.outputs for k in equations.needed(name) if equations.steps[k].clocked]
    clock = Cost(**equations.count(sorted(set(of_time)))) if source.timed else Cost()

    def evaluated(name: str) -> Cost:
        function = functions.get(name)
        if function is None:
            return Cost()
        ops = function.operations
        return Cost(**ops.count([k for k in ops.needed(name) if not ops.steps[k].clocked]))

    told = Cost(plain=4).times(len(observer.inputs))

    def whole(name: str) -> Cost:
        """With the functions of time and the inputs that it reads."""
        arrays = functions[name].arrays if name in functions else ()
        return evaluated(name) + (clock if "tau" in arrays else Cost()) + (told if "u" in arrays else Cost())

    found: dict[str, Cost] = {}
    if observer.flows:
        periodic = Cost(plain=3, divisions=1, functions=1).times(sum(o.period is not None for o in observer.outputs))
        recalled = Cost(plain=110, divisions=1).times(sum(o.delay is not None for o in observer.outputs))
        slope = evaluated("rate") + evaluated("guess") + evaluated("delay") + Cost(plain=6).times(q) + told
        slope += periodic + recalled
        weights = [sum(w != 0.0 for w in row.weights) for row in (*observer.method.stages, observer.method.result)]
        stages = len(observer.method.c)
        combined = Cost(plain=sum(2 * count + 1 for count in weights)).times(size)
        step = slope.times(stages) + combined + clock.times(len(set(observer.method.c) | {1.0}) - 1) + Cost(8)
        if observer.remembered:
            step += slope + (evaluated("past") + evaluated("past_rate") + told).times(2)
        found["step"] = step
    sample = whole("guess") + Cost(plain=4).times(q)
    if observer.remembered:
        rebased = 2 * observer.pieces
        sample += Cost(plain=rebased + 110, divisions=1).times(len(observer.remembered))
    if observer.jump is not None:
        of_jump = observer.jump.needed("jump")
        sample += Cost(**observer.jump.count(of_jump))
    found["sample"] = sample
    found["estimate"] = whole("estimate")
    return found


def max_steps(observer: Exported) -> int:
    """How many steps a prediction may take: four times the longest gap of the run."""
    needed = int(4 * observer.gap / observer.step) + 1
    return max(_SMALLEST, 1 << (needed - 1).bit_length())


@dataclass(frozen=True)
class Member:
    """A member of the structure that holds all of an observer.

    Attributes
    ----------
    type, name : str
    size, align : int
        Bytes of one entry, and what its address is a multiple of.
    count : int
        0: no array.
    meaning : str
    """

    type: str
    name: str
    size: int
    align: int
    count: int = 0
    meaning: str = ""

    def __str__(self) -> str:
        array = f"[{self.count}]" if self.count else ""
        return f"    {self.type} {self.name}{array};" + (f" /* {self.meaning} */" if self.meaning else "")


def members(source: Source) -> list[Member]:
    """All that an observer knows."""
    observer, p, real = source.observer, source.prefix, source.real.name
    q, m, late, r = (
        len(observer.outputs),
        len(observer.inputs),
        len(observer.remembered),
        4 if source.real.single else 8,
    )

    def reals(name: str, count: int, meaning: str = "") -> Member:
        return Member(real, name, r, r, count, meaning)

    line = _padded(16 + 3 * r)
    found = [Member("double", "t", 8, 8, meaning="now"), reals("z", observer.size, _plain(_layout(observer)))]
    if observer.sampled:
        found += [reals("y", q, "the last samples, and when they were taken"), Member("double", "taken", 8, 8, q)]
        found += [reals("s", q, "C xhat - alpha at that time")] if observer.compares else []
    if observer.compares:
        found += [Member("uint32_t", "mode", 4, 4, q)]
    if observer.continuous:
        found += [Member(f"{p}line", "line", line, 8, q)]
    if observer.inputs:
        found += [Member(f"{p}line", "input", line, 8, m)]
    if observer.jump is not None and not observer.corrected:
        found += [Member("double", "sampled", 8, 8, meaning="the time of the last sample, if there was one")]
        found += [Member("uint32_t", "samples", 4, 4)]
        found += [reals("before", m)] if m else []
    if observer.pieces:
        found += [Member("uint32_t", "pieces", 4, 4), Member("uint32_t", "newest", 4, 4), reals("first", late)]
        found += [Member(f"{p}piece", "past", _padded(16 + 4 * r * late), 8, observer.pieces)]
    return found


def _padded(size: int) -> int:
    return -(-size // 8) * 8


def bytes_of(source: Source) -> int:
    """The size of the observer's memory, where a double lies at multiples of 8 bytes."""
    at = 0
    for member in members(source):
        at = -(-at // member.align) * member.align + member.size * max(member.count, 1)
    return _padded(at)


def top(source: Source) -> str:
    """The comment that both files begin with."""
    observer = source.observer
    text = [
        f"Observer {observer.label} ({observer.design.observer.type}) of {observer.run}, by hgorun {__version__}.",
        "",
    ]
    text += _described(source)
    return "/*\n" + "\n".join(f" * {_plain(line)}".rstrip() for line in text) + "\n */\n"


def _plain(text: str) -> str:
    """Text as a comment may hold it."""
    shown = "".join(char if char.isprintable() else "?" for char in text)
    return shown.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")


def _described(source: Source) -> Iterator[str]:
    observer, found = source.observer, costs(source)
    clock = f"; t = 0 is {observer.origin:g} on the clock of the configuration" if observer.origin else ""
    yield f"Times are in {observer.unit}, counted from the start{clock}."
    if observer.flows:
        yield f"Integrated by {observer.method.name}, no step longer than {observer.step!r}."
        if observer.beside:
            others = ", ".join(observer.beside)
            yield f"That step was found for it and {others} together; exported alone it may take longer ones."
        yield f"A prediction takes at most {source.upper}MAX_STEPS of them."
    if observer.pieces:
        yield f"History: {observer.pieces} steps, for what is known late."
    yield ""
    yield "At most, in operations (all loops have bounds, nothing is allocated, no recursion):"
    for name, cost in found.items():
        yield f"  {name + ':':<9} {cost}"
    yield f"Memory: {bytes_of(source)} bytes, in one structure without pointers: memcpy keeps and restores it."
    if bytes_of(source) > LARGE:
        yield "Declare it static: so much memory does not fit on every stack."


def header(source: Source) -> str:
    """The file ``<label>.h``."""
    observer, p, u, real = source.observer, source.prefix, source.upper, source.real.name
    lines = [top(source), f"#ifndef {u}H", f"#define {u}H", "", "#include <stdint.h>"]
    lines += ["", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    lines += [f"#define {u}STATES {len(observer.states)}U /* {_plain(', '.join(observer.states))} */"]
    lines += [f"#define {u}OUTPUTS {len(observer.outputs)}U"]
    for i, output in enumerate(observer.outputs):
        name, how = identifier(output.name).upper(), _how(output.sampled, output.continuous)
        lines.append(f"#define {u}OUTPUT_{name} {1 << i}U /* {how} */")
    lines.append(f"#define {u}ALL {(1 << len(observer.outputs)) - 1}U")
    if observer.inputs:
        lines.append(f"#define {u}INPUTS {len(observer.inputs)}U /* {_plain(', '.join(observer.inputs))} */")
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
}


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


def _layout(observer: Exported) -> str:
    parts = [f"{name} from {state.start}" for name, state in observer.block.states.items()]
    return ", ".join(parts)


def _prototypes(source: Source, real: str, p: str) -> Iterator[str]:
    observer = source.observer
    yield f"/* At the start of the run. */\nvoid {p}init({p}observer *s);\n"
    yield f"/* Go on to time t. */\nuint32_t {p}predict({p}observer *s, double t);\n"
    if observer.sampled:
        late = "it may be earlier than now" if observer.remembered else "now; a later one counts as now"
        whole = " All outputs at once." if observer.jump is not None and not observer.corrected else ""
        yield (
            f"/* Samples that arrive now. taken: the time they were measured, {late}.\n"
            f" * y: one value an output; which: a bit for each output that has one (ALL for all).{whole} */"
        )
        yield f"uint32_t {p}update({p}observer *s, double taken, const {real} y[], uint32_t which);\n"
    if observer.continuous:
        yield (
            "/* What continuous outputs are. With t ahead of now (call it before predict), they go to y on straight\n"
            " * lines, and stay there; otherwise, and the first time, they are y from now on. */"
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
