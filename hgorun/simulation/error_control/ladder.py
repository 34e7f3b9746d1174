"""The ladder span / 2^k of fixed steps: where a run begins on it, how far down it goes next, and what that costs."""

from __future__ import annotations

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.methods import METHODS
from hgorun.errors import Problem
from hgorun.simulation.passes.passes import Pass, fixed_steps
from hgorun.simulation.prepared import PreparedRun

UNEVEN = 0.62  # steps of the run that is compared, for each step
_PRECISE = 1e-6  # below this accuracy the method of order five is cheaper
_STEEP = 4  # times 2: no further down the ladder at once, since the order may not be reached yet
_UNIFORM = 1 << 17  # fixed steps, before those of a controlled run are tried
_FINEST = 200  # doubles: no step is shorter


def steps_left(method: Method, evaluations: float, spent: int) -> float:
    """How many steps the evaluations that are left are enough for."""
    return float(np.floor((evaluations - spent) / Pass(method=method, step=1.0).evaluations_of_a_step))


def first_stage(run: PreparedRun) -> tuple[Method, float] | None:
    """The method and the largest number of fixed steps with which the search begins; None where it does not so."""
    solver = run.solver
    if solver.method == "auto":
        method: Method = "rk4" if solver.accuracy >= _PRECISE else "dopri5"
        return method, max(_UNIFORM, 8 * run.schedule.size)
    return None if METHODS[solver.method].error else (solver.method, np.inf)


def rung(run: PreparedRun) -> int:
    """The rung k of the ladder span / 2^k on which a run begins: the nominal step, or up to twice as long."""
    return round(float(np.log2(run.span / run.step)))


def finest_rung(run: PreparedRun) -> int:
    """The last rung with steps that are long beside the rounding of times."""
    finest = _FINEST * float(np.spacing(max(abs(run.origin + run.time.start), abs(run.origin + run.time.end))))
    return int(np.floor(np.log2(run.span / finest)))


def further_down(excess: np.ndarray, order: np.ndarray) -> np.ndarray:
    """How many rungs further down, where errors are so many times too large; 2 where they are not finite."""
    with np.errstate(invalid="ignore"):
        down = np.clip(np.ceil(np.log2(np.maximum(excess, 1.0) * 2) / order), 1, _STEEP)
    return np.where(np.isfinite(excess), down, 2).astype(int)


def order_of(method: Method, error: np.ndarray, before: np.ndarray, rungs: np.ndarray) -> np.ndarray:
    """With which power of the step errors fall: the method's order, or less where two passes show that.

    Parameters
    ----------
    error, before : ndarray
        With a step, and with one so many ``rungs`` longer; not finite where that is not known.
    """
    order = float(METHODS[method].order)
    known = np.isfinite(before) & (error > 0) & (error < np.inf)
    with np.errstate(invalid="ignore", divide="ignore"):
        seen = np.clip(np.log2(before / error) / rungs, 0.5, order)
    return np.where(known, seen, order)


def step_counts(run: PreparedRun, step: float) -> tuple[float, float]:
    """Fixed steps of a run, and those of the pass beside it; infinite where there are too many to be counted."""
    try:
        steps = fixed_steps(run, step)
    except Problem:
        return np.inf, np.inf
    return float(steps.total), float(steps.uneven(UNEVEN))
