"""The functions of FMI 2.0 and 3.0, in C: names between @ are filled in."""

from __future__ import annotations

from hgorun.export.fmu_templates import Version

_COMMON = """\
EXPORT const char *FMIGetVersion(void)
{
    return "VERSION";
}

EXPORT int FMISetDebugLogging(void *c, BOOL on, size_t n, const char *const categories[])
{
    hear((instance *)c, (on) ? 1 : 0, n, categories);
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

EXPORT int FMIGetFMUSTATE(void *c, void **state)
{
    return copied((const instance *)c, state);
}

EXPORT int FMISetFMUSTATE(void *c, void *state)
{
    take((instance *)c, (const instance *)state);
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
    }
    text = _COMMON
    for word, replacement in words.items():
        text = text.replace(word, replacement)
    return text


FMI2 = (
    _common("2.0")
    + """\
EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
    const void *functions, int visible, int logging)
{
    instance *const m = (type == 1) ? made(guid) : NULL;

    (void)location;
    (void)visible;
    (void)logging;
    if ((m != NULL) && (functions != NULL)) {
        m->log = ((const callbacks *)functions)->log;
        m->environment = ((const callbacks *)functions)->environment;
        (void)strncpy(m->name, (name != NULL) ? name : "", sizeof(m->name) - 1U);
    }
    return m;
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

EXPORT int fmi2DoStep(void *c, double now, double size, int forward)
{
    (void)forward;
    return step((instance *)c, now + size);
}

@STUBS@
"""
)

FMI3 = (
    _common("3.0")
    + """\
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *given, const char *path, bool visible,
    bool logging, bool events, bool early, const uint32_t intermediate[], size_t n, void *environment, logger log,
    void *update)
{
    instance *const m = made(given);

    (void)name;
    (void)path;
    (void)visible;
    (void)logging;
    (void)events;
    (void)early;
    (void)intermediate;
    (void)n;
    (void)update;
    if (m != NULL) {
        m->log = log;
        m->environment = environment;
    }
    return m;
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
