"""The noise in the estimates along a run: the linearised observer driven by the run's own noise.

Between the events of the run (samples taken and arriving, changes of held noise) and a few points more each
stretch is a matrix exponential, by Magnus' fourth-order method. A coefficient taken constant there would not do:
its sawtooth turns fast noise, which a filter takes out, into slow noise, which it does not. The states are
psi = (xi, alpha, h, waves): the deviations of the observer's states and of alpha that noise causes, and what drives
them. Of a continuous output that is the held part of its noise and its sinusoids, each a rotation; of a sampled one
h = s(taken) - v, s = H xi - alpha, which waits until the sample arrives.

Noise that is not small moves the point where the equations are differentiated. So the mean slope between the run
without noise and the one that was predicted takes the place of the slope, until the prediction stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.transfer import relevant_states, restricted
from hgorun.analysis.noise.events import Edges, edges_of
from hgorun.analysis.reasons import NO_SLOPES, NoValue, no_spectrum
from hgorun.measurement.channels import Channel
from hgorun.noise.base import Wave
from hgorun.result.result import Result
from hgorun.simulation.error_dynamics.monodromy import exponentials
from hgorun.simulation.prepared import PreparedRun

_NUMBERS = 60_000  # states times points of the noise_free's output grid at which it is linearised
_POINTS = 3000, 6000  # fewest and most points
_STRETCHES, _STRETCHES_OF_WAVES = 3000, 6000  # of a run, at least
GAUSS = (0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6)  # nodes of the mean slope, of equal weight
_ROUNDS, _STANDS = 8, 0.01  # predictions at most, and the relative change below which one stands


@dataclass(frozen=True)
class _Waves:
    """The sinusoids of a continuous output: v(t) is the sum of Im(phasor exp(j omega t))."""

    phasors: np.ndarray
    omegas: np.ndarray


@dataclass(frozen=True)
class Deviation:
    """What the noise of a run does to an estimate, as far as the linearised observer says.

    Attributes
    ----------
    times : ndarray, shape (K,)
        Not evenly spaced.
    estimate : ndarray, shape (K, n)
        The deviation of each state of the estimate.
    mean_square : ndarray, shape (n,)
        Over the steady window.
    """

    times: np.ndarray
    estimate: np.ndarray
    mean_square: np.ndarray


def noise_along(
    run: PreparedRun, label: str, result: Result, noise_free: Result, at: np.ndarray | None = None
) -> Deviation:
    """What the run's noise does to each state of the estimate.

    Parameters
    ----------
    run : PreparedRun
        With noise.
    label : str
        Of the observer.
    result, noise_free : Result
        Of the run, whose samples give the noise, and of the same without noise, where the observer is linearised.
    at : ndarray, optional
        Times that have to be among those of the deviation.

    Raises
    ------
    NoValue
        For what has no linear answer: outputs both continuous and late, continuous outputs with noise
        whose spectrum is not known, runs with more events than can be followed, noise too large for slopes.
    """
    observer = Linearisation(run, label)
    limit = int(np.clip(_NUMBERS / observer.size, *_POINTS))
    points = np.arange(0, noise_free.time.size, max(noise_free.time.size // limit, 1))
    if points.size < 4:
        raise NoValue("the output grid has too few points to linearise along")
    times, xi = noise_free.time[points], observer.states(noise_free.observers[label], points)
    waves = [_waves(channel) for channel in run.channels]
    stretches = _STRETCHES if any(w is None for w in waves) else _STRETCHES_OF_WAVES
    edges = edges_of(run, result, noise_free, stretches, () if at is None else at)
    systems = observer.systems(times, xi)
    power: np.ndarray | None = None
    for _ in range(_ROUNDS):
        if not all(np.all(np.isfinite(value)) for value in vars(systems).values()):
            raise NoValue(NO_SLOPES)
        keep = relevant_states(systems)
        with np.errstate(all="ignore"):  # slopes that do not fit the noise lead to numbers that overflow
            moved, e, deviation = _followed(run, noise_free, result, edges, waves, times, restricted(systems, keep))
        found = deviation.mean_square
        path = np.zeros_like(xi)
        path[:, keep] = moved
        if not np.all(np.isfinite(found)):
            break
        if power is not None and np.all(np.abs(np.sqrt(found) - np.sqrt(power)) <= _STANDS * np.sqrt(found)):
            return deviation
        power = found
        nodes = [observer.systems(times, xi + c * path, c * e) for c in GAUSS]
        systems = Linear(*[0.5 * (a + b) for a, b in zip(*(vars(n).values() for n in nodes), strict=True)])
    raise NoValue("the noise is too large to predict its effect from the observer's slopes")


def _followed(
    run: PreparedRun,
    noise_free: Result,
    result: Result,
    edges: Edges,
    waves: list[_Waves | None],
    times: np.ndarray,
    at: Linear,
) -> tuple[np.ndarray, np.ndarray, Deviation]:
    """d xi and the innovation of sampled outputs at times, and the deviation of the estimate."""
    h = np.diff(edges.times)
    G_1, G_2 = (
        _generators(_at(times, at, nodes), waves, run, nodes, noise_free)
        for nodes in (edges.times[:-1] + c * h for c in GAUSS)
    )
    h = h[:, None, None]
    here = _at(times, at, edges.times)
    steps = exponentials(h / 2 * (G_1 + G_2) + np.sqrt(3) / 12 * h**2 * (G_2 @ G_1 - G_1 @ G_2))
    psi = _propagated(edges, steps, here, _start(here, waves, edges.times[0]))
    N, q = here.E.shape[1:]
    path = np.column_stack([np.interp(times, edges.times, column) for column in psi[:, :N].T])
    place = np.clip(np.searchsorted(edges.times, times, side="right") - 1, 0, len(psi) - 1)
    sampled = np.array([w is None for w in waves])
    e = np.where(sampled, psi[place, N : N + q] + psi[place, N + q : N + 2 * q], 0.0)
    moved = np.einsum("kij,kj->ki", here.L, psi[:, :N])
    start, end = result.windows["steady"]
    inside = np.flatnonzero((edges.times >= start) & (edges.times <= end))
    first, last = inside[0], inside[-1]
    if not np.all(sampled):  # the ends of the stretches meet all phases of the waves
        weights = np.gradient(edges.times[inside])[:, None]
        squares = np.einsum("kij,kj->ki", here.L[inside], psi[inside, :N]) ** 2
        return path, e, Deviation(edges.times, moved, (weights * squares).sum(axis=0) / weights.sum())
    between = slice(first, last)
    found = _mean_square(psi[first : last + 1], steps[between], G_1[between], here.L[first : last + 1], h[between])
    return path, e, Deviation(edges.times, moved, found)


def _mean_square(psi: np.ndarray, steps: np.ndarray, G: np.ndarray, L: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Mean over time of the squares of L xi, by Simpson's rule with the middle from the slopes at both ends."""
    N = L.shape[2]
    here = np.einsum("kij,kj->ki", L, psi[:, :N])
    before = np.einsum("kij,kj->ki", steps, psi[:-1])
    slopes = [np.einsum("kij,kjl,kl->ki", L[:-1], G[:, :N], p) for p in (psi[:-1], before)]
    middle = 0.5 * (here[:-1] + here[1:]) + h[:, 0] / 8 * (slopes[0] - slopes[1])
    squares = (here[:-1] ** 2 + 4 * middle**2 + here[1:] ** 2) / 6
    return np.asarray((h[:, 0] * squares).sum(axis=0) / h.sum())


