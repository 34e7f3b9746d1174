"""What jumps in a plant's equations is named where it costs accuracy or time."""

from __future__ import annotations

import pytest
from examples import Block, inline, simulated

from hgorun.simulation import control

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


def test_the_reason_of_inaccurate_numbers_names_what_jumps() -> None:
    """Friction holds the plant, where no step is accurate."""
    result = simulated(with_friction("0.5*sign(v)", 0.5), SHGO, end=10, solver={"max_evaluations": 2e5})
    assert result.status == "inaccurate"
    reasons = [result.verdict.reason, *(one.reason for one in result.observers.values())]
    assert any("the plant's equations jump (sign of v): write a smooth law" in reason for reason in reasons if reason)
