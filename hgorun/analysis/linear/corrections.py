"""A small error of an observer that is corrected at samples, from each sample to the next."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.reasons import NoValue, require_estimate
from hgorun.observers.base import Arrival, CorrectedObserver
from hgorun.result.records.observer import ObserverResult
from hgorun.simulation.prepared import PreparedRun

_STEPS = 40  # of RK4 over a period, more where the flow is fast
_FINE = 0.05  # of the fastest time constant


@dataclass(frozen=True)
class SampledError:
    """d xi behind a sample = M d xi behind the one before + K v, with the noise v of the sample.

    Attributes
    ----------
    M, K, L : ndarray, shapes (N, N), (N, q), (n, N)
        dxhat = L d xi; N states without gains.
    """

    M: np.ndarray
    K: np.ndarray
    L: np.ndarray

    @property
    def gain(self) -> np.ndarray:
        """What a sample adds to the estimate for each unit of its innovation, shape (n, q)."""
        return np.asarray(self.L @ self.K)

    @property
    def factors(self) -> np.ndarray:
        """Eigenvalues of M, the largest first."""
        values = np.linalg.eigvals(self.M)
        return np.asarray(values[np.lexsort((-values.imag, -np.abs(values).round(9)))])

    def deviation(self) -> np.ndarray:
        """Standard deviation of the estimate behind samples with white noise of variance one, shape (n,).

        Raises
        ------
        NoValue
            Where the error does not decay.
        """
        from scipy.linalg import solve_discrete_lyapunov

        if not np.max(np.abs(self.factors), initial=0.0) < 1:
            raise NoValue("the linearised error does not decay from sample to sample")
        covariance = solve_discrete_lyapunov(self.M, self.K @ self.K.T)
        return np.sqrt(np.maximum(np.diag(self.L @ covariance @ self.L.T), 0.0))


def sampled_error(
    run: PreparedRun, label: str, result: ObserverResult, time: np.ndarray, period: float
) -> SampledError:
    """The error's linear system at the end of a run: over the period to come, all outputs sampled together.

    Raises
    ------
    NoValue
        Where the estimate is lost, or there are no slopes.
    """
    require_estimate(result)
    linearisation = Linearisation(run, label)
    flow, correct = _functions(linearisation)
    xi, t, p = linearisation.along(result, len(time) - 1), float(time[-1]), run.numbers.p
    whole = np.eye(xi.size)
    for _ in range(2):  # the first puts the state behind a sample
        before, whole = _flown(flow, t, p, xi, period)
        t += period
        xi, jump, K, L = (np.asarray(v.full()) for v in correct(t, p, before))
        xi = xi[:, 0]
    kept = _without_gains(linearisation)
    M = (jump @ whole)[np.ix_(kept, kept)]
    if not (np.all(np.isfinite(M)) and np.all(np.isfinite(K))):
        raise NoValue("the observer's equations have no finite slopes at the end of the run")
    return SampledError(M, K[kept], L[:, kept])


def _functions(of: Linearisation) -> tuple[ca.Function, ca.Function]:
    """(t, p, xi) -> (xi', its Jacobian), and -> (xi behind a sample that says what the estimate does, its slopes in xi
    and in the sample, that of the estimate)."""
    run, b = of.run, of.block
    assert isinstance(b.observer, CorrectedObserver)
    model, plant = run.plant.model, run.structure.plant
    t, xi, y = model.t, ca.SX.sym("xi", of.size), ca.SX.sym("y", len(model.outputs))
    u = ca.substitute(run.plant.inputs, model.p, plant)
    z = ca.vertcat(ca.SX.zeros(b.start), xi, ca.SX.zeros(run.structure.system.states - b.stop))
    flow = b.flow(t, u, plant, z, ca.SX.zeros(y.shape))[: of.size]
    after = b.corrected(t, u, plant, z, Arrival(y, ca.SX.ones(y.shape)))[: of.size]
    estimate, guess = b.estimate(t, u, plant, z), b.guess(t, u, plant, z)
    # the error's slope: y stays what the plant says while the estimate moves
    slopes = [ca.substitute(slope, y, guess) for slope in (after, ca.jacobian(after, xi), ca.jacobian(after, y))]
    arguments = [t, run.structure.p, xi]
    return (
        ca.Function("flow", arguments, [flow, ca.densify(ca.jacobian(flow, xi))]),
        ca.Function("correct", arguments, [*map(ca.densify, slopes), ca.densify(ca.jacobian(estimate, xi))]),
    )


def _flown(flow: ca.Function, t: float, p: np.ndarray, xi: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """The states a period later, and how they depend on those before."""

    def rate(t: float, values: np.ndarray) -> np.ndarray:
        value, slope = (np.asarray(v.full()) for v in flow(t, p, values[:, 0]))
        return np.column_stack([value, slope @ values[:, 1:]])

    fastest = float(np.linalg.norm(np.asarray(flow(t, p, xi)[1].full()), 2))
    if not np.isfinite(fastest):
        raise NoValue("the observer's equations have no finite slopes at the end of the run")
    steps = int(np.clip(np.ceil(period * fastest / _FINE), _STEPS, 100 * _STEPS))
    h, now = period / steps, np.column_stack([xi, np.eye(xi.size)])
    for i in range(steps):
        at = t + i * h
        a = rate(at, now)
        b = rate(at + h / 2, now + h / 2 * a)
        c = rate(at + h / 2, now + h / 2 * b)
        now = now + h / 6 * (a + 2 * b + 2 * c + rate(at + h, now + h * c))
    return now[:, 0], now[:, 1:]


def _without_gains(of: Linearisation) -> np.ndarray:
    """Places of the states that small errors move."""
    kept = np.ones(of.size, dtype=bool)
    for name, role in of.block.observer.roles(of.block.form).items():
        if role == "gain":
            place = of.block.states[name]
            kept[place.start - of.block.start :][: place.size] = False
    return np.flatnonzero(kept)
