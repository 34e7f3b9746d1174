"""The C code around an observer that makes it a unit of FMI 2.0 or 3.0 for co-simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from hgorun.export.c_code import Real
from hgorun.export.c_source import Source
from hgorun.export.fmu_variables import Kind, Variable

Version = Literal["2.0", "3.0"]
VERSIONS: tuple[Version, ...] = ("2.0", "3.0")


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
    two = version == "2.0"
    text = _TOP + _CORE + (_FMI2 if two else _FMI3)
    observer = source.observer
    q, m = len(observer.outputs), max(len(observer.inputs), 1)
    is_one, is_true = ("values[k] != 0", "m->fresh[#]") if two else ("values[k]", "m->fresh[#] != 0")
    get: dict[Kind, str] = {"new": f"values[k] = ({is_true});"}
    put: dict[Kind, str] = {"new": f"m->fresh[#] = ({is_one}) ? 1 : 0;"}
    parts = {
        "@HEADER@": f"{observer.name}.h",
        "@TOKEN@": token,
        "@Q@": str(q),
        "@M@": str(m),
        "@TELL@": "\n".join(_told(source)),
        "@GET@": "\n".join(_cases(variables, _GET)),
        "@SET@": "\n".join(_cases(variables, _SET)),
        "@GETB@": "\n".join(_cases(variables, get)),
        "@SETB@": "\n".join(_cases(variables, put)),
        "@FRESH@": "\n".join(f"    m->fresh[{v.index}] = 1;" for v in variables if v.kind == "new"),
        "@STUBS@": "\n".join(_stubs(version)),
    }
    for name, part in parts.items():
        text = text.replace(name, part)
    return text.replace("REAL", source.real.name).replace("~~", source.upper).replace("~", source.prefix)


_GET: dict[Kind, str] = {
    "time": "values[k] = m->start + m->observer.t;",
    "y": "values[k] = m->y[#];",
    "age": "values[k] = m->age[#];",
    "u": "values[k] = m->u[#];",
    "xhat": "values[k] = (double)xhat[#];",
}
_SET: dict[Kind, str] = {"y": "m->y[#] = values[k];", "age": "m->age[#] = values[k];", "u": "m->u[#] = values[k];"}


def _cases(variables: Sequence[Variable], statements: dict[Kind, str]) -> Iterator[str]:
    for v in variables:
        if v.kind in statements:
            yield f"        case {v.number}U:"
            yield f"            {statements[v.kind].replace('#', str(v.index))}"
            yield "            break;"


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
        yield "            status = ~update(s, (taken > 0.0) ? taken : 0.0, y, which);"
        yield "            if ((status == ~~OLD) || (status == ~~INCOMPLETE)) {"
        yield "                status = ~~OK; /* it is left out */"
        yield "            }"
        yield "        }"
        yield "    }"


def _cast(real: Real, value: str) -> str:
    return f"(float){value}" if real.single else value


def _stubs(version: Version) -> Iterator[str]:
    """What the standard asks for and this unit does not have."""
    for name, types in (_NOT_IN_2 if version == "2.0" else _not_in_3()).items():
        parameters = ", ".join(f"{kind} a{i}" for i, kind in enumerate(types))
        returns = "void *" if "Instantiate" in name else "int "
        yield f"EXPORT {returns}{name}({parameters})"
        yield "{"
        yield from (f"    (void)a{i};" for i in range(len(types)))
        yield "    return NULL;" if "Instantiate" in name else "    return 3; /* error */"
        yield "}"
        yield ""


_I, _V, _N = "void *", "const uint32_t *", "size_t"
_R = "const unsigned int *"
_NOT_IN_2: dict[str, tuple[str, ...]] = {
    "fmi2GetInteger": (_I, _R, _N, "int *"),
    "fmi2GetString": (_I, _R, _N, "const char **"),
    "fmi2SetInteger": (_I, _R, _N, "const int *"),
    "fmi2SetString": (_I, _R, _N, "const char *const *"),
    "fmi2GetDirectionalDerivative": (_I, _R, _N, _R, _N, "const double *", "double *"),
    "fmi2SetRealInputDerivatives": (_I, _R, _N, "const int *", "const double *"),
    "fmi2GetRealOutputDerivatives": (_I, _R, _N, "const int *", "double *"),
    "fmi2CancelStep": (_I,),
    "fmi2GetStatus": (_I, "int", "int *"),
    "fmi2GetRealStatus": (_I, "int", "double *"),
    "fmi2GetIntegerStatus": (_I, "int", "int *"),
    "fmi2GetBooleanStatus": (_I, "int", "int *"),
    "fmi2GetStringStatus": (_I, "int", "const char **"),
}
_NUMBERS = {
    "Float32": "float", "Int8": "int8_t", "UInt8": "uint8_t", "Int16": "int16_t", "UInt16": "uint16_t",
    "Int32": "int32_t", "UInt32": "uint32_t", "Int64": "int64_t", "UInt64": "uint64_t",
}  # fmt: skip


def _not_in_3() -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {
        "fmi3InstantiateModelExchange": ("const char *",) * 3 + ("bool", "bool", _I, _I),
        "fmi3InstantiateScheduledExecution": ("const char *",) * 3 + ("bool", "bool", _I, _I, _I, _I, _I),
    }
    for name, kind in _NUMBERS.items():
        found[f"fmi3Get{name}"] = (_I, _V, _N, f"{kind} *", _N)
        found[f"fmi3Set{name}"] = (_I, _V, _N, f"const {kind} *", _N)
    return found | {
        "fmi3GetString": (_I, _V, _N, "const char **", _N),
        "fmi3SetString": (_I, _V, _N, "const char *const *", _N),
        "fmi3GetBinary": (_I, _V, _N, "size_t *", "const uint8_t **", _N),
        "fmi3SetBinary": (_I, _V, _N, "const size_t *", "const uint8_t *const *", _N),
        "fmi3GetClock": (_I, _V, _N, "bool *"),
        "fmi3SetClock": (_I, _V, _N, "const bool *"),
        "fmi3GetNumberOfVariableDependencies": (_I, "uint32_t", "size_t *"),
        "fmi3GetVariableDependencies": (_I, "uint32_t", "size_t *", "uint32_t *", "size_t *", "int *", _N),
        "fmi3GetDirectionalDerivative": (_I, _V, _N, _V, _N, "const double *", _N, "double *", _N),
        "fmi3GetAdjointDerivative": (_I, _V, _N, _V, _N, "const double *", _N, "double *", _N),
        "fmi3EnterConfigurationMode": (_I,),
        "fmi3ExitConfigurationMode": (_I,),
        "fmi3EnterEventMode": (_I,),
        "fmi3GetIntervalDecimal": (_I, _V, _N, "double *", "int *"),
        "fmi3GetIntervalFraction": (_I, _V, _N, "uint64_t *", "uint64_t *", "int *"),
        "fmi3GetShiftDecimal": (_I, _V, _N, "double *"),
        "fmi3GetShiftFraction": (_I, _V, _N, "uint64_t *", "uint64_t *"),
        "fmi3SetIntervalDecimal": (_I, _V, _N, "const double *"),
        "fmi3SetIntervalFraction": (_I, _V, _N, "const uint64_t *", "const uint64_t *"),
        "fmi3SetShiftDecimal": (_I, _V, _N, "const double *"),
        "fmi3SetShiftFraction": (_I, _V, _N, "const uint64_t *", "const uint64_t *"),
        "fmi3EvaluateDiscreteStates": (_I,),
        "fmi3UpdateDiscreteStates": (_I, "bool *", "bool *", "bool *", "bool *", "bool *", "double *"),
        "fmi3EnterContinuousTimeMode": (_I,),
        "fmi3CompletedIntegratorStep": (_I, "bool", "bool *", "bool *"),
        "fmi3SetTime": (_I, "double"),
        "fmi3SetContinuousStates": (_I, "const double *", _N),
        "fmi3GetContinuousStateDerivatives": (_I, "double *", _N),
        "fmi3GetEventIndicators": (_I, "double *", _N),
        "fmi3GetContinuousStates": (_I, "double *", _N),
        "fmi3GetNominalsOfContinuousStates": (_I, "double *", _N),
        "fmi3GetNumberOfEventIndicators": (_I, "size_t *"),
        "fmi3GetNumberOfContinuousStates": (_I, "size_t *"),
        "fmi3EnterStepMode": (_I,),
        "fmi3GetOutputDerivatives": (_I, _V, _N, "const int32_t *", "double *", _N),
        "fmi3ActivateModelPartition": (_I, "uint32_t", "double"),
    }


_TOP = """\
/* The functions of FMI around an observer; the observer itself allocates nothing. */
#include "@HEADER@"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

