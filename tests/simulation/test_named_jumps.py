"""What jumps in a plant's equations is named where it costs accuracy or time."""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import Block, inline, simulated

from hgorun.errors import SimulationError
from hgorun.simulation.error_control import control

SHGO: Block = {"S": {"type": "shgo", "theta": 4, "initial": {"x": 1}}}


def with_friction(law: str, start: float = 0.0) -> Block:
    return inline({"x": "v", "v": f"-x - {law}"}, "x") | {"initial": {"x": 1, "v": start}}


@pytest.mark.parametrize(
    ("law", "name"),
    [("0.1*sign(v)", "sign of v"), ("0.2*(v > 0)", "a comparison of v")],
)
def test_a_run_that_takes_long_names_what_jumps(law: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """v is zero at the start, and again at t = pi."""
    monkeypatch.setattr(control, "_MUCH", 100)
    result = simulated(with_friction(law), SHGO, end=4)
    assert result.status == "ok"
    (remark,) = result.remarks
    assert f"since the plant's equations jump ({name}); fewer are with a smooth law, such as tanh(s/eps)" in remark


def test_smooth_equations_have_nothing_to_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "_MUCH", 100)
    assert simulated(with_friction("0.1*tanh(20*v)"), SHGO, end=4).remarks == ()


@pytest.mark.costly
def test_the_reason_of_inaccurate_numbers_names_what_jumps() -> None:
    """Friction holds the plant, where no step is accurate."""
    result = simulated(with_friction("0.5*sign(v)", 0.5), SHGO, end=10, solver={"max_evaluations": 2e5})
    assert result.status == "inaccurate"
    reasons = [result.verdict.reason, *(one.reason for one in result.observers.values())]
    assert any("the plant's equations jump (sign of v): write a smooth law" in reason for reason in reasons if reason)


def test_a_plant_that_no_controlled_step_follows_names_what_jumps() -> None:
    """And the step that is advised does follow it."""
    sticking = with_friction("0.5*sign(v)", 0.5)
    with pytest.raises(SimulationError, match=r"its equations jump \(sign of v\), and no tolerance") as caught:
        simulated(sticking, SHGO, end=10, solver={"method": "dopri5", "rtol": 1e-6})
    assert "singular" not in str(caught.value)
    said = re.search(r"tanh\(s/eps\) in place of sign\(s\), or give a step, as in .*step: (\S+)}", str(caught.value))
    assert said is not None
    assert simulated(sticking, SHGO, end=10, solver={"method": "rk4", "step": float(said[1])}).status == "ok"


def test_a_delay_does_not_end_what_fixed_steps_follow() -> None:
    """What is measured late of a plant that sticks is its own past."""
    result = simulated(
        with_friction("0.5*sign(v)", 0.5),
        SHGO,
        measurement={"delay": 0.1},
        end=6,
        output_step=0.05,
        solver={"method": "rk4", "max_evaluations": 3e5},
    )
    assert result.measurements is not None
    late, x = result.measurements.y[:, 0], result.x[:, 0]
    assert abs(x[-1] - x[-20]) < 1e-3  # it has come to rest
    np.testing.assert_allclose(late[2:], x[:-2], atol=1e-3)
    reasons = [result.verdict.reason, *(one.reason for one in result.observers.values())]
    assert any("the plant's equations jump (sign of v)" in reason for reason in reasons if reason)


def test_a_plant_that_sticks_with_a_delay_is_told_of_by_its_jump() -> None:
    """x = (1 + cos(t))/2 until t = pi, where friction holds it at 0."""
    with pytest.raises(SimulationError) as caught:
        simulated(with_friction("0.5*sign(v)"), SHGO, measurement={"delay": 0.1}, end=10, solver={"method": "rodas5p"})
    said = str(caught.value)
    assert "at t = 3.14159 steps become so short that too many would have to be kept for the delay" in said
    assert "the plant's equations jump (sign of v)" in said
    assert "history" not in said
