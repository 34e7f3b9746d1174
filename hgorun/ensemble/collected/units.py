"""Units of what tables and figures of ensembles show: of time, states and outputs, and of the axes that have one."""

from __future__ import annotations

from collections.abc import Iterable

from hgorun.simulation.experiment.experiment import Experiment

_LEVELS = ("std", "size", "low", "high", "amplitude")  # keys of noise that are in the unit of its output


def units_of(base: Experiment, paths: Iterable[str]) -> dict[str, str]:
    """Units by names of the plant and by paths of the configuration; ``time`` is that of time.

    Parameters
    ----------
    base : Experiment
    paths : iterable of str
        Keys of the configuration that differ among members, as ``measurement.noise.0.std``; those that are times have
        no unit of their own.
    """
    known = {"time": base.blocks.time.unit, **base.plant.units}
    found = known | {path: _unit(base, path) for path in paths if "." in path}
    return {name: unit for name, unit in found.items() if unit}


def _unit(base: Experiment, path: str) -> str:
    *before, end = path.split(".")
    if before[-1] in ("initial", "inputs"):
        return base.plant.units.get(end, "")
    if before == ["plant", "parameters"]:
        parameter = base.plant.block.known_parameters.get(end)
        return "" if parameter is None else parameter.unit
    if end not in _LEVELS:
        return ""
    found = {
        base.plant.units.get(output, "")
        for output, stretches in zip(base.plant.model.outputs, base.stretches, strict=True)
        for one in stretches
        if ".".join(before).startswith(".".join(map(str, one.paths["noise"])) + ".") and one.mode == "additive"
    }
    return found.pop() if len(found) == 1 else ""
