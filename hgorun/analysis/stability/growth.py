"""How much an error grows over a period of sampling: monodromy matrices, and their products along a trajectory."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.error_system import ErrorSystem
from hgorun.analysis.linear.exponentials import interpolated, ordered_product, transitions
from hgorun.simulation.error_dynamics.monodromy import monodromy, on_their_way

MAX_PERIODS = 20_000  # that a growth rate is taken over, the first ones of a trajectory


def growth(system: ErrorSystem, period: float, delay: float = 0.0) -> float:
    """Mean exponential rate of the error with a sample each period, ``delay`` old when it arrives (1/time).

    The sample of time t_k - d arrives at t_k. From then on the innovation is e(t) = H xi(t_k - d) minus what
    the observer has corrected since; the samples that are on their way, m = floor(d / period) of them, are
    carried along in the same way, each as what the innovation would be now. With delta = d - m period the
    next one is taken at t_(k+1) - delta. The rate is log rho / time, rho the spectral radius of the product of
    the monodromy matrices over all whole periods of the trajectory, or of the one that they all are.
    """
    waiting, rest = on_their_way(period, delay)
    if system.constant:
        starts, count = np.zeros(1), 1
    else:
        whole = (system.times[-1] - system.times[0]) / period * (1 + 1e-12)
        count = int(np.clip(whole, 1, MAX_PERIODS))
        starts = system.times[0] + period * np.arange(count)
    before = transitions(system, starts, period - rest)
    after = transitions(system, starts + period - rest, rest) if rest > 0 else None
    H = interpolated(system.times, system.H, starts + period - rest)
    M = monodromy(before, after, H, waiting)
    product, logarithm = ordered_product(M)
    radius = float(np.max(np.abs(np.linalg.eigvals(product))))
    with np.errstate(divide="ignore"):
        return float((np.log(radius) + logarithm) / (count * period))
