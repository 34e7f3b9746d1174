"""Plants that reach infinity in finite time, as x' = x^2 does: no step follows them, and long ones jump across."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hgorun.errors import NoStep, PlantDiverged, SimulationError
from hgorun.simulation.plant_alone import PlantRun
from hgorun.simulation.prepared import PreparedRun

_BEFORE = 1e-3, 1e-6  # of the time until then
_GROWS = 0.2  # between these, of what it was before: (t* - t)^-p does for p > 0.03, and so does log(t* - t)


def escaped(run: PreparedRun) -> PlantDiverged | None:
    """That the plant has reached infinity, and when; None where it does not, or where that cannot be told.

    The plant alone is followed with steps that errors control, until none is small enough. A state that is singular
    there and stays finite, as that of x' = -1/x does, hardly changes any more shortly before.
    """
    if run.closed or run.plant.block.discretise:
        return None
    alone = PlantRun(run.plant, run.time, run.step, run.origin, stiff=True)
    try:
        alone.states(np.zeros(0))
    except NoStep as error:
        end = error.at
    except SimulationError:
        return None
    else:
        return None
    start = run.time.start
    last = [end - part * (end - start) for part in _BEFORE]
    times = np.concatenate([np.linspace(start, last[0], 50), last[1:]])
    until = replace(alone, time=run.time.model_copy(update={"end": last[-1]}))
    try:
        x = np.abs(until.states(times))
    except SimulationError:
        return None
    grown = x[-1] - x[-2] > _GROWS * np.max(x[:-1], axis=0)
    if not np.any(grown):
        return None
    lost = [state for state, one in zip(run.plant.model.states, grown, strict=True) if one]
    reach = f"{', '.join(lost)} {'reaches' if len(lost) == 1 else 'reach'} infinity"
    return PlantDiverged(
        f"the plant itself diverged at t = {run.origin + end:.6g}, where {reach}: nothing can be said about its "
        "observers after that; end the run before",
        at=end,
    )
