"""Why observers diverge, in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import simulated

DECAY: dict[str, Any] = {"states": ["x"], "dynamics": {"x": "-x"}, "output": "x", "initial": {"x": 1}}
HUMP: dict[str, Any] = {  # J = diag(1, (1 - b^2)/(1 + b^2)^2) is singular at b = 1
    "states": ["a", "b"],
    "dynamics": {"a": "b/(1 + b**2)", "b": "-0.1*b"},
    "output": "a",
    "initial": {"a": 0, "b": 0.5},
}


@pytest.mark.parametrize("measurement", [{}, {"sampling": {"period": 0.1}}])
def test_an_unstable_gain_is_named_with_its_rate(measurement: dict[str, Any]) -> None:
    """e' = (-1 + 12) e."""
    observers = {"S": {"type": "shgo", "theta": 1, "gains": [-12]}}
    result = simulated(DECAY, observers, end=4, step=0.01, measurement=measurement)
    observer = result.observers["S"]
    assert observer.status == "diverged"
    assert observer.reason == "the gain is unstable on this plant: small errors grow like exp(11 t)"


def test_a_stable_gain_is_not_blamed_but_its_theta() -> None:
    """Samples too far apart for this filter: its gain is stable."""
    plant = {"type": "integrator_chain", "phi": "cos(3*t) - x1", "initial": {"x1": 0.5, "x2": 0.4}}
    observers = {"F": {"type": "fhgo2", "r": 2, "theta": 60, "initial": {"x1": 0.2}}}
    result = simulated(plant, observers, end=20, step=0.01, measurement={"sampling": {"period": 0.25}})
    assert result.observers["F"].status == "diverged"
    assert (result.observers["F"].reason or "").startswith("theta = 60 is too large for the period 0.25 s")


def test_a_jacobian_is_named_that_is_singular_where_the_plant_passes() -> None:
    """Lorenz's attractor with a measured: J is singular at a = 0, where the estimate is lost before it gets there."""
    lorenz: dict[str, Any] = {
        "states": ["a", "b", "c"],
        "dynamics": {"a": "10*(b - a)", "b": "a*(28 - c) - b", "c": "a*b - 8/3*c"},
        "output": "a",
        "initial": {"a": 1, "b": 1, "c": 20},
    }
    observer = {"type": "shgo", "theta": 5, "initial": {"a": 1.1, "b": 1.2, "c": 22}}
    found = simulated(lorenz, {"S": observer}, end=2, output_step=0.1).observers["S"]
    assert found.status == "diverged"
    assert found.status_at is not None
    before, _, at = (found.reason or "").rpartition("J became singular at t = ")
    assert not before
    assert abs(float(at) - found.status_at) < 0.1


def test_a_singular_jacobian_is_named() -> None:
    observers = {"S": {"type": "shgo", "theta": 2, "map": "derivatives", "initial": {"a": -0.8, "b": 0.8}}}
    observer = simulated(HUMP, observers, end=4, output_step=0.001, step=0.001).observers["S"]
    assert observer.status != "ok"
    assert observer.reason is not None
    before, _, at = observer.reason.rpartition("J became singular at t = ")
    assert before
    b = observer.xhat[:, 1]
    crossed = np.flatnonzero(np.abs(b[np.isfinite(b)]) > 1)
    assert crossed.size
    assert 0.001 * (crossed[0] - 1) <= float(at) <= 0.001 * crossed[0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [{"type": "shgo"}, {"type": "fhgo2", "r": 2}, {"type": "low_power"}], ids=str)
def test_a_jacobian_is_named_that_holds_an_estimate(kind: dict[str, Any]) -> None:
    """The correction becomes infinite as b goes to 1, so that controlled steps end there, with J still of one sign."""
    observers = {"S": {**kind, "theta": 2, "map": "derivatives", "initial": {"a": -0.8, "b": 0.8}}}
    found = simulated(HUMP, observers, end=4, output_step=0.001).observers["S"]
    assert found.status == "diverged"
    assert found.status_at is not None
    before, _, at = (found.reason or "").rpartition("J became singular at t = ")
    assert not before
    # by how much steps pass the place where the correction is infinite follows from their last digits: 0.3 % was seen
    assert float(at) == pytest.approx(found.status_at, rel=1e-2)


@pytest.mark.costly
@pytest.mark.parametrize("step", [0.01, "auto"])
def test_gains_for_which_no_step_is_short_enough_are_named_with_their_rate(step: float | str) -> None:
    """e_1' = e_2 - 2 theta e_1 and e_2' = -theta^2 e_1: both eigenvalues are -theta."""
    plant: dict[str, Any] = {"type": "integrator_chain", "n": 2, "initial": {"x1": 1, "x2": 0}}
    found = simulated(plant, {"S": {"type": "shgo", "theta": 1e9}}, end=1, solver={"step": step}).observers["S"]
    assert found.status == "diverged"
    assert "which make it as fast as 1e+09 per time unit" in (found.reason or "")
    if step == 0.01:  # RK4 is stable where theta times it is below 2.79
        assert (found.reason or "").endswith("give theta of at most 250")


def test_of_two_gains_the_faster_is_named_for_which_no_step_is_short_enough() -> None:
    plant: dict[str, Any] = {"type": "integrator_chain", "n": 2, "initial": {"x1": 1, "x2": 0}}
    block: dict[str, Any] = {"type": "piecewise", "theta_1": 1e9, "theta_2": 1e8, "d": 0.1}
    found = simulated(plant, {"S": block}, end=1, solver={"step": 0.01}).observers["S"]
    assert (found.reason or "").endswith("give theta_1 of at most 250 with theta_2 below it")
