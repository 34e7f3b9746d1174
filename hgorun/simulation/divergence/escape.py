"""Plants that reach infinity in finite time, as x' = x^2 does: no step follows them, and long ones jump across."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import casadi as ca
import numpy as np

from hgorun.errors import NoStep, PlantDiverged, PlantEnded, ShortHistory, SimulationError
from hgorun.result.records.data import PLANT
from hgorun.simulation.checks.far_start import far_plant
from hgorun.simulation.passes.between_steps import SMOOTH, jumps_of
from hgorun.simulation.passes.loss import onwards, shortly_before
from hgorun.simulation.plant_alone import PlantRun
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.domains import first_undefined

_BEFORE = 1e-3, 1e-6  # of the time until then
_GROWS = 0.2  # between these, of what it was before: (t* - t)^-p does for p > 0.03, and so does log(t* - t)


def escaped(run: PreparedRun) -> PlantDiverged | None:
    """That the plant has reached infinity, and when; None where it does not, or where that cannot be told.

    The plant alone is followed with steps that errors control, until none is small enough. A state that is singular
    there and stays finite, as that of x' = -1/x does, hardly changes any more shortly before.
    """
    if run.closed or run.plant.block.discretise:
        return None
    end = _end(run)
    if end is None:
        return None
    start = run.time.start
    last = [end - part * (end - start) for part in _BEFORE]
    times = np.concatenate([np.linspace(start, last[0], 50), last[1:]])
    until = replace(_alone(run), time=run.time.model_copy(update={"end": last[-1]}))
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


def _alone(run: PreparedRun) -> PlantRun:
    return PlantRun(run.plant, run.time, run.step, run.origin, stiff=True)


def _end(run: PreparedRun) -> float | None:
    """When no step is small enough any more for the plant alone; None where that does not happen."""
    try:
        _alone(run).states(np.zeros(0))
    except NoStep as error:
        return error.at
    except SimulationError:
        pass
    return None


def explained(run: PreparedRun, error: PlantEnded) -> PlantEnded:
    """The same, with what is to blame: what stops being defined, as the root of a level, a huge start, or friction."""
    return _ceased(run, error) or _from_far(run, error) or _jumped(run, error) or error


def _from_far(run: PreparedRun, error: PlantEnded) -> PlantEnded | None:
    """That the plant starts so far out that numbers have no digits left for what happens."""
    why = far_plant(run)
    return (
        None if why is None else type(error)(f"the plant is lost at t = {run.origin + error.at:.6g}: {why}", error.at)
    )


def _ceased(run: PreparedRun, error: PlantEnded) -> NoStep | None:
    """That something stops being defined, as the root of a level that falls below 0."""
    if run.closed or run.plant.block.discretise:
        return None
    end = error.at if isinstance(error, NoStep) else _end(run)
    with suppress(SimulationError):
        what = None if end is None else _undefined(run, end)
        if what is not None and end is not None:
            return NoStep(
                f"the plant cannot be followed beyond t = {run.origin + end:.6g}: {what} in its equations; end the run "
                "before, or limit the argument, as in sqrt(max(x, 0))",
                at=end,
            )
    return None


def _jumped(run: PreparedRun, error: PlantEnded) -> NoStep | None:
    """That a state may stick where the equations jump, so that no step which errors control is small enough."""
    if not isinstance(error, NoStep):
        return None
    what = jumps_of(run, PLANT)
    if not what:
        return None
    step, when = min(run.step, run.longest_gap), f"t = {run.origin + error.at:.6g}"
    if isinstance(error, ShortHistory):
        where = f"at {when} steps become so short that too many would have to be kept for the delay: the plant's"
    else:
        where = f"no step is small enough for the plant at {when}: its"
    return type(error)(
        f"{where} equations jump ({what}), and no tolerance is met where a state sticks there; write {SMOOTH}, or give "
        f"a step, as in solver: {{method: rk4, step: {step:.2g}}}",
        error.at,
    )


def _undefined(run: PreparedRun, end: float) -> str | None:
    """What is not defined in the plant's equations where its state goes on as before a time."""
    times = shortly_before(run.time.start, end)
    if times is None:
        return None
    near = replace(_alone(run), time=run.time.model_copy(update={"end": times[1]}))
    before, last = near.states(times)
    plant, model = run.plant.symbolic, run.plant.model
    rates = ca.SX(model.f(model.t, model.x, plant.inputs, model.p))
    symbols = [model.t, model.x, plant.everything]
    names = [(model.x[i], name) for i, name in enumerate(model.states)]
    for x in onwards(before, last):
        what = first_undefined(rates, symbols, [np.array([end]), x, run.plant.everything], names)
        if what is not None:
            return what
    return None
