"""Gains that are given in place of poles: the same observer, where they are the gains of these poles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import chain, experiment, simulated

from hgorun.errors import ConfigError
from hgorun.observers.fhgo2 import FilteredObserver2
from hgorun.observers.shgo import StandardObserver
from hgorun.observers.treangle import cascade, characteristic
from hgorun.simulation.simulate import prepare
from hgorun.symbolic.matrices import hurwitz_gain

PLANT = chain(3, "-x1 - 2*x2 - x3")
BINOMIALS = np.concatenate(cascade(np.array([1.0, *hurwitz_gain(6, -1)])))


@pytest.mark.costly
@pytest.mark.parametrize(
    ("block", "gains"),
    [
        ({"type": "shgo", "theta": 3}, hurwitz_gain(3, -1)),
        ({"type": "fhgo2", "theta": 3, "r": 2}, hurwitz_gain(5, -1)),
        ({"type": "integral", "theta": 3, "r": 1}, hurwitz_gain(4, -1)),
        ({"type": "treangle", "theta": 3}, BINOMIALS),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)
def test_the_gains_of_the_poles_are_the_poles(block: dict[str, Any], gains: np.ndarray) -> None:
    run = simulated(PLANT, {"a": block | {"poles": -1}, "b": block | {"gains": gains.tolist()}}, step=0.002)
    np.testing.assert_allclose(run.observers["a"].xhat, run.observers["b"].xhat, rtol=1e-9, atol=1e-12)


def test_the_fastest_rate_is_that_of_the_gains() -> None:
    """-1, -2, -7 in place of equal poles; of treangle its own polynomial of degree 2 n."""
    gains = np.poly([-1, -2, -7])[1:]
    d, c = np.array([4.0, 3.0, 2.0]), np.array([5.0, 2.0, 1.0])
    blocks = {
        "s": {"type": "shgo", "theta": 3, "gains": gains.tolist()},
        "t": {"type": "treangle", "theta": 3, "gains": [*d, *c]},
    }
    made = experiment(PLANT, blocks)
    rates = {label: observer.fastest_rate(made.forms[label]) for label, observer in made.observers.items()}
    assert rates["s"] == pytest.approx(3 * 7)
    assert rates["t"] == pytest.approx(3 * np.max(np.abs(np.roots(characteristic(d, c)))))


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ({"type": "shgo", "gains": [3, 3]}, "expected 3 numbers; found 2"),
        ({"type": "shgo", "poles": [-1, -2]}, "expected 3 numbers, or one number for all; found 2"),
        ({"type": "treangle", "gains": [3, 3, 1]}, "expected 6 numbers; found 3"),
        ({"type": "fhgo2", "r": 1, "gains": [3, 3, 1]}, "expected 4 numbers; found 3"),
        ({"type": "shgo", "gains": {"x1": [3, 3], "x3": [1]}}, "it is one list, and none for each of x1, x3"),
        ({"type": "shgo", "gains": [3, 3, 1], "poles": -1}, "give either poles or gains, not both"),
    ],
)
def test_as_many_gains_as_the_error_has_states(block: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        prepare(experiment(PLANT, {"o": {"theta": 3, **block}}))
    given = [key for key in ("gains", "poles") if key in block]
    assert caught.value.key == ".".join(["observers", "o", *given] if len(given) == 1 else ["observers", "o"])


UNEVEN = {
    "states": ["x", "v", "w"],
    "dynamics": {"x": "v", "v": "-x + w", "w": "-w"},
    "output": {"y": "x", "z": "w"},
    "initial": {"x": 1, "v": 0, "w": 0.1},
}


@pytest.mark.parametrize(
    ("block", "needs"),
    [
        ({"type": "shgo", "theta": 3, "poles": [-1, -2, -3]}, "the chain of y needs 2 numbers, that of z 1"),
        ({"type": "shgo", "theta": 3, "gains": [1, 2]}, "the chain of y needs 2 numbers, that of z 1"),
        ({"type": "shgo", "theta": 3, "extend": 1, "gains": [1, 2, 3]}, "the chain of y needs 3 numbers, that of z 2"),
        ({"type": "fhgo2", "theta": 3, "r": 1, "poles": [-1]}, "the chain of y needs 3 numbers, that of z 2"),
        ({"type": "treangle", "theta": 3, "poles": [-1, -2]}, "the chain of y needs 4 numbers, that of z 2"),
        ({"type": "impulsive", "theta": 3, "poles": [-1, -2]}, "the chain of y needs 2 numbers, that of z 1"),
        ({"type": "prescribed_time", "T": 2, "poles": [-9, -8]}, "the chain of y needs 2 numbers, that of z 1"),
    ],
)
def test_no_list_fits_chains_that_are_not_equally_long(block: dict[str, Any], needs: str) -> None:
    key = "gains" if "gains" in block else "poles"
    with pytest.raises(
        ConfigError, match=f"{needs}, so that no list fits all: write .*, as poles: -1; found"
    ) as caught:
        prepare(experiment(UNEVEN, {"o": block}, measurement={"sampling": {"period": 0.1}}))
    assert caught.value.key == f"observers.o.{key}"
    right = {name: value for name, value in block.items() if name not in ("gains", "poles")}
    if block["type"] != "prescribed_time":  # which starts with poles of its own
        right |= {"poles": -1.5}
    prepare(experiment(UNEVEN, {"o": right}, measurement={"sampling": {"period": 0.1}}))


def test_what_is_written_can_be_read() -> None:
    """Poles have a default, and are left out where gains are given."""
    given = StandardObserver(type="shgo", theta=2, gains=(3.0, 3.0, 1.0))
    assert "poles" not in given.model_dump(exclude_none=True)
    assert StandardObserver.model_validate(given.model_dump(exclude_none=True)).gains == (3.0, 3.0, 1.0)
    placed = FilteredObserver2(type="fhgo2", theta=2, poles=-2)
    written = placed.model_dump(exclude_none=True)
    assert "gains" not in written
    assert FilteredObserver2.model_validate(written).poles == -2


def test_the_poles_that_are_asked_for() -> None:
    """All at -1 in the theory where the gain itself is given."""
    given = StandardObserver(type="shgo", theta=2, gains=(3.0, 3.0, 1.0))
    assert given.placed_poles(3).tolist() == [-1, -1, -1]
    assert StandardObserver(type="shgo", theta=2, poles=-2).placed_poles(3).tolist() == [-2, -2, -2]
    pair = StandardObserver(type="shgo", theta=2, poles=(-1 + 2j, -1 - 2j))
    assert pair.placed_poles(2).tolist() == [-1 + 2j, -1 - 2j]
