"""The functions that FMI asks for and a unit does not have: they return an error."""

from __future__ import annotations

from collections.abc import Iterator

from hgorun.export.fmu_templates import Version


def stubs(version: Version) -> Iterator[str]:
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
