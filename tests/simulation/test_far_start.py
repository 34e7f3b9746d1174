"""A run that starts so far out that no gain helps: its key and its number are named."""

from __future__ import annotations

import pytest
from examples import Block, inline, simulated

from hgorun.errors import ConfigError, SimulationError

OSCILLATOR = inline({"x1": "x2", "x2": "-x1 + (1 - x1**2)*x2"}, "x1", initial={"x1": 1, "x2": 0})
SHGO: Block = {"type": "shgo", "theta": 4}


def reason(plant: Block, observer: Block) -> str | None:
    sampled: Block = {"sampling": {"period": 0.05}}
    found = simulated(plant, {"S": observer}, measurement=sampled, end=5, output_step=0.05).observers["S"]
    assert found.status == "diverged"
    return found.reason


@pytest.mark.parametrize("value", [1e20, -1e25])
def test_a_far_initial_estimate_is_named(value: float) -> None:
    said = reason(OSCILLATOR, SHGO | {"initial": {"x1": value, "x2": 1}})
    assert said is not None
    assert said.startswith(f"observers.S.initial.x1 is {value:.6g}, too far away: the plant's states are 2.")


def test_a_near_one_is_not() -> None:
    """What makes this one diverge is its gain."""
    said = reason(OSCILLATOR, {"type": "shgo", "theta": 200, "initial": {"x1": 3}})
    assert "initial" not in (said or "")


def test_a_huge_initial_state_is_named() -> None:
    """Between 2^66 and 2^67 numbers are 2^14 = 16384 apart."""
    growth = "x1*x2/(x1 + x2)"
    plant = inline({"x1": f"{growth} - 0.1*x1", "x2": f"0.1*(10 - x2) - {growth}"}, "x1", initial={"x1": 1e20, "x2": 1})
    said = reason(plant, {"type": "shgo", "theta": 2, "initial": {"x1": 5, "x2": 1}})
    assert said is not None
    assert said.startswith("plant.initial.x1 is 1e+20, beside which numbers lose what is smaller than 2e+04: give one")


def test_one_with_which_the_equations_overflow_is_not_a_gain() -> None:
    with pytest.raises(ConfigError) as caught:
        reason(OSCILLATOR, SHGO | {"initial": {"x1": 1e200}})
    assert caught.value.key == "observers.S.initial"
    assert caught.value.message == "1e+200 is too large: the equations overflow there"


def test_a_gain_that_overflows_is_named_beside_such_a_start() -> None:
    with pytest.raises(ConfigError, match="gains that follow from it overflow") as caught:
        reason(OSCILLATOR, {"type": "eso", "omega_o": 1e200, "initial": {"x1": 1e250}})
    assert caught.value.key == "observers.S.omega_o"


@pytest.mark.measured("rk4")
@pytest.mark.costly
@pytest.mark.parametrize(
    "solver", [{"step": "auto"}, {"step": 0.01}, {"method": "rodas5p"}], ids=["auto", "rk4", "stiff"]
)
def test_a_plant_that_is_lost_from_a_huge_start_names_it(solver: Block) -> None:
    """Nothing is stiff: x2 overflows within two steps."""
    plant = inline({"x1": "x2", "x2": "-1e7*x1"}, "x1", initial={"x1": 1.5e300, "x2": 0})
    with pytest.raises(SimulationError, match=r"plant.initial.x1 is 1.5e\+300, beside which numbers lose") as caught:
        simulated(plant, {"S": SHGO}, end=1, solver=solver)
    assert "stiff" not in str(caught.value)


def test_one_that_overflows_at_once_is_at_its_key() -> None:
    with pytest.raises(ConfigError) as caught:
        simulated(OSCILLATOR | {"initial": {"x1": 1.5e300, "x2": 1}}, {"S": SHGO}, end=1)
    assert caught.value.key == "plant.initial.x1"
    assert caught.value.message.startswith("1.5e+300 is too large: the right-hand side of x2 is not a finite number")
