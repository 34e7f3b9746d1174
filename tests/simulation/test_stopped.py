"""An observer whose estimate rests on a jump of its equations has not diverged: no controlled step crosses it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import experiment, inline

import hgorun
from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.members.members import Members
from hgorun.result.records.status import STATUSES

END = 0.6
FRICTION = inline(
    {"phi": "omega", "omega": "-24.5*sin(phi) - 0.1*omega - 0.3*sign(omega)"},
    "omega",
    initial={"phi": 1.047, "omega": 0},
)


def pendulum_of(**more: Any) -> hgorun.Experiment:
    """From rest, so that the estimate of the speed starts where friction changes its sign."""
    measurement = {"sampling": {"period": 0.01}, "noise": [{"type": "gaussian", "std": 0.0087}]}
    observers = {"S": {"type": "shgo", "theta": 10}}
    return experiment(FRICTION, observers, measurement=measurement, end=END, output_step=0.01, **more)


def pendulum(**more: Any) -> hgorun.Result:
    return hgorun.simulate(pendulum_of(**more))


@pytest.fixture(scope="module")
def fine() -> hgorun.Result:
    """With steps that cross the jump, of which none is rejected."""
    return pendulum(solver={"method": "rk4", "step": 2.5e-5})


@pytest.mark.costly
def test_an_automatic_step_follows_it(fine: hgorun.Result) -> None:
    found = pendulum()
    assert found.observers["S"].verdict.status in ("ok", "inaccurate")
    assert np.allclose(found.observers["S"].xhat, fine.observers["S"].xhat, atol=5e-3)
    assert np.allclose(found.x, fine.x, atol=5e-3)


@pytest.mark.measured("solver1")
@pytest.mark.costly
@pytest.mark.parametrize("solver", [{"method": "dopri5"}, {"method": "dopri5", "rtol": 1e-8}])
def test_with_controlled_steps_alone_it_is_inaccurate_and_why_is_said(solver: dict[str, Any]) -> None:
    verdict = pendulum(solver=solver).observers["S"].verdict
    assert verdict.status == "inaccurate"
    assert verdict.reason is not None
    assert "no controlled step crosses a jump" in verdict.reason
    assert "tanh(s/eps)" in verdict.reason


def test_what_fixed_steps_lose_as_well_has_diverged() -> None:
    """x2' = x2^2/10 runs away in finite time from where the estimate starts, and decays where the plant does."""
    plant = inline({"x1": "x2", "x2": "-x2 + 0.1*sign(x2)*x2**2"}, "x1")
    observers = {"S": {"type": "shgo", "theta": 1, "initial": {"x2": 1e3}}}
    for solver in ({}, {"method": "dopri5", "rtol": 1e-8}):
        result = hgorun.simulate(experiment(plant, observers, solver=solver))
        assert result.observers["S"].verdict.status == "diverged"


@pytest.mark.slow
@pytest.mark.parametrize("solver", [{}, {"method": "dopri5", "rtol": 1e-8}])
def test_in_a_sweep_the_same_is_said(solver: dict[str, Any]) -> None:
    base = pendulum_of(solver=solver)
    thetas = [5.0, 10.0, 12.0]
    block = compute(base, Members.of({"observers.S.theta": thetas}))
    for i, theta in enumerate(thetas):
        found = hgorun.simulate(base.varied({"observers.S.theta": theta})).observers["S"]
        assert STATUSES[block.status[i, 0]] == found.verdict.status != "diverged"
        np.testing.assert_array_equal(block.metrics["rmse"][i, 0], found.metrics["rmse"])


def test_of_a_plant_that_sticks_what_to_do_is_said() -> None:
    """Friction holds it from the start; so few evaluations decide nothing."""
    plant = FRICTION | {"dynamics": {"phi": "omega", "omega": "-24.5*sin(phi) - 50*sign(omega)"}}
    found = hgorun.simulate(
        experiment(plant, {}, end=END, solver={"max_evaluations": 1e4, "accuracy": 1e-9}, output_step=0.01)
    )
    assert found.verdict.status == "inaccurate"
    assert found.verdict.reason is not None
    assert "tanh(s/eps)" in found.verdict.reason
