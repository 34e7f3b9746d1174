"""Runs that cannot be made are refused before the first step, with the key that is to blame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from examples import Block, chain, experiment, inline

from hgorun import Experiment
from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare

SHGO: Block = {"type": "shgo", "theta": 2}
DEADBEAT: Block = {"type": "deadbeat"}
SAMPLED: Block = {"sampling": {"period": 0.1}}
ROOT = inline({"x1": "x2", "x2": "-sqrt(abs(x1)) - x2"}, "x1", start=0.0)
BOTH = inline({"x1": "x3", "x2": "-x2", "x3": "-x1"}, ["x1", "x2"])


@pytest.mark.parametrize(
    ("plant", "block", "more", "key", "words"),
    [
        (
            chain(2) | {"discretise": "euler"},
            DEADBEAT,
            {"measurement": {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "snr_db": 20}]}},
            "plant.discretise",
            "snr_db needs a plant in continuous time; give std",
        ),
        (chain(2), DEADBEAT, {}, "observers.o", "this needs sampled outputs, but x1 is continuous"),
        (
            chain(2),
            DEADBEAT,
            {"measurement": SAMPLED | {"delay": 0.05}},
            "observers.o",
            "this takes samples without delay",
        ),
        (
            BOTH,
            DEADBEAT,
            {"measurement": {"outputs": {"x1": SAMPLED, "x2": {"sampling": {"period": 0.2}}}}},
            "observers.o",
            "same times, but x2 has no sample beside that of x1 at t = 0.1, the nearest is 0.1 earlier: give all "
            "outputs one sampling, or take ekf or impulsive_riccati",
        ),
        (
            chain(2),
            SHGO,
            {"measurement": {"delay": 0.5}, "step": 1e-5, "time": {"end": 1, "output_step": 0.1, "max_memory": 1e6}},
            "measurement.delay",
            "the history of a delay of 0.5 takes",
        ),
        (
            chain(6),
            {"type": "shgo_riccati", "theta": 2},
            {"time": {"end": 1, "output_step": 1e-4, "max_memory": 2.2e6}},
            "time.output_step",
            " states take ",
        ),
        (
            inline({"x1": "x2", "x2": "-log(x1)"}, "x1", start=0.0),
            SHGO,
            {},
            "plant.dynamics.x2",
            "the right-hand side of x2 is not a finite number at the start",
        ),
    ],
)
def test_what_cannot_be_run(plant: Block, block: Block, more: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        prepare(experiment(plant, {"o": block}, **({"step": 0.01} | more)))
    assert words in str(caught.value)
    assert caught.value.key == key


def test_a_plant_without_a_slope_at_the_start_has_a_step_by_the_rest() -> None:
    """2^-10 of the run, or up to twice a twentieth of the observer's time constant."""
    slow, fast = (prepare(experiment(ROOT, {"o": SHGO | {"theta": theta}})).step for theta in (2, 1000))
    assert slow == 2**-10
    assert fast == 2**-14
    assert 1 <= fast / (0.05 / 1000) < 2


def test_extending_a_file_is_for_files() -> None:
    config = {"extends": "other.yaml", "time": {"end": 1, "output_step": 0.1}}
    with pytest.raises(ConfigError) as caught:
        Experiment(config)
    assert caught.value.key == "extends"
    with pytest.raises(ConfigError) as caught:
        experiment(chain(2), {"o": SHGO}).varied({"extends": "other.yaml"})
    assert caught.value.key == "extends"


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"observers": 5}, "observers"),
        ({"observers.o": "shgo"}, "observers.o"),
        ({"plant": [1]}, "plant"),
        ({"plant": None}, "plant"),
        ({"observers.o.theta": -1}, "observers.o.theta"),
    ],
)
def test_changes_that_are_no_blocks(changes: Mapping[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        experiment(chain(2), {"o": SHGO}).varied(changes)
    assert caught.value.key == key
