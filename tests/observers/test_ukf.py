"""The unscented Kalman filter, against the linear one, moments of polynomials, and a trajectory computed elsewhere."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from examples import VAN_DER_POL, Block, chain, experiment, inline, simulated
from scipy.integrate import solve_ivp

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.base import Arrival
from hgorun.observers.ukf import UnscentedKalmanFilter
from hgorun.testing import check_observer
from hgorun.testing.cases import Case
from hgorun.testing.equations import Equations

VDP: Block = VAN_DER_POL | {"parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
OSCILLATOR = chain(2, "-x1", [1, 0])


def samples(std: float) -> Block:
    noise = [{"type": "expression", "value": f"{std}*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]
    return {"sampling": {"period": 0.2, "offset": 0.2}, "noise": noise}


def test_contract() -> None:
    check_observer(UnscentedKalmanFilter, {"alpha": 0.5, "beta": 2, "kappa": 0})


# t: xhat_1, xhat_2; an independent simulator, RK4 with steps of 0.01
TRAJECTORY = {
    0.2: (1.047391, 0.020892),
    0.4: (0.984096, -0.420875),
    1: (0.519931, -1.069285),
    2: (-0.740293, -1.459856),
    10: (-1.476824, 1.000771),
    20: (0.993416, -1.391740),
}


def test_trajectory_computed_elsewhere() -> None:
    block = {"type": "ukf", "Q": {"x2": 0.01}, "R": 0.0025, "alpha": 1, "beta": 0, "kappa": 1}
    found = simulated(VDP, {"K": block}, end=20, output_step=0.2, step=0.01, measurement=samples(0.05)).observers["K"]
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(found.xhat[round(5 * t)], expected, rtol=0, atol=6e-7)


def test_of_a_linear_plant_it_is_the_ekf() -> None:
    """Whatever its points; a small alpha loses no digits, since differences of pairs are taken."""
    of: Block = {"Q": {"x2": 0.04}, "R": 0.01}
    blocks: dict[str, Block] = {"E": {"type": "ekf", **of}}
    for i, (alpha, beta, kappa) in enumerate([(1, 0, 1), (0.5, 2, 0), (0.01, 2, 0), (1e-3, 2, 0)]):
        blocks[f"U{i}"] = {"type": "ukf", **of, "alpha": alpha, "beta": beta, "kappa": kappa}
    found = simulated(OSCILLATOR, blocks, end=4, step=0.01, measurement=samples(0.1)).observers
    for label, atol in (("U0", 1e-14), ("U1", 1e-14), ("U2", 1e-12), ("U3", 1e-9)):
        np.testing.assert_allclose(found[label].xhat, found["E"].xhat, rtol=0, atol=atol)
        np.testing.assert_allclose(found[label].internal["P"], found["E"].internal["P"], rtol=0, atol=atol)


def test_moments_of_a_square() -> None:
    """y = x^2: yhat = m^2 + P and S - R = 2 P^2 + 4 m^2 P, exactly, with kappa = 2."""
    plant = inline({"x": "0*x"}, "x**2", 1.0)
    case = Case(UnscentedKalmanFilter, "ukf", {"Q": {"x": 1}, "R": 0.3, "kappa": 2}, {"type": "inline", **plant})
    equations = case.equations()
    m, P, y = 0.7, 0.4, 2.0
    after = equations.evaluate(equations.correct, 0.0, np.array([m, P]), np.zeros(1), np.array([y]))[0].ravel()
    yhat, S, P_xy = m**2 + P, 2 * P**2 + 4 * m**2 * P + 0.3, 2 * m * P
    np.testing.assert_allclose(after, [m + P_xy / S * (y - yhat), P - P_xy**2 / S], rtol=1e-14)


TWO = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"angle": "a", "energy": "b**2/2 - cos(a)"})


def test_outputs_enter_together_and_missing_ones_not_at_all() -> None:
    """Against the formulas with the inverse of S."""
    keys: Block = {"Q": {"b": 0.1}, "R": {"angle": 0.02, "energy": 0.05}}
    equations = Case(UnscentedKalmanFilter, "ukf", keys, {"type": "inline", **TWO}).equations()
    x, P, y = np.array([0.3, 0.4]), np.array([[0.3, 0.1], [0.1, 0.2]]), np.array([0.5, -0.7])
    reach = np.sqrt(3) * np.linalg.cholesky(P)
    points = np.array([x, *(x + reach.T), *(x - reach.T)])
    h = np.column_stack([points[:, 0], points[:, 1] ** 2 / 2 - np.cos(points[:, 0])])
    weights = np.array([1 / 3, 1 / 6, 1 / 6, 1 / 6, 1 / 6])
    yhat = weights @ h
    S = (h - yhat).T @ np.diag(weights) @ (h - yhat) + np.diag([0.02, 0.05])
    P_xy = (points - x).T @ np.diag(weights) @ (h - yhat)
    for rows in ([0, 1], [0], [1]):
        K = P_xy[:, rows] @ np.linalg.inv(S[np.ix_(rows, rows)])
        expected = x + K @ (y - yhat)[rows], P - K @ S[np.ix_(rows, rows)] @ K.T
        fresh = [float(i in rows) for i in range(2)]
        after = _corrected(equations, x, P, y, fresh)
        np.testing.assert_allclose(after[0], expected[0], rtol=0, atol=1e-14)
        np.testing.assert_allclose(after[1], expected[1], rtol=0, atol=1e-14)


def _corrected(
    equations: Equations, x: np.ndarray, P: np.ndarray, y: np.ndarray, fresh: list[float]
) -> tuple[np.ndarray, np.ndarray]:
    """xhat and P after samples of some outputs."""
    found = equations.corrected(Arrival(ca.SX(ca.DM(y)), ca.SX(ca.DM(fresh))))
    function = equations.function("after", found["xhat"], found["P"])
    z = np.concatenate([x, P[np.triu_indices(len(x))]])
    xhat, covariance = equations.evaluate(function, 0.0, z, np.zeros(len(y)))
    return xhat.ravel(), covariance


RATE = 1e4  # at which b follows a


def _stiff(x: np.ndarray) -> np.ndarray:
    a, b = x
    return np.array([b - a, -RATE * (b - np.sin(a))])


def _between(_: float, z: np.ndarray) -> np.ndarray:
    """The moment equations as they are printed, of the mean and the whole of P."""
    x, P = z[:2], z[2:].reshape(2, 2)
    reach = np.sqrt(3) * np.linalg.cholesky((P + P.T) / 2)
    points = np.array([x, *(x + reach.T), *(x - reach.T)])
    weights = np.array([1 / 3, 1 / 6, 1 / 6, 1 / 6, 1 / 6])
    f = np.array([_stiff(point) for point in points])
    mean = weights @ f
    M = (points - x).T @ np.diag(weights) @ (f - mean)
    return np.concatenate([mean, (M + M.T + np.diag([0.01, 0.0])).ravel()])


@pytest.mark.costly
def test_a_stiff_plant_with_controlled_steps() -> None:
    """P of b falls by 2e4 per unit of time, and no noise keeps it up; against the moment equations by scipy."""
    plant = inline({"a": "b - a", "b": f"-{RATE}*(b - sin(a))"}, "a", initial={"a": 1, "b": 0.5})
    measured = {"sampling": {"period": 0.1, "offset": 0.1}}
    block = {"type": "ukf", "Q": {"a": 0.01}, "R": 0.01, "initial": {"a": 0.4, "b": 0.2}}
    solver = {"method": "rodas5p", "rtol": 1e-8}
    found = simulated(plant, {"K": block}, end=0.3, output_step=0.1, measurement=measured, solver=solver)
    assert found.observers["K"].status == "ok"
    exact = {"method": "LSODA", "rtol": 1e-10, "atol": 1e-13}
    truth, z = np.array([1.0, 0.5]), np.array([0.4, 0.2, 1.0, 0.0, 0.0, 1.0])
    for row in (1, 2, 3):
        truth = solve_ivp(lambda _, x: _stiff(x), (0, 0.1), truth, **exact).y[:, -1]
        z = solve_ivp(_between, (0, 0.1), z, **exact).y[:, -1]
        P = z[2:].reshape(2, 2)
        K = P[:, 0] / (P[0, 0] + 0.01)
        z = np.concatenate([z[:2] + K * (truth[0] - z[0]), (P - np.outer(K, P[0])).ravel()])
        np.testing.assert_allclose(found.observers["K"].xhat[row], z[:2], rtol=1e-4)


def test_chain_noise() -> None:
    """theta as of ekf: on chains the same filter."""
    blocks = {name: {"type": name, "theta": 2, "R": 0.01} for name in ("ekf", "ukf")}
    found = simulated(OSCILLATOR, blocks, end=2, step=0.01, measurement=samples(0.1)).observers
    np.testing.assert_allclose(found["ukf"].xhat, found["ekf"].xhat, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"alpha": 0}, "K.alpha"),
        ({"alpha": 1.5}, "K.alpha"),
        ({"beta": -1}, "K.beta"),
        ({"kappa": -2}, "expected more than -n = -2; found -2"),
        ({"late": "innovation"}, "is corrected by samples"),
    ],
)
def test_what_cannot_be_is_refused(keys: Block, message: str) -> None:
    block = {"type": "ukf", "Q": {"x2": 1}, "R": 0.1, **keys}
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(VDP, {"K": block}, measurement=samples(0.1)))


def test_a_continuous_output_is_refused() -> None:
    with pytest.raises(ConfigError, match="needs sampled outputs"):
        hgorun.simulate(experiment(VDP, {"K": {"type": "ukf", "Q": {"x2": 1}, "R": 0.1}}))


def test_a_covariance_that_loses_its_sign_is_no_estimate() -> None:
    """P(0) much larger than what it settles to, with long steps: Cholesky's factor is not a number."""
    block = {"type": "ukf", "Q": {"x2": 1e-6}, "R": 1e-6, "kappa": -1.9, "internal": {"P": 1e6}}
    found = simulated(VDP, {"K": block}, end=4, step=0.2, measurement=samples(0.05)).observers["K"]
    assert found.verdict.lost
