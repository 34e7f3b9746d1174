"""Why an estimate is not a number: the first operation that is not defined for its arguments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from hgorun.engine.memory import Raw
from hgorun.engine.plan import Plan
from hgorun.result.records.status import OK, Verdict
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.domains import first_undefined
from hgorun.symbolic.evaluate import Floats, at

UNBOUNDED = (1e300, 0.0)  # an observer is followed until its numbers overflow
_BEFORE = 1e-3  # of a step: so long before an event its jump has not happened yet
_EXPLODED = 1e9  # times the size of a state
_SHORTLY = 2e-6, 1e-6  # of the time until then: from there states go on in a straight line
_ONWARDS = 1, 2, 4, 8  # times the way between these
_STAGES = (0.0, 0.5, 0.5, 1.0)  # of a step, each from the slope of the one before


class Again(Protocol):
    """The same run once more."""

    def plan(self, shorter: int = 1) -> Plan:
        """Its plan, with steps so many times shorter, all of them."""
        ...

    def integrate(self, plan: Plan, until: Sequence[int] = ()) -> Raw:
        """What a plan gives when observers are followed until their numbers overflow, see :data:`UNBOUNDED`.

        Where that has become of all those in ``until``, the rest of the run may be missing: behind that the rows have
        their blocks, which are no numbers, and tell nothing of all else.
        """
        ...


def at_times(again: Again, j: int, times: Floats, *, shorter: int = 1) -> Raw:
    """A run once more with rows at other times, up to where an observer has overflowed."""
    return again.integrate(again.plan(shorter).with_grid(times), [j])


def of_estimate(run: PreparedRun, raw: Raw, j: int, xhat: Floats) -> Verdict:
    """``undefined`` from the first point on where the estimate is not a number.

    Parameters
    ----------
    xhat : ndarray, shape (N, n)
        The estimate of observer j on the run's grid.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(xhat.sum()):
            return OK
    missing = np.flatnonzero(~np.all(np.isfinite(xhat), axis=1))
    if not missing.size:
        return OK
    row = int(missing[0])
    t = float(run.grid[row])
    function = run.structure.estimates[j].function
    z, w = raw.rows[row, :, 0], np.zeros(run.structure.system.held.size)
    return Verdict(
        "undefined", t, _said(_where(run, run.observers[j], function, (t, run.numbers.p, z, w)), run.origin + t)
    )


def why_lost(run: PreparedRun, again: Again, j: int, lost: float) -> str | None:
    """What is not defined in the equations of an observer in the step in which it was lost.

    Parameters
    ----------
    lost : float
        The end of that step.

    Returns
    -------
    str or None
        None where everything is defined: the numbers have become too large.
    """
    plan, begin, step, regime = _up_to(again.plan(), lost)
    raw = again.integrate(plan)
    block, system = run.observers[j], run.structure.system
    own = slice(system.blocks[j][0], block.end)
    before, z, w = raw.rows[0, :, 0], raw.rows[-1, :, 0], raw.held[:, 0]
    if not np.all(np.isfinite(z[own])):  # by a jump with which the step begins
        jumps = [function for start, _, function in system.jumps if start == block.start]
        found = [_where(run, block, jump, (begin, run.numbers.p, before, w)) for jump in jumps]
        return _said(next(filter(None, found), None), run.origin + begin)
    flow = system.regimes[regime].flow
    for t, stage in _stages(flow, begin, step, run.numbers.p, z, w):
        if _exploded(run, j, stage):
            return None
        what = _where(run, block, flow, (t, run.numbers.p, stage, w), own)
        if what is not None:
            return _said(what, run.origin + t)
    return None


def ceased(run: PreparedRun, again: Again, j: int, lost: float) -> str | None:
    """What stops being defined in the equations of an observer at the time at which controlled steps give it up.

    No step leads to where that is: its states go on as they did shortly before. Or a sample has brought them there at
    once, and no step begins.
    """
    plan, last = again.plan().up_to(lost)
    begin, regime = float(last.spans[0, 0]), int(last.counts[0, 3])
    times = shortly_before(float(plan.spans[0, 0]), lost)
    if times is None:
        return None
    jumped = again.integrate(plan.ended_by(begin).with_grid(np.array([begin])))
    raw = again.integrate(plan.with_grid(times))
    flow = run.structure.system.regimes[regime].flow
    block, own = run.observers[j], slice(run.structure.system.blocks[j][0], run.observers[j].end)
    for t, z in [
        (begin, jumped.rows[0, :, 0]),
        *((lost, z) for z in onwards(raw.rows[0, :, 0], raw.rows[-1, :, 0])),
    ]:
        if not np.all(np.isfinite(z[own])) or _exploded(run, j, z):
            return None
        what = _where(run, block, flow, (t, run.numbers.p, z, raw.held[:, 0]), own)
        if what is not None:
            return _said(what, run.origin + t)
    return None


