"""The noise in the estimates along a run whose outputs are continuous and late, where the linearisation stays the same.

With s = H xi - alpha and a constant delay d, in deviations,

    xi' = A0 xi + E (alpha + s(t - d) - v),    alpha' = -K0 xi - K (alpha + s(t - d) - v)

is solved by the method of steps: d is a multiple of the step h, s is linear in a step, v its mean, and the rest
exact.
"""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.linear import Linear
from hgorun.analysis.linear.transfer import relevant
from hgorun.analysis.reasons import NoValue
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun

_FINE, _FINE_OF_NOISE = 40, 8  # steps in the time constant of the fastest pole, and in a radian of noise
_MEAN = 8  # points of a step that the noise is averaged over
_MAX_STEPS = 200_000


def noise_of_late_output(
    run: PreparedRun, linear: Linear, delay: float, noise_free: Result, at: np.ndarray
) -> np.ndarray:
    """The deviation of the estimate at some times, shape (len(at), n).

    Parameters
    ----------
    run : PreparedRun
        All its outputs are continuous and late by the same delay, in one phase.
    linear : Linear
        The observer near the run without noise.
    delay : float
    noise_free : Result
        For noise in proportion to the output.
    at : ndarray

    Raises
    ------
    NoValue
        When too many steps are needed.
    """
    from scipy.linalg import expm

    linear = relevant(linear)
    start, end = run.time.start, float(at[-1])
    h = delay / int(np.ceil(delay * max(_steps_per_time(run, linear), 1 / (end - start))))
    count, late = int(np.ceil((end - start) / h)), round(delay / h)
    if count > _MAX_STEPS:
        raise NoValue(f"following the noise of a delayed output would take {count} steps")
    N, q = linear.E.shape
    size = N + q
    M = np.zeros((size + 2 * q, size + 2 * q))  # of (xi, alpha, input, slope of the input)
    M[:N, :N], M[N:size, :N] = linear.A0, -linear.K0
    for part in (slice(N, size), slice(size, size + q)):
        M[:N, part], M[N:size, part] = linear.E, -linear.K
    M[size : size + q, size + q :] = np.eye(q)
    step = expm(M * h)
    of_state, of_input, of_slope = step[:size, :size], step[:size, size : size + q], step[:size, size + q :]
    sample = np.hstack([linear.H, -np.eye(q)])
    v = _mean_noise(run, delay, noise_free, start + h * np.arange(count), h)
    driven = -v @ of_input.T
    psi, s = np.zeros((count + 1, size)), np.zeros((count + 1, q))
    for k in range(count):
        before, now = (s[j] if j >= 0 else s[0] for j in (k - late, k + 1 - late))
        psi[k + 1] = of_state @ psi[k] + of_input @ before + of_slope @ ((now - before) / h) + driven[k]
        s[k + 1] = sample @ psi[k + 1]
    if not np.all(np.isfinite(psi)):
        raise NoValue("with this delay the linearisation is not stable")
    moved = psi[:, :N] @ linear.L.T
    return np.column_stack([np.interp(at, start + h * np.arange(count + 1), column) for column in moved.T])


def _steps_per_time(run: PreparedRun, linear: Linear) -> float:
    """So many that the fastest of the observer and of its noise are followed (1/time)."""
    rates = [np.abs(np.linalg.eigvals(M)).max(initial=0.0) for M in (linear.A0, linear.A, linear.K)]
    start, end = run.time.start, run.time.end
    of_noise = [item.fastest(start, end) for channel in run.channels for item in channel.noise[0].functions]
    return float(max(_FINE * max(rates), _FINE_OF_NOISE * max(of_noise, default=0.0)))


def _mean_noise(run: PreparedRun, delay: float, noise_free: Result, starts: np.ndarray, h: float) -> np.ndarray:
    """v of every output, its mean over each step, shape (len(starts), q)."""
    times = (starts[:, None] + h * (np.arange(_MEAN) + 0.5) / _MEAN).ravel()
    columns = []
    for i, channel in enumerate(run.channels):
        noise = channel.noise[0]
        v = noise.held(times)
        for item in noise.functions:
            v = v + item.at(times, np.zeros(times.size, dtype=np.int64))
        if channel.stretches[0].multiplicative:
            v = v * np.interp(times - delay, noise_free.time, noise_free.y[:, i])
        columns.append(v.reshape(-1, _MEAN).mean(axis=1))
    return np.column_stack(columns)