static const char token[] = "@TOKEN@";

"""

_CORE = """\
typedef struct {
    ~observer observer;
    double start;
    double y[@Q@];
    double age[@Q@];
    double u[@M@];
    int fresh[@Q@];
} instance;

static void begin(instance *m)
{
    (void)memset(m, 0, sizeof(*m));
    ~init(&m->observer);
@FRESH@
}

static instance *made(const char *given)
{
    instance *m = NULL;

    if ((given != NULL) && (strcmp(given, token) == 0)) {
        m = (instance *)malloc(sizeof(instance));
        if (m != NULL) {
            begin(m);
        }
    }
    return m;
}

/* tell the observer what it is told at the start of a step, and go on to its end; 0, or 3 for an error */
static int step(instance *m, double end)
{
    ~observer *s = &m->observer;
    uint32_t status = ~~OK;
@TELL@
    if (status == ~~OK) {
        const double to = end - m->start;

        status = ~predict(s, (to > s->t) ? to : s->t);
    }
    return (status == ~~OK) ? 0 : 3;
}

static int get_real(const instance *m, const uint32_t vr[], size_t n, double values[])
{
    int status = 0;
    size_t k;
    REAL xhat[~~STATES];

    ~estimate(&m->observer, xhat);
    for (k = 0U; k < n; ++k) {
        switch (vr[k]) {
@GET@
        default:
            status = 3;
            break;
        }
    }
    return status;
}