def shortly_before(start: float, end: float) -> Floats | None:
    """Two times from which states go on in a straight line to the end; None where there is no room for them."""
    times = np.array([end - part * (end - start) for part in _SHORTLY])
    return times if start < times[0] < times[1] < end else None


def onwards(before: Floats, last: Floats) -> Iterator[Floats]:
    """Where states come to in a straight line, from what they are at those two times."""
    with np.errstate(over="ignore", invalid="ignore"):
        yield from (last + far * (last - before) for far in _ONWARDS)


def _exploded(run: PreparedRun, j: int, z: Floats) -> bool:
    """Whether an estimate, or the plant that it drives, has become too large before anything was undefined."""
    block, n = run.observers[j], run.plant.model.n
    if run.closed:
        driven, start = (np.abs(of[run.structure.truths[j]]) for of in (z, run.numbers.z0))
        size = np.maximum(start, np.abs(z[:n]))
        if not np.all(driven <= _EXPLODED * np.where(size > 0, size, np.max(size, initial=0.0))):
            return True
    xhat = block.states["xhat"]
    own = slice(xhat.start, xhat.start + xhat.size)
    size = np.abs(run.numbers.z0[own])
    if xhat.size == n:  # most observers compute in the plant's coordinates, the others in larger ones
        size = np.maximum(size, np.abs(z[:n]))
    return not bool(np.all(np.abs(z[own]) <= _EXPLODED * np.where(size > 0, size, np.max(size, initial=0.0))))


def step_at(plan: Plan, lost: float) -> float:
    """The length of the step that ends at a time."""
    return _up_to(plan, lost)[2]


def _up_to(plan: Plan, lost: float) -> tuple[Plan, float, float, int]:
    """The plan up to the step that ends at a time, with two rows; the start of that step, its length and its regime.

    The rows are at its start and shortly before, where a jump with which it begins has not happened yet.
    """
    first, (begun, last) = float(plan.spans[0, 0]), plan.up_to(lost)
    (start, end), steps, regime = last.spans[0, :2], last.counts[0, 0], int(last.counts[0, 3])
    step = float(end - start) / float(steps)
    begin = max(lost - step, first)
    return begun.with_grid(np.unique([max(begin - _BEFORE * step, first), begin])), begin, step, regime


def _stages(
    flow: ca.Function, t: float, step: float, p: Floats, z: Floats, w: Floats
) -> Iterator[tuple[float, Floats]]:
    """Where the right-hand side is evaluated in a step of the classical Runge-Kutta method, and at its end."""
    slopes: list[Floats] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for c in _STAGES:
            stage = z + c * step * (slopes[-1] if slopes else 0.0)
            yield t + c * step, stage
            slopes.append(at(flow, t + c * step, p, stage, w)[0])
        yield t + step, z + step / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])


def _where(
    run: PreparedRun,
    block: ObserverBlock,
    function: ca.Function,
    numbers: tuple[float, Floats, Floats, Floats],
    rows: slice = slice(None),
) -> str | None:
    """What is not defined in some rows of a function of (t, p, z, w)."""
    symbols = [ca.SX.sym("s", function.size1_in(i)) for i in range(4)]
    z = symbols[2]
    model = run.plant.model
    names = [(z[i], name) for i, name in enumerate(model.states)]
    xhat, own = block.states["xhat"], block.form.saturable(block.canonical)
    if len(own) == xhat.size:
        names += [(z[xhat.start + i], name) for i, name in enumerate(own)]
    return first_undefined(function(*symbols)[rows], symbols, [np.ravel(number) for number in numbers], names)


def _said(what: str | None, t: float) -> str | None:
    return None if what is None else f"{what} at t = {t:.6g}"
