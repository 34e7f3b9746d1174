"""The functions of a unit of FMI that get and set its variables: each a switch over their numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from hgorun.export.fmu_templates import Version
from hgorun.export.fmu_variables import Kind, Variable


@dataclass(frozen=True)
class _Access:
    """A pair of functions of FMI.

    Attributes
    ----------
    name : str
        As in ``fmi3GetFloat64``.
    type : str
        Of a value in C.
    get, put : mapping of str to str
        By kind of variable the statement for the value k; # stands for the number of the output, input or state.
    read : tuple of str
        What is read before values are got.
    """

    name: str
    type: str
    get: Mapping[Kind, str]
    put: Mapping[Kind, str]
    read: tuple[str, ...] = ()


def access(variables: Sequence[Variable], version: Version) -> Iterator[str]:
    """Lines of C; ~ stands for the prefix of the observer's functions, and REAL for its type."""
    for one in (_reals(version), _booleans(version)):
        declared = [*one.read[:1], "", *one.read[1:]]
        constant = f"const {one.type} values[]"
        yield from _function("Get", one, f"{one.type} values[]", _cases(variables, one.get), declared, version)
        yield from _function("Set", one, constant, _cases(variables, one.put), [""], version)


def _reals(version: Version) -> _Access:
    return _Access(
        "Real" if version == "2.0" else "Float64",
        "double",
        {
            "time": "values[k] = m->start + m->observer.t;",
            "y": "values[k] = m->y[#];",
            "age": "values[k] = m->age[#];",
            "u": "values[k] = m->u[#];",
            "xhat": "values[k] = (double)xhat[#];",
        },
        {"y": "m->y[#] = values[k];", "age": "m->age[#] = values[k];", "u": "m->u[#] = values[k];"},
        ("REAL xhat[~~STATES];", "~estimate(&m->observer, xhat);"),
    )


def _booleans(version: Version) -> _Access:
    """In FMI 2 they are integers."""
    if version == "2.0":
        return _Access(
            "Boolean", "int", {"new": "values[k] = m->fresh[#];"}, {"new": "m->fresh[#] = (values[k] != 0) ? 1 : 0;"}
        )
    return _Access(
        "Boolean", "bool", {"new": "values[k] = (m->fresh[#] != 0);"}, {"new": "m->fresh[#] = (values[k]) ? 1 : 0;"}
    )


def _function(
    verb: str, one: _Access, values: str, cases: Sequence[str], declared: Sequence[str], version: Version
) -> Iterator[str]:
    two, const = version == "2.0", "const " if verb == "Get" else ""
    yield f"EXPORT int fmi{version[0]}{verb}{one.name}(void *c, const uint32_t vr[], size_t n,"
    yield f"    {values}{'' if two else ', size_t count'})"
    yield "{"
    yield f"    {const}instance *m = ({const}instance *)c;"
    yield "    int status = 0;"
    yield "    size_t k;"
    yield from (f"    {line}" if line else "" for line in declared)
    if not two:
        yield "    (void)count;"
    yield "    (void)m;"
    yield "    (void)values;"
    yield "    for (k = 0U; k < n; ++k) {"
    yield "        switch (vr[k]) {"
    yield from cases
    yield "        default:"
    yield "            status = 3;"
    yield "            break;"
    yield "        }"
    yield "    }"
    yield "    return status;"
    yield from ("}", "")


def _cases(variables: Sequence[Variable], statements: Mapping[Kind, str]) -> list[str]:
    return [
        line
        for v in variables
        if v.kind in statements
        for line in (
            f"        case {v.number}U:",
            f"            {statements[v.kind].replace('#', str(v.index))}",
            "            break;",
        )
    ]
