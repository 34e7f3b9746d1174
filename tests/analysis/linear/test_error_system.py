"""The error's linear systems along a run, and the runs along which there are none."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, inline
from scipy.integrate import solve_ivp

from hgorun.analysis.linear.error_system import error_system
from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.linear.sinusoids import exponents
from hgorun.analysis.reasons import JUMPS, SLIDING, NoValue
from hgorun.simulation.simulate import prepare, simulate, simulate_prepared

SHGO: Block = {"type": "shgo", "theta": 3}
DEADBEAT: Block = {"type": "deadbeat"}
SAMPLED: Block = {"sampling": {"period": 0.1}}


def test_an_error_that_moves_with_its_gain() -> None:
    """Of x1' = x2, x2' = -sin(t) x1 the matrix is that of the observer plus the plant's slope at each time."""
    run = prepare(experiment(chain(2, "-sin(t)*x1"), {"o": SHGO}, end=6.0, output_step=0.01))
    system = error_system(run, "o", nominal(run))
    assert not system.constant
    assert system.times[0] == pytest.approx(2, abs=0.02)
    expected = np.array([[[-6, 1], [-9 - np.sin(t), 0]] for t in system.times])
    np.testing.assert_allclose(system.A, expected, atol=1e-9)
    assert system.rate == pytest.approx(np.max(np.abs(np.linalg.eigvals(expected))), rel=1e-3)


def test_an_error_that_never_changes_is_one_matrix() -> None:
    run = prepare(experiment(chain(2, "-x1 - x2"), {"o": SHGO}))
    system = error_system(run, "o", nominal(run))
    assert system.constant
    assert system.fastest == pytest.approx(np.max(np.abs(np.linalg.eigvals(system.G[0]))))


@pytest.mark.parametrize(
    ("block", "measurement", "words"),
    [({"type": "levant", "G": 5}, {}, SLIDING), (DEADBEAT, SAMPLED, JUMPS)],
)
def test_observers_without_slopes_or_without_a_flow(block: Block, measurement: Block, words: str) -> None:
    made = experiment(chain(2, "-x1"), {"o": block}, measurement=measurement, step=1e-3)
    with pytest.raises(NoValue) as caught:
        error_system(prepare(made), "o", simulate(made))
    assert str(caught.value) == words


def test_only_observers_that_flow_have_a_nominal_run() -> None:
    mixed = prepare(experiment(chain(2, "-x1"), {"o": SHGO, "k": DEADBEAT}, measurement=SAMPLED))
    assert list(nominal(mixed).observers) == ["o"]
    with pytest.raises(NoValue, match="all observers here jump at the samples"):
        nominal(prepare(experiment(chain(2, "-x1"), {"k": DEADBEAT}, measurement=SAMPLED)))
    with pytest.raises(NoValue, match="does not have this observer"):
        error_system(mixed, "o", simulate(experiment(chain(2, "-x1"), {"k": DEADBEAT}, measurement=SAMPLED)))


def test_a_run_that_ends_before_its_time_is_not_looked_along() -> None:
    run = prepare(experiment(chain(2, "x2**3", [1, 1]), {"o": SHGO | {"initial": {"x1": 9, "x2": 9}}}, end=0.4))
    result = simulate_prepared(run)
    assert result.observers["o"].diverged_at is not None
    with pytest.raises(NoValue, match="in the nominal run, the observer diverged"):
        error_system(run, "o", result)


def test_a_root_at_rest_has_no_finite_slope() -> None:
    run = prepare(experiment(inline({"x1": "x2", "x2": "-sqrt(abs(x1)) - x2"}, "x1", start=0.0), {"o": SHGO}))
    with pytest.raises(NoValue, match="no finite slopes along the run"):
        error_system(run, "o", simulate_prepared(run))


def test_an_observer_without_theta_has_no_exponent_in_it() -> None:
    gains = {"poles": -1, "a": 1.0, "b": 2.5, "q": 0.15, "gamma": "4"}
    run = prepare(experiment(chain(2, start=0.0), {"o": {"type": "dynamic_gain", **gains}}))
    observer = Linearisation(run, "o")
    in_eps, in_theta = exponents(observer.at(0.0, observer.at_truth(np.zeros(2))), None, 1e3)
    assert np.all(np.isfinite(in_eps))
    assert np.all(np.isnan(in_theta))


def test_a_gain_that_is_a_state_is_the_one_of_the_time() -> None:
    """P of a Kalman-Bucy filter follows P' = A P + P A^T + Q - P C^T C P/R, which scipy integrates beside it."""
    plant = inline({"a": "b", "b": "-a"}, {"y": "a"}, 1.0)
    P0 = np.array([[2.0, 0.3], [0.3, 1.0]])
    block: Block = {"type": "kalman_bucy", "Q": {"b": 0.5}, "R": 0.2, "internal": {"P": P0.tolist()}}
    run = prepare(experiment(plant, {"o": block}, end=3.0, output_step=0.5))
    found, observer = simulate_prepared(run).observers["o"], Linearisation(run, "o")
    A, Q = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.diag([0.0, 0.5])

    def rate(_: float, p: np.ndarray) -> np.ndarray:
        P = p.reshape(2, 2)
        return np.ravel(A @ P + P @ A.T + Q - np.outer(P[:, 0], P[:, 0]) / 0.2)

    P = solve_ivp(rate, (0, 3), P0.ravel(), t_eval=np.arange(7) / 2, rtol=1e-10, atol=1e-12).y.T.reshape(-1, 2, 2)
    x = np.array([0.7, -0.2])
    for i in (0, 1, 6):
        there = observer.at(run.grid[i], observer.at_truth(x, found, i))
        np.testing.assert_allclose(there.A[:2, :2], A - np.outer(P[i, :, 0], [1, 0]) / 0.2, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(observer.at_truth(x), observer.at_truth(x, found, 0))
    np.testing.assert_array_equal(observer.at_truth(x, found, 6)[:2], x)
