"""The observer of kinetic rates, against exact errors of linear balances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from examples import Block, experiment, inline, simulated

import hgorun
from hgorun.errors import ConfigError
from hgorun.figures.drawing import comparison
from hgorun.result.reading import read
from hgorun.result.result import Result

YIELDS = {"X": [1], "S": [-2]}


def tank(rate: str) -> Block:
    """Biomass X grows on substrate S at a rate, with the dilution rate D."""
    return inline(
        {"X": f"{rate} - D*X", "S": f"-2*({rate}) - D*S + D*s_in"},
        "X",
        inputs={"D": "0.5"},
        parameters={"s_in": 10},
        initial={"X": 1, "S": 5},
    )


def observer(**more: object) -> Block:
    return {"type": "kinetic_rate", "theta": 3, "yields": YIELDS, "dilution": "D", "feed": {"S": "D*s_in"}, **more}


def test_a_rate_that_grows_is_followed_with_the_error_of_the_formula() -> None:
    """-(2 theta + D) s/theta^2."""
    found = simulated(tank("0.2*t"), {"R": observer()}, end=20).observers["R"]
    assert found.internal["r"][-1, 0] - 0.2 * 20 == pytest.approx(-(2 * 3 + 0.5) * 0.2 / 9, rel=1e-6)


def test_what_is_not_measured_decays_with_the_dilution() -> None:
    result = simulated(tank("0.3"), {"R": observer(initial={"X": 1, "S": 7}, internal={"r": 0.3})}, end=4)
    error = result.observers["R"].xhat - result.x
    np.testing.assert_allclose(error[:, 1], 2 * np.exp(-0.5 * result.time), rtol=1e-6)
    np.testing.assert_allclose(error[:, 0], 0, atol=1e-12)


def test_two_rates_from_two_species() -> None:
    """Three species, two reactions; the third follows from the balances."""
    plant = inline({"A": "-0.4", "B": "0.8 - 0.1", "C": "0.3"}, ["B", "A"], initial={"A": 5, "B": 0, "C": 0})
    block = {"type": "kinetic_rate", "theta": 4, "yields": {"A": [-1, 0], "B": [2, -1], "C": [0, 3]}}
    result = simulated(plant, {"R": block | {"initial": {"A": 5}}}, end=8)
    found = result.observers["R"]
    np.testing.assert_allclose(found.internal["r"][-1].ravel(), [0.4, 0.1], atol=1e-7)
    slope = (found.xhat[-1, 2] - found.xhat[-11, 2]) / (result.time[-1] - result.time[-11])
    assert slope == pytest.approx(0.3, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"yields": {"X": [0], "S": [1]}}, "must be linearly independent"),
        ({"yields": {"X": [1, 2]}}, "expected as many yields as outputs, 1"),
        ({"yields": {"Z": [1]}}, "unknown state 'Z'"),
        ({"dilution": "Q"}, "Q"),
        ({"feed": {"S": "X"}}, "X"),
    ],
)
def test_what_does_not_fit_is_refused(change: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(tank("0.1"), {"R": observer() | change}))


def test_outputs_have_to_be_states() -> None:
    plant = inline({"X": "-X"}, "2*X")
    with pytest.raises(ConfigError, match="needs outputs that are states"):
        hgorun.simulate(experiment(plant, {"R": {"type": "kinetic_rate", "theta": 1, "yields": {"X": [1]}}}))


@pytest.fixture(name="without_balance")
def of_a_rate_that_is_a_state() -> Result:
    """A rate that is a state of the plant's model is none of the species of the observer."""
    plant = inline({"S": "-v", "v": "0.1*v", "E": "0.45*v"}, "S", initial={"S": 5.0, "v": 0.5, "E": 0.0})
    rate = {"type": "kinetic_rate", "theta": 3, "yields": {"S": [-1], "E": [0.45]}}
    return simulated(plant, {"R": rate, "H": {"type": "kalman_bucy", "Q": {"v": 1}, "R": 0.1}}, end=2)


@pytest.mark.costly
def test_of_states_without_a_balance_nothing_is_said(without_balance: Result, tmp_path: Path) -> None:
    unestimated = {"R": ("v",), "H": ()}
    assert {label: one.unestimated for label, one in without_balance.observers.items()} == unestimated
    again = read(without_balance.save(tmp_path / "x.h5"))
    assert {label: one.unestimated for label, one in again.observers.items()} == unestimated


@pytest.mark.slow
def test_states_without_a_balance_are_not_drawn(without_balance: Result) -> None:
    figure = comparison(without_balance)
    drawn = {axes.get_ylabel(): {line.get_label() for line in axes.get_lines()} for axes in figure.axes}
    (of_v,) = (labels for text, labels in drawn.items() if text.startswith("$v"))
    (of_e,) = (labels for text, labels in drawn.items() if text.startswith("$E"))
    assert of_e - of_v == {"R"}