def _at(times: np.ndarray, linear: Linear, at: np.ndarray) -> Linear:
    """The systems on an even grid of times, at other times."""
    return Linear(*[_cubic(times, value, at) for value in vars(linear).values()])


def _cubic(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Lagrange's cubic through the four nearest points."""
    place = (at - times[0]) / (times[1] - times[0])
    first = np.clip(place.astype(int) - 1, 0, times.size - 4)
    x = np.clip(place - first, 0, 3)[:, None, None]
    weights = (
        -(x - 1) * (x - 2) * (x - 3) / 6,
        x * (x - 2) * (x - 3) / 2,
        -x * (x - 1) * (x - 3) / 2,
        x * (x - 1) * (x - 2) / 6,
    )
    return np.asarray(sum(w * values[first + k] for k, w in enumerate(weights)))


def _propagated(edges: Edges, steps: np.ndarray, at: Linear, psi: np.ndarray) -> np.ndarray:
    """psi from each edge on, shape (edges, size)."""
    _, N, q = at.E.shape
    path = np.zeros((edges.times.size, psi.size))
    waiting: dict[tuple[int, int], float] = {}
    for k in range(edges.times.size):
        for i, sample in edges.taken.get(k, ()):
            waiting[i, sample] = float(at.H[k, i] @ psi[:N] - psi[N + i])
        for i, sample, v in edges.arriving.get(k, ()):
            psi[N + q + i] = waiting.pop((i, sample), 0.0) - v
        for i, values in edges.held.items():
            psi[N + q + i] = -values[k]
        path[k] = psi
        if k < len(steps):
            psi = steps[k] @ psi
    return path


def _waves(channel: Channel) -> _Waves | None:
    """Of a continuous output; None of a sampled one."""
    if not any(s.continuous for s in channel.stretches):
        return None
    if len(channel.stretches) > 1:
        raise NoValue("the output is continuous in one phase and something else in another")
    stretch = channel.stretches[0]
    if not stretch.undelayed:
        raise NoValue("the output is continuous and delayed: what is in transit has no finite state")
    waves: list[Wave] = []
    for item in channel.noise[0].functions:  # of what is drawn the values themselves are known
        spectrum = item.spectrum()
        if spectrum is None:
            raise NoValue(no_spectrum(item.type))
        waves += spectrum.waves
    return _Waves(np.array([w.phasor for w in waves]), np.array([w.omega for w in waves]))


def _start(at: Linear, waves: list[_Waves | None], t: float) -> np.ndarray:
    """psi at the start: no deviation, the sinusoids as they are."""
    _, N, q = at.E.shape
    turning = [w.phasors * np.exp(1j * w.omegas * t) for w in waves if w is not None]
    values = np.concatenate([*turning, np.zeros(0)])
    return np.concatenate([np.zeros(N + 2 * q), np.column_stack([values.imag, values.real]).ravel()])


def _generators(
    at: Linear, waves: list[_Waves | None], run: PreparedRun, middles: np.ndarray, noise_free: Result
) -> np.ndarray:
    """G of psi' = G psi on every stretch."""
    count, N, q = at.E.shape
    size = N + 2 * q + 2 * sum(w.omegas.size for w in waves if w is not None)
    G = np.zeros((count, size, size))
    xi, alpha = slice(0, N), slice(N, N + q)
    G[:, xi, xi], G[:, alpha, xi] = at.A0, -at.K0
    rotating = N + 2 * q
    for i, wave in enumerate(waves):
        E, K = at.E[:, :, i], at.K[:, :, i]
        sources: list[tuple[int, np.ndarray]] = []
        one = np.ones(count)
        if wave is None:  # e = h + alpha
            sources = [(N + i, one), (N + q + i, one)]
        else:  # e = C xhat - y - v
            G[:, xi, xi] += E[:, :, None] * at.H[:, None, i, :]
            G[:, alpha, xi] -= K[:, :, None] * at.H[:, None, i, :]
            scale = (
                np.interp(middles, noise_free.time, noise_free.y[:, i])
                if run.channels[i].stretches[0].multiplicative
                else one
            )
            sources.append((N + q + i, scale))
            for omega in wave.omegas:
                sources.append((rotating, -scale))
                G[:, rotating, rotating + 1], G[:, rotating + 1, rotating] = omega, -omega
                rotating += 2
        for column, scale in sources:
            G[:, xi, column] += E * scale[:, None]
            G[:, alpha, column] -= K * scale[:, None]
    return G
