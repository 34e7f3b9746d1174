"""The noise in the estimates of observers that jump at the samples, along a run: their jumps linearised."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.noise.along_run import GAUSS, Deviation
from hgorun.analysis.noise.measured import noise_between
from hgorun.analysis.reasons import NoValue
from hgorun.observers.base import ContinuousObserver, Sample
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun

_ROUNDS = 3  # predictions, each from the mean slopes that the one before gives


def noise_of_jumps(run: PreparedRun, label: str, result: Result, noise_free: Result) -> Deviation:
    """What the run's noise does to each state of the estimate; it stays from a sample to the next.

    With v_k the noise of sample k, d xi_k = F_k d xi_(k-1) + G_k v_k + G'_k v_(k-1) from the second sample on.

    Parameters
    ----------
    run, label, result, noise_free
        As for :func:`hgorun.analysis.noise.along_run.noise_along`.

    Raises
    ------
    NoValue
        When the observer moves between its jumps, they have no derivative along the run, or there are no samples
        in the window.
    """
    observer = Linearisation(run, label)
    if isinstance(observer.block.observer, ContinuousObserver):
        raise NoValue("the observer flows and jumps: noise is predicted only for observers that do one of the two")
    samples = run.channels[0].samples
    arrival = samples.arrival[samples.used]
    rows = np.clip(
        np.searchsorted(result.measurements.time, arrival - _tick(arrival)), 0, result.measurements.time.size - 1
    )
    v = noise_between(run, result, noise_free)[rows]
    y = noise_free.measurements.y[rows]
    before = np.clip(
        np.searchsorted(noise_free.time, arrival[1:] - _tick(arrival[1:])) - 1, 0, noise_free.time.size - 1
    )
    xi = observer.states(noise_free.observers[label], before)
    slopes = _slopes(observer)
    before_jump = np.zeros_like(xi)
    for _ in range(_ROUNDS):  # the mean slopes between the run without noise and the one that is predicted
        nodes = [_evaluated(slopes, observer, arrival, xi + c * before_jump, y + c * v) for c in GAUSS]
        F, G, G_before, L = (0.5 * (a + b) for a, b in zip(*nodes, strict=True))
        if not all(np.all(np.isfinite(part)) for part in (F, G, G_before)):
            raise NoValue("the observer's jumps have no derivative along the run")
        driven = np.einsum("kij,kj->ki", G, v[1:]) + np.einsum("kij,kj->ki", G_before, v[:-1])
        deviation = np.zeros_like(driven)
        state = np.zeros(driven.shape[1])
        for k in range(len(driven)):
            state = F[k] @ state + driven[k]
            deviation[k] = state
        before_jump = np.concatenate([np.zeros_like(deviation[:1]), deviation[:-1]])
    start, end = result.windows["steady"]
    until = np.append(arrival[2:], run.time.end)
    held = np.clip(np.minimum(until, end) - np.maximum(arrival[1:], start), 0, None)
    if not held.sum() > 0:
        raise NoValue("there are no two samples before the end of the window")
    moved = np.einsum("kij,kj->ki", L, deviation)
    mean_square = (held[:, None] * moved**2).sum(axis=0) / held.sum()
    return Deviation(arrival[1:], moved, np.asarray(mean_square))


def _tick(times: np.ndarray) -> np.ndarray:
    """By how much times may differ that are equal on paper."""
    return np.asarray(4 * np.spacing(np.abs(times)))


def _slopes(observer: Linearisation) -> ca.Function:
    """F, G, G' and L = d xhat/d xi of a jump, of t, p, z, this sample, the one before and the time between them."""
    run, b = observer.run, observer.block
    model, p = run.plant.model, run.structure.plant
    t, q = model.t, len(model.outputs)
    z = ca.SX.sym("z", run.structure.system.states)
    sample = Sample(y=ca.SX.sym("y", q), previous=ca.SX.sym("y_before", q), interval=ca.SX.sym("T"))
    u = ca.substitute(run.plant.inputs, model.p, p)
    u_before = ca.substitute(u, t, t - sample.interval)
    own = z[b.start : b.stop]
    after = b.jump(t, u, u_before, p, z, sample)[: b.stop - b.start]
    parts = [ca.jacobian(after, own), ca.jacobian(after, sample.y), ca.jacobian(after, sample.previous)]
    parts.append(ca.jacobian(b.estimate(t, u, p, z), own))
    arguments = [t, run.structure.p, z, sample.y, sample.previous, sample.interval]
    return ca.Function("slopes", arguments, [ca.densify(part) for part in parts])


def _evaluated(
    slopes: ca.Function, observer: Linearisation, arrival: np.ndarray, xi: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of every jump but the first sample's, shapes (K-1, N, N), ..., (K-1, n, N)."""
    run, b = observer.run, observer.block
    states = np.zeros((run.structure.system.states, len(xi)))
    states[b.start : b.stop] = xi.T
    values = slopes(arrival[None, 1:], run.numbers.p, states, y[1:].T, y[:-1].T, np.diff(arrival)[None, :])
    shapes = [part.shape for part in slopes.sx_out()]
    F, G, G_before, L = (
        np.ascontiguousarray(value.full().reshape(rows, len(xi), columns).swapaxes(0, 1))
        for value, (rows, columns) in zip(values, shapes, strict=True)
    )
    return F, G, G_before, L
