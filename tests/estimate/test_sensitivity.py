"""How much the score depends on each gain: beside an observer written in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block
from recordings import PENDULUM, assessed_of, recording, signal, source

from hgorun.errors import ConfigError
from hgorun.estimate.estimate import estimate

PERIOD, STEPS, LEFT_OUT = 0.1, 20, 8  # samples that scores leave out at the start
TAKEN = PERIOD * np.arange(80)
Y = np.cos(TAKEN) + 0.03 * np.sin(37 * TAKEN**2)
START: Block = {"initial": {"a": 0.8, "b": 0.0}}
SHGO: Block = {"type": "shgo", "theta": 3.0, **START}
UPDATED: Block = {"type": "updated", "theta_0": 1.0, "theta_max": 4.0, "delta": 0.1, "a": 3.0, **START}
BANK: Block = {"type": "bank", "observer": {"type": "shgo"}, "thetas": [2.0, 4.0], "eps": 1.0, "nu": 1.0, **START}


def scores(**observers: Block) -> dict[str, dict[str, float]]:
    text = {"plant": PENDULUM, "observers": observers, "solver": {"step": PERIOD / STEPS}}
    found = estimate(source(text), recording(signal("a", TAKEN, Y)))
    return {label: dict(assessed_of(found, label).scores["sensitivity"]) for label in observers}


def innovations(theta: float) -> float:
    """The size of the innovations of an SHGO, integrated by hand."""

    def rate(z: np.ndarray) -> np.ndarray:
        a, b, e = z
        return np.array([b - 2 * theta * e, -np.sin(a) - 0.1 * b - theta**2 * e, -2 * theta * e])

    z, found, h = np.array([0.8, 0.0, 0.0]), [], PERIOD / STEPS
    for y in Y:
        z[2] = z[0] - y
        found.append(z[2])
        for _ in range(STEPS):
            k1 = rate(z)
            k2 = rate(z + h / 2 * k1)
            k3 = rate(z + h / 2 * k2)
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(z + h * k3))
    return float(np.sqrt(np.mean(np.square(found[LEFT_OUT:]))))


def test_it_is_the_slope_of_the_logarithms() -> None:
    larger, smaller = innovations(3.0 * 1.05), innovations(3.0 / 1.05)
    expected = np.log(larger / smaller) / (2 * np.log(1.05))
    assert scores(S=SHGO)["S"] == {"theta": pytest.approx(expected, rel=1e-9)}


def test_of_a_gain_that_cannot_be_larger_it_is_the_slope_below() -> None:
    """The third gain of the bank is eps, of which 1 is the most; it takes none from another observer."""
    blocks = {"B": BANK, "less": {**BANK, "eps": 1 / 1.05}, "U": UPDATED}
    text: Block = {"plant": PENDULUM, "observers": blocks, "solver": {"step": PERIOD / STEPS}}
    found = estimate(source(text), recording(signal("a", TAKEN, Y)), sensitivity=False)
    itself, less = (assessed_of(found, label).scores["innovation_rms"]["a"] for label in ("B", "less"))
    beside = scores(B=BANK, U=UPDATED)
    assert beside["B"]["eps"] == pytest.approx(np.log(itself / less) / np.log(1.05), rel=1e-9)
    assert beside["B"]["eps"] != 0
    assert beside["U"].keys() == {"theta_0", "theta_max", "delta", "a"}
    assert beside["U"] == scores(U=UPDATED)["U"]


@pytest.mark.parametrize("std", [{}, {"std": 0.05}])
def test_units_of_outputs_do_not_matter(std: dict[str, float]) -> None:
    """The rate of the angle in rad/s, and in thousandths of it."""

    def slope(unit: float) -> float:
        text = {
            "plant": {**PENDULUM, "dynamics": {"a": f"b/{unit}", "b": f"-{unit}*sin(a) - 0.1*b"}, "output": ["a", "b"]},
            "observers": {
                "S": {"type": "shgo", "theta": 2.0, "chains": {"a": 1, "b": 1}, "initial": {"a": 0.8, "b": 0.0}}
            },
            "solver": {"step": PERIOD / STEPS},
        }
        rate = -unit * (np.sin(TAKEN) + 0.05 * np.cos(41 * TAKEN**2))
        other = {key: unit * value for key, value in std.items()}
        log = recording(signal("a", TAKEN, Y, **std), signal("b", TAKEN, rate, **other))
        return assessed_of(estimate(source(text), log), "S").scores["sensitivity"]["theta"]

    assert slope(1000.0) == pytest.approx(slope(1.0), rel=1e-9)


def test_an_edge_of_a_range_is_no_remark() -> None:
    """1 is the most, and the default, of alpha."""
    ukf: Block = {"type": "ukf", "Q": {"b": 0.01}, "R": 0.01, **START}
    text: Block = {"plant": PENDULUM, "observers": {"U": ukf}, "solver": {"step": PERIOD / STEPS}}
    found = estimate(source(text), recording(signal("a", TAKEN, Y)))
    assert not found.remarks
    assert "alpha" in assessed_of(found, "U").scores["sensitivity"]


def test_a_gain_that_can_be_neither_larger_nor_smaller_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def refusing(*_: object) -> dict[str, float]:
        raise ConfigError("expected another")

    monkeypatch.setattr("hgorun.estimate.scores.sensitivity._sizes", refusing)
    text = {"plant": PENDULUM, "observers": {"S": SHGO}, "solver": {"step": PERIOD / STEPS}}
    found = estimate(source(text), recording(signal("a", TAKEN, Y)))
    (told,) = found.remarks
    assert told.startswith("S: how its scores depend on theta is not told, as theta = ")
    assert told.endswith(" is refused: expected another")
    assert "sensitivity" not in assessed_of(found, "S").scores