static int set_real(instance *m, const uint32_t vr[], size_t n, const double values[])
{
    int status = 0;
    size_t k;

    for (k = 0U; k < n; ++k) {
        switch (vr[k]) {
@SET@
        default:
            status = 3;
            break;
        }
    }
    return status;
}

static int copied(const instance *m, void **state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(instance));
    }
    if (*state != NULL) {
        (void)memcpy(*state, m, sizeof(instance));
    }
    return (*state != NULL) ? 0 : 3;
}

"""

_COMMON = """\
EXPORT const char *FMIGetVersion(void)
{
    return "VERSION";
}

EXPORT int FMISetDebugLogging(void *c, BOOL on, size_t n, const char *const categories[])
{
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return 0;
}

EXPORT void FMIFreeInstance(void *c)
{
    free(c);
}

EXPORT int FMIExitInitializationMode(void *c)
{
    (void)c;
    return 0;
}

EXPORT int FMITerminate(void *c)
{
    (void)c;
    return 0;
}

EXPORT int FMIReset(void *c)
{
    begin((instance *)c);
    return 0;
}

EXPORT int FMIGetBoolean(void *c, const uint32_t vr[], size_t n, BOOL values[]COUNT)
{
    const instance *m = (const instance *)c;
    int status = 0;
    size_t k;

    (void)m;
    (void)values;USED
    for (k = 0U; k < n; ++k) {
        switch (vr[k]) {
@GETB@
        default:
            status = 3;
            break;
        }
    }
    return status;
}

EXPORT int FMISetBoolean(void *c, const uint32_t vr[], size_t n, const BOOL values[]COUNT)
{
    instance *m = (instance *)c;
    int status = 0;
    size_t k;

    (void)m;
    (void)values;USED
    for (k = 0U; k < n; ++k) {
        switch (vr[k]) {
@SETB@
        default:
            status = 3;
            break;
        }
    }
    return status;
}

EXPORT int FMIGetFMUSTATE(void *c, void **state)
{
    return copied((const instance *)c, state);
}

EXPORT int FMISetFMUSTATE(void *c, void *state)
{
    (void)memcpy(c, state, sizeof(instance));
    return 0;
}

EXPORT int FMIFreeFMUSTATE(void *c, void **state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return 0;
}

