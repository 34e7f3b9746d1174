"""The run of a prepared estimate: with steps that are given or found by error control, outliers left out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.again import Again
from hgorun.engine.memory import Raw
from hgorun.engine.methods import METHODS
from hgorun.engine.plan import Plan
from hgorun.estimate.gate.gated import GatedRun
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.sessions import session_of
from hgorun.simulation.timeline.steps import part_of_difference, steps_between
from hgorun.symbolic.evaluate import Floats

UNEVEN = 1.62  # steps of the second pass, for each of the first
_RESTS = 1e-9  # of the largest state of an estimate: one that is smaller all along rests at zero
ORDER = 2  # as which errors fall at least
HALVINGS = 12
LOST_HALVINGS = 6  # of them for observers that are lost alone: some are with any step
_STABLE = 3.0  # times 1/rate: longer steps of RK4 and DOPRI5 amplify what decays
_ALIKE = 0.05  # of the time until an observer is lost: so far apart it is with two steps that show the same
_SHORTER = tuple(1 << k for k in range(4, 24, 4))  # times so many steps in place of a first one
_ROWS = 1 << 15  # that are compared at a time: there may be many


@dataclass(frozen=True, eq=False, repr=False)
class Carried:
    """What a run has given.

    Attributes
    ----------
    raw : Raw
    used : ndarray of bool, shape (samples, m)
        Which samples each observer has taken: all but outliers and those that came after a newer one that was taken.
    offered : ndarray of bool, shape (samples, m)
        Those and the outliers.
    step : float
        The longest step.
    error : ndarray, shape (m,)
        Of every observer's estimate: largest error of the integration relative to the largest value of the state; nan
        where it was not asked for.
    evaluations : int
        Of the right-hand side, over all passes.
    xhat : list of ndarray or None
        Of every observer on the grid, where that is short enough to keep.
    by_steps : ndarray of bool, shape (m,), or None
        Which observers are lost since the steps are too long for them, as other steps show; None where none did.
    """

    raw: Raw
    used: np.ndarray
    offered: np.ndarray
    step: float
    error: Floats
    evaluations: int
    xhat: list[Floats] | None = None
    by_steps: np.ndarray | None = None

    @property
    def judged(self) -> bool:
        """Whether of all observers that are lost it is known why."""
        return self.by_steps is not None or not np.any(np.isfinite(self.raw.diverged))


def carry_out(
    prepared: PreparedEstimate,
    grid: Floats,
    progress: Callable[[float], None] | None = None,
    *,
    with_error: bool = True,
    once: bool = False,
) -> Carried:
    """Carry out a run.

    A given step is taken as it is. An automatic one is halved until a second pass with other steps gives the same
    estimates to ``solver.accuracy``, and the same times at which observers are lost, as far as
    ``solver.max_evaluations`` permits.

    Parameters
    ----------
    grid : ndarray
        Where estimates are wanted, counted from the start of the run.
    with_error : bool
        Whether the error is wanted of a given step, too, which takes a pass more.
    once : bool
        Whether no flow is made again for what it loses, so that all steps have to be short enough.
    """
    solver, step, spent = prepared.run.solver, prepared.run.step, 0
    if not (with_error or solver.controlled):
        raw, used, offered = one_pass(prepared, grid, step, progress=progress)
        unknown = np.full(len(prepared.run.observers), np.nan)
        return Carried(raw, used, offered, step, unknown, raw.tries * len(METHODS[prepared.method].c))
    for halvings in range(HALVINGS):
        beside, lost, tries = _other_estimates(prepared, grid, step, progress, once=once)  # first: little is left of it
        raw, used, offered = one_pass(prepared, grid, step, progress=progress, once=once)
        spent += (raw.tries + tries) * len(METHODS[prepared.method].c)
        xhat = estimates(prepared, grid, raw) if grid.size <= _ROWS else None
        error = _error(prepared, grid, raw, xhat, beside, step)
        apart = lost_apart(raw.diverged[:, 0], lost) & (solver.divergence is None)  # a given bound is meant as it is
        enough = np.all(error <= solver.accuracy) and not (np.any(apart) and halvings < LOST_HALVINGS)
        if not solver.controlled or enough or 2 * spent > solver.max_evaluations:
            break
        step /= 2
    at_once = apart & (raw.diverged[:, 0] <= step) & ~_too_fast(prepared, step)  # which may be so with any step
    if np.any(at_once):
        at_once &= ~_followed_by_shorter(prepared, np.where(at_once, raw.diverged[:, 0], 0.0))
    return Carried(raw, used, offered, step, error, spent, xhat, apart & ~at_once)


def _too_fast(prepared: PreparedEstimate, step: float) -> np.ndarray:
    """Which observers have a rate that explicit steps of such a length do not follow; 0: not known."""
    rates = [b.observer.fastest_rate(b.form) or 0.0 for b in prepared.run.observers]
    return np.array(rates) * min(step, prepared.run.longest_gap) > _STABLE


def _followed_by_shorter(prepared: PreparedEstimate, lost: Floats) -> np.ndarray:
    """Which observers are not lost by the times at which a first step has lost them, if steps are short enough.

    Parameters
    ----------
    lost : ndarray, shape (m,)
        Times from the start on, or 0 for those that are not asked for.
    """
    followed, until = np.zeros(lost.size, dtype=bool), float(np.max(lost))
    for shorter in _SHORTER:
        plan = prepared.plan(np.zeros(1), until / shorter, whole=True)
        stop = int(np.argmax(plan.spans[:, 1] >= until)) + 1
        spans, counts = plan.spans[:stop].copy(), plan.counts[:stop].copy()
        since, end = spans[-1, :2]
        count = max(int(np.ceil(counts[-1, 0] * (until - since) / (end - since))), 1)
        counts[-1, :3] = count, 0, count
        spans[-1, [1, 3]] = np.minimum(spans[-1, [1, 3]], until)  # what comes behind is not asked for
        raw = prepared.program().run(replace(plan, spans=spans, counts=counts), prepared.start())
        followed |= raw.diverged[:, 0] > lost
        if np.all(followed):
            break
    return followed


def lost_apart(own: Floats, other: Floats) -> np.ndarray:
    """Which observers are lost at times that depend on the steps, or with some steps only, as growth by steps does.

    Parameters
    ----------
    own, other : ndarray, shape (m,)
        When each observer is lost with two steps, counted from the start of the run; infinite: it is not.
    """
    with np.errstate(invalid="ignore"):
        near = np.abs(own - other) <= _ALIKE * np.maximum(own, other)
    return np.asarray(~(near & np.isfinite(own) & np.isfinite(other)) & (own != other))


def one_pass(
    prepared: PreparedEstimate,
    grid: Floats,
    step: float,
    uneven: float | None = None,
    *,
    progress: Callable[[float], None] | None = None,
    once: bool = False,
) -> tuple[Raw, np.ndarray, np.ndarray]:
    """The engine's arrays, and which samples were used and offered, shape (samples, m).

    Where an observer is lost, and no step is given, flows that lose one are made again for it, as in a stream; not
    where each is made ``once``.
    """
    plan = prepared.plan(grid, step, uneven)
    if prepared.gated:
        found = _gated(prepared, plan, uneven)
    else:
        used = prepared.used()
        found = prepared.program().run(plan, prepared.start(), progress=progress), used, used
    again = None if once else prepared.again
    if again is None or not np.any(np.isfinite(found[0].diverged)):
        return found
    if prepared.gated:
        return _gated(prepared, plan, uneven, again)
    plan = prepared.plan(grid, step, uneven, whole=True)
    return session_of(prepared, plan, again).finish(), used, used


def _gated(
    prepared: PreparedEstimate, plan: Plan, uneven: float | None, again: Again | None = None
) -> tuple[Raw, np.ndarray, np.ndarray]:
    """A pass in which outliers are left out."""
    used = prepared.used()
    offered = used.copy()
    return GatedRun(prepared, plan, uneven is not None, used, offered, again).carried_out(), used, offered


def _other_estimates(
    prepared: PreparedEstimate, grid: Floats, step: float, progress: Callable[[float], None] | None, *, once: bool
) -> tuple[list[Floats], Floats, int]:
    """xhat of every observer in a pass with other steps, (len(grid), n) each; when each is lost; how many steps."""
    raw, _, _ = one_pass(prepared, grid, step, UNEVEN, progress=progress, once=once)
    n = len(prepared.run.plant.model.states)
    found = [np.empty((grid.size, n)) for _ in prepared.run.observers]
    for piece in _pieces(grid.size):
        for own, x in zip(found, estimates(prepared, grid[piece], raw, piece), strict=True):
            own[piece] = x
    return found, raw.diverged[:, 0], raw.tries


def _pieces(count: int) -> Iterator[slice]:
    return (slice(start, start + _ROWS) for start in range(0, count, _ROWS))


def _error(
    prepared: PreparedEstimate,
    grid: Floats,
    raw: Raw,
    xhat: Sequence[Floats] | None,
    beside: Sequence[Floats],
    step: float,
) -> Floats:
    """Of every observer, from its estimates, found piece by piece unless they are known, and those of another pass."""
    steps = steps_between(prepared.run.schedule, step)
    part = part_of_difference(steps, UNEVEN, min(METHODS[prepared.method].order, ORDER))
    count, n = len(prepared.run.observers), len(prepared.run.plant.model.states)
    sizes, gaps = np.zeros((count, n)), np.zeros((count, n))
    with np.errstate(invalid="ignore"):
        for piece in _pieces(grid.size):
            for j, a in enumerate(estimates(prepared, grid[piece], raw, piece) if xhat is None else xhat):
                note_difference(sizes[j], gaps[j], a, beside[j][piece])
    return relative_error(part, sizes, gaps)


def note_difference(sizes: Floats, gaps: Floats, own: Floats, other: Floats) -> None:
    """Note how large estimates are, (n_t, n) of them, and how far from those with other steps.

    Column by column: numpy takes eight times as long for rows of few numbers.

    Parameters
    ----------
    sizes, gaps : ndarray, shape (n,)
        The largest so far, which are changed.
    own, other : ndarray, shape (n_t, n)
    """
    for k, (a, b) in enumerate(zip(own.T, other.T, strict=True)):
        sizes[k] = np.maximum(sizes[k], np.max(np.abs(a)))
        gaps[k] = np.maximum(gaps[k], np.max(np.abs(a - b)))


def relative_error(part: float, sizes: Floats, gaps: Floats) -> Floats:
    """Of every observer: a part of the difference to other steps, over the size; zero where that is not finite.

    A state that rests at zero has no size but rounding: its differences are relative to 1e-9 of the largest state.

    Parameters
    ----------
    part : float
        See :func:`~hgorun.simulation.timeline.steps.part_of_difference`.
    sizes, gaps : ndarray, shape (m, n)
        The largest estimates, and differences.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        least = _RESTS * np.max(sizes, axis=1, keepdims=True, initial=0.0)
        errors = part * np.max(gaps / np.where(sizes > 0, np.maximum(sizes, least), 1.0), axis=1, initial=0.0)
    return np.where(np.all(np.isfinite(sizes), axis=1), errors, 0.0)


def estimates(prepared: PreparedEstimate, grid: Floats, raw: Raw, piece: slice = slice(None)) -> list[Floats]:
    """xhat of every observer in the plant's coordinates, shape (len(grid), n) each.

    Parameters
    ----------
    grid : ndarray
        The output times of the run, or a piece of them.
    raw : Raw
    piece : slice
        Which piece it is.
    """
    structure = prepared.run.structure
    known = all(one.places is not None for one in structure.estimates)
    held = None if known else prepared.held(grid)  # of which inputs matter
    stacked = structure.estimates_along(grid, prepared.run.numbers.p, raw.rows[piece, :, 0], held)
    return [stacked.of(j) for j in range(len(prepared.run.observers))]
