"""A plant that an observer does not take: the reason that holds, and what would be right."""

from typing import Any

import pytest
from examples import simulated

from hgorun.errors import ConfigError

UNSEEN: dict[str, Any] = {
    "states": ["T", "c"],
    "dynamics": {"T": "-k*T + c", "c": "-c + sin(t)"},
    "output": "c",
    "initial": {"T": 1, "c": 1},
    "parameters": {"k": 1},
}
TANKS: dict[str, Any] = {
    "states": ["h1", "h2"],
    "dynamics": {"h1": "q - sqrt(h1)", "h2": "sqrt(h1) - sqrt(h2)"},
    "output": "h2",
    "inputs": {"q": "2 + sin(t)"},
    "initial": {"h1": -5, "h2": 4},
}


def refused(plant: dict[str, Any], observer: dict[str, Any]) -> ConfigError:
    with pytest.raises(ConfigError) as error:
        simulated(plant, {"D": observer}, end=1)
    return error.value


@pytest.mark.parametrize("key", ["theta", "q"])
def test_a_filter_of_chains_is_told_the_keys_with_which_it_takes_the_plant(key: str) -> None:
    said = refused(UNSEEN, {"type": "kalman_bucy", key: 2, "R": 1}).message
    assert said.startswith("nothing that is measured (c) depends on the state T, now or later")
    assert said.endswith(
        f"observer D (kalman_bucy) with {key} needs another form of the plant; with Q in place of {key} it takes this "
        "one (and carries that state along, uncorrected)"
    )
    right = {"type": "kalman_bucy", "Q": {"T": 1, "c": 1}, "R": 1}
    assert simulated(UNSEEN, {"D": right}, end=1).observers["D"].status == "ok"


def test_a_state_that_nothing_shows_is_the_reason_before_time() -> None:
    """As an input it would be as hidden."""
    assert "depends on time" not in refused(UNSEEN, {"type": "shgo", "theta": 2}).message


def test_initial_values_at_which_the_plant_is_undefined_are_no_matter_of_observers() -> None:
    error = refused(TANKS, {"type": "shgo", "theta": 2})
    start = "the right-hand side of h1 is not a finite number at the start of the run"
    where = "that is by plant.initial, whatever observers begin with"
    assert error.message.startswith(f"{start}: sqrt of a negative number (h1 = -5); {where}; of recorded data")
    assert error.key == "plant.dynamics.h1"


def test_a_root_that_an_input_makes_real_is_no_reason() -> None:
    plant = {**UNSEEN, "dynamics": {"T": "-T + sqrt(u - 0.5)", "c": "-c"}, "inputs": {"u": "2"}, "parameters": {}}
    assert refused(plant, {"type": "shgo", "theta": 2}).message.startswith("nothing that is measured (c) depends")
