"""How much an error grows over a period of sampling: monodromy matrices, and their products along a trajectory."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.error_system import ErrorSystem
from hgorun.analysis.linear.exponentials import interpolated, ordered_product, transitions
from hgorun.simulation.error_dynamics.monodromy import monodromy, on_their_way

MAX_PERIODS = 20_000  # that a growth rate is taken over, the first ones of a trajectory
_CYCLES = 2, 5  # of an orbit that a growth rate is taken over, where that does not take too few periods
_SEVERAL = 40, 80  # of these at least, and as many where they are longer than the orbit
_PHASES = 4  # of an orbit at which the first sample is taken, where periods are no small part of it
_SMALL = 0.1


def growth(system: ErrorSystem, period: float, delay: float = 0.0) -> float:
    """Mean exponential rate of the error with a sample each period, ``delay`` old when it arrives (1/time).

    The sample of time t_k - d arrives at t_k. From then on the innovation is e(t) = H xi(t_k - d) minus what
    the observer has corrected since; the samples that are on their way, m = floor(d / period) of them, are
    carried along in the same way, each as what the innovation would be now. With delta = d - m period the
    next one is taken at t_(k+1) - delta. The rate is log rho / time, rho the spectral radius of the product of
    the monodromy matrices over all whole periods of the trajectory, or of the one that they all are. On an orbit
    they are as many as make up whole cycles of it, as nearly as a few of them can: the error is then back where it was.
    Where period and cycle are in proportion, the rate depends on where on the orbit samples are taken, and beside
    such a period that changes slowly: it is the mean over several places.
    """
    waiting, rest = on_their_way(period, delay)
    several = 1
    if system.constant:
        count = 1
    elif system.cycle is None:
        whole = (system.times[-1] - system.times[0]) / period * (1 + 1e-12)
        count = int(np.clip(whole, 1, MAX_PERIODS))
    else:
        count = _closing(period, system.cycle)
        several = _PHASES if period > _SMALL * system.cycle else 1
    phases = (system.cycle or 0.0) / several * np.arange(several)
    starts = ((0.0 if system.constant else system.times[0]) + phases[:, None] + period * np.arange(count)).ravel()
    before = transitions(system, starts, period - rest)
    after = transitions(system, starts + period - rest, rest) if rest > 0 else None
    H = interpolated(system.times, system.H, system.within(starts + period - rest))
    M = monodromy(before, after, H, waiting)
    rates = [_logarithm(one) for one in M.reshape(several, count, *M.shape[1:])]
    return float(np.mean(rates) / (count * period))


def _logarithm(factors: np.ndarray) -> float:
    """Of the spectral radius of the product of factors."""
    product, logarithm = ordered_product(factors)
    radius = float(np.max(np.abs(np.linalg.eigvals(product))))
    with np.errstate(divide="ignore"):
        return float(np.log(radius) + logarithm)


def _closing(period: float, cycle: float) -> int:
    """How many periods are nearest to a whole number of cycles."""
    least, most = (int(np.ceil(number * cycle / period)) for number in _CYCLES)
    counts = np.arange(max(least, _SEVERAL[0]), max(most, _SEVERAL[1]) + 1)
    ends = counts * period / cycle
    return int(counts[np.argmin(np.abs(ends - np.round(ends)))])
