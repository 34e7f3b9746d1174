"""Whether a run starts so far out that no gain helps: the key and its number."""

from __future__ import annotations

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.prepared import PreparedRun

_FAR = 1e6  # times all that the plant's states are: so far an estimate is lost, see simulation.divergence.verdict
_HUGE = 1e15  # beside which numbers have no digits left for what is of size 1


def far_start(run: PreparedRun, raw: Raw, j: int) -> str | None:
    """The initial state or estimate that is to blame where an observer diverges; None where neither is."""
    plant = far_plant(run)
    if plant is not None:
        return plant
    block = run.observers[j]
    states = raw.rows[:, run.structure.truths[j], 0][:, : run.plant.model.n]
    size = float(np.max(np.abs(states), where=np.isfinite(states), initial=0.0))
    given = block.observer.initial
    name = max(given, key=lambda one: abs(given[one]), default="")
    if not name or abs(given[name]) <= _FAR * size or not size:
        return None
    key = f"observers.{block.label}.initial.{name}"
    return f"{key} is {given[name]:.6g}, too far away: the plant's states are {size:.3g} at most; give a nearer one"


def far_plant(run: PreparedRun) -> str | None:
    """The initial state that is to blame where a plant diverges; None where none is."""
    found = huge_start(run.plant)
    if found is None:
        return None
    name, value = found
    lost = f"{np.spacing(abs(value)):.1g}"
    why = f"beside which numbers lose what is smaller than {lost}: give one of a usual size"
    return f"plant.initial.{name} is {value:.6g}, {why}"


def huge_start(plant: BuiltPlant) -> tuple[str, float] | None:
    """The largest initial state of the plant, where it is so large that numbers have no digits left for others."""
    states = zip(plant.model.states, plant.initial.tolist(), strict=True)
    name, value = max(states, key=lambda one: abs(one[1]))
    return (name, value) if abs(value) >= _HUGE else None
