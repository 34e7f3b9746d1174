"""Why an observer of recorded data is lost, as far as its own numbers tell: no truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.estimate.carrying import estimates, one_pass
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled
from hgorun.pieces import distinct, median, medians
from hgorun.simulation.divergence.too_large import too_large_for
from hgorun.simulation.error_dynamics.apart import Apart
from hgorun.simulation.error_dynamics.timing import Timing
from hgorun.symbolic.evaluate import Floats

_ROWS = 512  # of the grid that are looked at
_CLOSER = 64  # times between the last point of the grid and the loss
_GROWN = 1e3  # times what it mostly was on the grid
_NEARLY = 0.1  # of the bound
_MOST = 100_000  # samples up to which the run is made again to look closer
_FEWEST = 4  # samples that have a usual time between them
_GROWING = 2  # the number of the sample before which no error has grown from one sample to the next
_TIMES = "taken", "available"  # of samples
_USUAL = 0.9  # of the times between samples are no longer than what is called the longest usual one
_EVEN = 0.05  # of the usual time
_LOOK = "look at its initial values, its gains and the units of the columns"


@dataclass(frozen=True, eq=False)
class Followed:
    """Numbers of an observer at some times, all finite.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Counted from the start of the run.
    xhat : ndarray, shape (k, n)
    rest : ndarray, shape (k, r)
        Its other states.
    """

    times: Floats
    xhat: Floats
    rest: Floats


def why_left(prepared: PreparedEstimate, j: int, lost: float, step: float) -> str:
    """What of an observer grew on the way beyond the bound, and its last estimates.

    The run is made again for it, so that a log that is followed in parts is told the same; of long ones only the
    bound is said.

    Parameters
    ----------
    j : int
        An observer that has diverged.
    lost : float
        When, counted from the start of the run.
    step : float
        The longest step of the run.
    """
    limit = prepared.bound(lost)
    bound = f"{limit:.3g} (solver.divergence): {_LOOK}"
    too_large = _too_large(prepared, j, lost)
    if too_large is not None:
        bound, said = bound.partition(":")[0], f"{too_large}; "
    else:
        said = ""
    beyond = f"{said}its numbers passed the bound of {bound}"
    if sum(one.values.size for one in prepared.samples) > _MOST:
        return beyond
    grid = prepared.experiment.grid[0]
    early = grid[grid < lost]
    before = _followed(prepared, j, early[:: -(early.size // _ROWS + 1)][::-1], step)
    if not before.times.size:
        return beyond
    closer = _followed(prepared, j, np.linspace(before.times[-1], lost, _CLOSER), step)
    last = closer if closer.times.size else before
    when = f"t = {prepared.run.origin + last.times[-1]:.6g}"
    return f"{said}{grown(prepared.run.plant.model.states, before, last, when, limit)}, the bound is {bound}"


def _too_large(prepared: PreparedEstimate, j: int, lost: float) -> str | None:
    """That its gain is too large for how far apart, or how late, samples are; None where that is not so, or not known.

    Not of one that is lost before errors can have grown from sample to sample: its numbers are beyond the bound for
    another reason. To an observer that goes back to late samples none was late where errors grow: in the past.
    """
    treatment, first = prepared.treatment(j), prepared.samples[0]
    if any(one.taken.size < _FEWEST or not lost > one.available[_GROWING] for one in prepared.samples):
        return None
    known = [_known(one, treatment) for one in prepared.samples]
    if any(taken.size < _FEWEST for taken, _ in known):
        return None
    usual = [_usual(np.diff(distinct(taken)), "period", "longest usual gap") for taken, _ in known]
    if all(np.array_equal(getattr(one, of), getattr(first, of)) for one in prepared.samples for of in _TIMES):
        (period, name), (delay, late_name) = usual[0], _usual(known[0][1], "delay", "longest usual delay")
        return too_large_for(prepared.run, j, Timing(period, delay, name, late_name))
    if any(np.any(late > 0) for _, late in known):
        return None
    periods = {one.output: period for one, (period, _) in zip(prepared.samples, usual, strict=True)}
    timing = Apart.of_samples([taken for taken, _ in known], periods)
    return None if timing is None else too_large_for(prepared.run, j, timing)


def _known(samples: Sampled, treatment: str) -> tuple[Floats, Floats]:
    """When samples have been taken that an observer uses, ascending, and how late each is to it."""
    taken, late = samples.taken, samples.available - samples.taken
    if treatment == "replay":
        return np.sort(taken), np.zeros(taken.size)
    if np.any(late > 0):
        some = late <= 0 if treatment == "drop" else samples.used  # and not those that newer ones have overtaken
        return taken[some], late[some]
    return taken, late


def _usual(times: Floats, even: str, uneven: str) -> tuple[float, str]:
    """What most of some times are, and what that is called."""
    short, usual, long = np.quantile(times, [1 - _USUAL, 0.5, _USUAL]).tolist()
    return (usual, even) if long - short <= _EVEN * usual else (long, uneven)


def _followed(prepared: PreparedEstimate, j: int, times: Floats, step: float) -> Followed:
    """An observer at some times, as far as all of its numbers are finite."""
    block = prepared.run.observers[j]
    own = block.states["xhat"]
    rest = [k for k in range(block.start, block.stop) if not own.start <= k < own.start + own.size]
    with np.errstate(all="ignore"):
        raw, _, _ = one_pass(prepared, times, step)
        xhat, rows = estimates(prepared, times, raw)[j], raw.rows[:, rest, 0]
        there = np.all(np.isfinite(xhat), axis=1) & np.all(np.isfinite(rows), axis=1)
    return Followed(times[there], xhat[there], rows[there])


def grown(names: Sequence[str], before: Followed, last: Followed, when: str, bound: float) -> str:
    """What grew, and the estimates then."""
    shown = ", ".join(f"{name} = {value:.4g}" for name, value in zip(names, last.xhat[-1], strict=True))
    size, usual = np.abs(last.xhat[-1]), np.maximum(medians(np.abs(before.xhat), 0), 1e-3)
    if np.any((size > _GROWN * usual) | (size > _NEARLY * bound)):
        k = int(np.argmax(size / usual))
        return f"its estimate of {names[k]} grew until {shown} at {when}"
    own = float(np.max(np.abs(last.rest[-1]), initial=0.0))
    if own > _GROWN * median(np.max(np.abs(before.rest), axis=1, initial=1e-3)) or own > _NEARLY * bound:
        return f"its own states (its gain, P) grew to {own:.3g} while it estimated {shown} at {when}"
    return f"its numbers grew within one step from the estimates {shown} at {when}"