EXPORT int FMISerializedFMUSTATESize(void *c, void *state, size_t *size)
{
    (void)c;
    (void)state;
    *size = sizeof(instance);
    return 0;
}

EXPORT int FMISerializeFMUSTATE(void *c, void *state, BYTE bytes[], size_t size)
{
    (void)c;
    if (size == sizeof(instance)) {
        (void)memcpy(bytes, state, size);
    }
    return (size == sizeof(instance)) ? 0 : 3;
}

EXPORT int FMIDESERIALIZEFMUSTATE(void *c, const BYTE bytes[], size_t size, void **state)
{
    int status = 3;

    (void)c;
    if (size == sizeof(instance)) {
        status = 0;
        if (*state == NULL) {
            *state = malloc(size);
        }
        if (*state == NULL) {
            status = 3;
        } else {
            (void)memcpy(*state, bytes, size);
        }
    }
    return status;
}

"""


def _common(version: Version) -> str:
    """The functions that both versions have, with their names and types in one of them."""
    two = version == "2.0"
    words = {
        "FMIDESERIALIZE": "fmi2DeSerialize" if two else "fmi3Deserialize",
        "FMUSTATE": "FMUstate" if two else "FMUState",
        "FMI": "fmi2" if two else "fmi3",
        "VERSION": version,
        "BOOL": "int" if two else "bool",
        "BYTE": "char" if two else "uint8_t",
        "COUNT": "" if two else ", size_t count",
        "USED": "" if two else "\n    (void)count;",
    }
    text = _COMMON
    for word, replacement in words.items():
        text = text.replace(word, replacement)
    return text


_FMI2 = (
    _common("2.0")
    + """\
EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
    const void *functions, int visible, int logging)
{
    (void)name;
    (void)location;
    (void)functions;
    (void)visible;
    (void)logging;
    return (type == 1) ? made(guid) : NULL;
}

EXPORT int fmi2SetupExperiment(void *c, int tolerant, double tolerance, double start, int limited, double stop)
{
    (void)tolerant;
    (void)tolerance;
    (void)limited;
    (void)stop;
    ((instance *)c)->start = start;
    return 0;
}

EXPORT int fmi2EnterInitializationMode(void *c)
{
    (void)c;
    return 0;
}

EXPORT int fmi2GetReal(void *c, const unsigned int vr[], size_t n, double values[])
{
    return get_real((const instance *)c, vr, n, values);
}

EXPORT int fmi2SetReal(void *c, const unsigned int vr[], size_t n, const double values[])
{
    return set_real((instance *)c, vr, n, values);
}

EXPORT int fmi2DoStep(void *c, double now, double size, int forward)
{
    (void)forward;
    return step((instance *)c, now + size);
}

@STUBS@
"""
)

_FMI3 = (
    _common("3.0")
    + """\
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *given, const char *path, bool visible,
    bool logging, bool events, bool early, const uint32_t intermediate[], size_t n, void *environment, void *log,
    void *update)
{
    (void)name;
    (void)path;
    (void)visible;
    (void)logging;
    (void)events;
    (void)early;
    (void)intermediate;
    (void)n;
    (void)environment;
    (void)log;
    (void)update;
    return made(given);
}

EXPORT int fmi3EnterInitializationMode(void *c, bool tolerant, double tolerance, double start, bool limited,
    double stop)
{
    (void)tolerant;
    (void)tolerance;
    (void)limited;
    (void)stop;
    ((instance *)c)->start = start;
    return 0;
}

EXPORT int fmi3GetFloat64(void *c, const uint32_t vr[], size_t n, double values[], size_t count)
{
    (void)count;
    return get_real((const instance *)c, vr, n, values);
}

EXPORT int fmi3SetFloat64(void *c, const uint32_t vr[], size_t n, const double values[], size_t count)
{
    (void)count;
    return set_real((instance *)c, vr, n, values);
}

EXPORT int fmi3DoStep(void *c, double now, double size, bool forward, bool *event, bool *terminate, bool *early,
    double *last)
{
    (void)forward;
    *event = false;
    *terminate = false;
    *early = false;
    *last = now + size;
    return step((instance *)c, now + size);
}

@STUBS@
"""
)
