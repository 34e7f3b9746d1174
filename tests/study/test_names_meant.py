"""A name that is nearly one of those that are known is answered with the one that is meant."""

from __future__ import annotations

import copy
from typing import Any

import pytest

import hgorun
from hgorun.config.nearest import among
from hgorun.errors import ConfigError

CONFIG: dict[str, Any] = {
    "time": {"end": 1, "output_step": 0.1},
    "plant": {
        "states": ["pos", "speed"],
        "dynamics": {"pos": "speed", "speed": "-pos"},
        "output": "pos",
        "initial": {"pos": 1, "speed": 0},
    },
    "measurement": {"sampling": {"period": 0.1}},
    "observers": {"SHGO": {"type": "shgo", "theta": 2}},
}


@pytest.mark.parametrize(
    ("block", "key"),
    [
        ({"type": "ekf", "Q": {"pos": 1, "spee": 1}, "R": 1}, "Q.spee"),
        ({"type": "shgo", "theta": 2, "initial": {"spee": 1}}, "initial"),
        ({"type": "shgo", "theta": 2, "saturation": {"spee": [-1, 1]}}, "saturation"),
    ],
)
def test_a_state(block: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as raised:
        hgorun.simulate(hgorun.Experiment(copy.deepcopy(CONFIG) | {"observers": {"A": block}}))
    assert f"observers.A.{key}: unknown state 'spee'; known here: pos, speed. Did you mean `speed`?" in str(
        raised.value
    )


def test_nothing_is_offered_where_nothing_is_alike() -> None:
    assert among("spee", ("pos", "speed")) == "pos, speed. Did you mean `speed`?"
    assert among("temperature", ("pos", "speed")) == "pos, speed"
