"""The C code around an observer that makes it a unit of FMI 2.0 or 3.0 for co-simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hgorun.export.c_code import LAST, Real
from hgorun.export.c_header import STATUS
from hgorun.export.c_source import Source
from hgorun.export.fmi_functions import FMI2, FMI3
from hgorun.export.fmu_access import access
from hgorun.export.fmu_stubs import stubs
from hgorun.export.fmu_templates import CORE, LEAVE, TOP, Version
from hgorun.export.fmu_variables import Variable
from hgorun.export.observer import Exported

_LOGGERS: dict[Version, tuple[str, str]] = {  # what simulators call theirs by, and the first arguments
    "2.0": (
        """\
typedef void (*logger)(void *environment, const char *name, int status, const char *category, const char *text, ...);

typedef struct {
    logger log;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, int status);
    void *environment;
} callbacks;
""",
        "m->environment, m->name",
    ),
    "3.0": (
        "typedef void (*logger)(void *environment, int status, const char *category, const char *text);\n",
        "m->environment",
    ),
}


_LEFT_OUT = {  # statuses of samples without which the unit goes on
    "OLD": f"left out: {STATUS['OLD'].removesuffix(': left out')}",
    "INCOMPLETE": "left out: a sample without those of all other outputs, which this observer needs at once",
    "BAD_GAP": f"left out: {STATUS['BAD_GAP'].removesuffix(': nothing was done')}",
}


def wrapper(source: Source, variables: Sequence[Variable], version: Version, token: str) -> str:
    """The file ``<label>_fmi.c``.

    It declares the few types of FMI that it needs, so that it compiles without FMI's headers.

    Parameters
    ----------
    source : Source
    variables : sequence of Variable
    version : str
    token : str
        What the unit is recognised by.
    """
    text = TOP + CORE + (FMI2 if version == "2.0" else FMI3)
    observer = source.observer
    q, m = len(observer.outputs), max(len(observer.inputs), 1)
    parts = {
        "@TOKEN@": token,
        "@Q@": str(q),
        "@M@": str(m),
        "@LOGGER@": _LOGGERS[version][0],
        "@SAID@": _LOGGERS[version][1],
        "@LEAVE@": LEAVE if observer.sampled else "",
        "@WHY@": _words_of_status(observer),
        "@TELL@": "\n".join(_told(source)),
        "@ACCESS@": "\n".join(access(variables, version)),
        "@FRESH@": "\n".join(f"    m->fresh[{v.index}] = 1;" for v in variables if v.kind == "new"),
        "@STUBS@": "\n".join(stubs(version)),
    }
    for name, part in parts.items():
        text = text.replace(name, part)
    text = text.replace("REAL", source.real.name).replace("~~", source.upper).replace("~", source.prefix)
    return text.replace("@HEADER@", f"{observer.name}.h")  # last, for an observer may be called REAL


def _words_of_status(observer: Exported) -> str:
    """What is said of a status: as in the header, where nothing else is to be said of a unit."""
    given = "; inputs that are not given are 0" if observer.inputs else ""
    found = f'"{STATUS["NOT_FINITE"]}{given}"'
    for name, words in {**{name: STATUS[name] for name in ("BAD_TIME", "TOO_FAR")}, **_LEFT_OUT}.items():
        found = f'(status == ~~{name})\n        ? "{words}"\n        : ({found})'
    return found


def _told(source: Source) -> Iterator[str]:
    """What a step tells the observer before it goes on."""
    observer, real = source.observer, source.real
    q = len(observer.outputs)
    yield f"    {real.name} y[{q}];"
    if observer.inputs:
        yield f"    {real.name} u[{len(observer.inputs)}];"
        yield from (f"    u[{i}] = {_cast(real, f'm->u[{i}]')};" for i in range(len(observer.inputs)))
        yield "    status = ~input(s, s->t, u);"
    yield from (f"    y[{i}] = {_cast(real, f'm->y[{i}]')};" for i in range(q))
    continuous = sum(1 << i for i, output in enumerate(observer.outputs) if output.continuous and not output.sampled)
    if continuous:
        yield "    if (status == ~~OK) {"
        yield f"        status = ~measure(s, s->t, y, {continuous}U);"
        yield "    }"
    late = [i for i, output in enumerate(observer.outputs) if output.sampled and output.late]
    plain = [i for i, output in enumerate(observer.outputs) if output.sampled and not output.late]
    for some, taken in [((i,), f"s->t - m->age[{i}]") for i in late] + ([(tuple(plain), "s->t")] if plain else []):
        mask = " | ".join(f"((m->fresh[{i}] != 0) ? {1 << i}U : 0U)" for i in some)
        yield "    {"
        yield f"        const double taken = {taken};"
        yield f"        const uint32_t which = {mask};"
        yield ""
        yield "        if ((which != 0U) && (status == ~~OK)) {"
        # what was taken before the start is of the start, as in a run; an age that is no number is refused
        yield f"            status = ~update(s, ((taken < 0.0) && (taken >= -{LAST})) ? 0.0 : taken, y, which);"
        yield "            if ((status == ~~OLD) || (status == ~~INCOMPLETE) || (status == ~~BAD_GAP)) {"
        yield "                leave_out(m, status);"
        yield "                status = ~~OK;"
        yield "            }"
        yield "        }"
        yield "    }"


def _cast(real: Real, value: str) -> str:
    return f"(float){value}" if real.single else value
