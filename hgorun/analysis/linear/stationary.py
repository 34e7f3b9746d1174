"""The Kalman filter at rest: what its equations come to for the plant linearised at one point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import casadi as ca
import numpy as np

from hgorun.analysis.reasons import NoValue
from hgorun.observers.kalman import KalmanFilter
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.forms import ModelCopy

_STABLE = 1e-9  # relative: poles nearer to the boundary are rounding away from it


@dataclass(frozen=True)
class Stationary:
    """A filter whose P has come to rest.

    Attributes
    ----------
    P, K : ndarray, shapes (n, n), (n, q)
        Covariance of the errors, behind samples where there are samples; and the gain of the innovation.
    poles : ndarray, shape (n,)
        Eigenvalues of the error: of its flow (1/time), or of what becomes of it from a sample to the next.
    """

    P: np.ndarray
    K: np.ndarray
    poles: np.ndarray


@dataclass(frozen=True)
class Model:
    """dx' = F dx + w, dy = H dx + v, with noise of the covariances Q and R."""

    F: np.ndarray
    H: np.ndarray
    Q: np.ndarray
    R: np.ndarray


def linear_model(run: PreparedRun, block: ObserverBlock, t: float, x: np.ndarray) -> Model:
    """What a filter takes the plant for at an estimate x, in the plant's coordinates.

    Raises
    ------
    NoValue
        Where it has no finite slopes.
    """
    observer = block.observer
    assert isinstance(observer, KalmanFilter)
    model, plant = run.plant.model, run.structure.plant
    u = ca.substitute(run.plant.inputs, model.p, plant)
    copy, xhat = cast(ModelCopy, block.copy(model.t, u, plant)), ca.SX.sym("x", x.size)
    y = copy.output(xhat)
    parts = [ca.jacobian(copy.copy(xhat), xhat), ca.jacobian(y, xhat)]
    parts += [observer.density(copy, xhat, block.k), ca.diag(observer.variance(y, block.k))]
    values = ca.Function("model", [model.t, run.structure.p, xhat], [ca.densify(part) for part in parts])
    found = Model(*(np.asarray(value.full()) for value in values(t, run.numbers.p, x)))
    if not all(np.all(np.isfinite(part)) for part in (found.F, found.H, found.Q, found.R)):
        raise NoValue("the filter's equations have no finite slopes there")
    return found


def continuous(model: Model) -> Stationary:
    """F P + P F^T + Q = P H^T R^-1 H P, K = P H^T R^-1.

    Raises
    ------
    NoValue
        Where there is no solution with a stable error.
    """
    from scipy.linalg import solve_continuous_are

    P = _solved(lambda: solve_continuous_are(model.F.T, model.H.T, model.Q, model.R))
    K = np.linalg.solve(model.R, model.H @ P).T
    poles = np.linalg.eigvals(model.F - K @ model.H)
    if not np.all(poles.real < -_STABLE * np.max(np.abs(poles), initial=0.0)):
        raise NoValue(_NO_REST)
    return Stationary(P, K, poles)


def sampled(model: Model, period: float) -> Stationary:
    """P = A P+ A^T + Q_T, K = P H^T (H P H^T + R)^-1, P+ = (I - K H) P with A = exp(F T), all outputs sampled together.

    Q_T is the integral of exp(F s) Q exp(F^T s) over a period T (Van Loan 1978).

    Raises
    ------
    NoValue
        Where there is no solution with a stable error.
    """
    from scipy.linalg import expm, solve_discrete_are

    n = model.F.shape[0]
    both = np.block([[-model.F, model.Q], [np.zeros((n, n)), model.F.T]]) * period
    whole = np.asarray(expm(both))
    A = whole[n:, n:].T
    Q = A @ whole[:n, n:]
    P = _solved(lambda: solve_discrete_are(A.T, model.H.T, (Q + Q.T) / 2, model.R))
    K = np.linalg.solve(model.H @ P @ model.H.T + model.R, model.H @ P).T
    left = np.eye(n) - K @ model.H
    poles = np.linalg.eigvals(left @ A)
    if not np.max(np.abs(poles), initial=0.0) < 1 - _STABLE:
        raise NoValue(_NO_REST)
    return Stationary(left @ P, K, poles)


_NO_REST = (
    "the Riccati equation has no solution with a stable error: a mode that does not decay is not seen by the outputs, "
    "or is not reached by the process noise"
)


def _solved(solve: Callable[[], np.ndarray]) -> np.ndarray:
    """A covariance, from a solver that raises where there is none."""
    try:
        P: np.ndarray = np.asarray(solve())
    except (np.linalg.LinAlgError, ValueError) as error:
        raise NoValue(_NO_REST) from error
    return np.asarray((P + P.T) / 2)
