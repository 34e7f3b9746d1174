"""The benchmark that comes with hgorun: its files are right, and all its observers take some plant."""

from __future__ import annotations

import pytest

from hgorun.benchmark.benchmark import load_benchmark
from hgorun.benchmark.contestants import absent, contestant_in
from hgorun.errors import ConfigError
from hgorun.observers.base import OBSERVERS
from hgorun.reproduce.shipped import folder
from hgorun.simulation.preparation.preparation import prepare


@pytest.mark.costly
def test_every_observer_takes_part_or_has_a_reason() -> None:
    asked = load_benchmark(folder() / "benchmark" / "benchmark.yaml")
    taking = {one.block["type"] for one in asked.contestants.values()}
    assert taking | absent(asked.blocks).keys() == set(OBSERVERS.names())


@pytest.mark.measured
@pytest.mark.slow
def test_every_contestant_takes_a_plant() -> None:
    asked = load_benchmark(folder() / "benchmark" / "benchmark.yaml")
    left = dict(asked.blocks.observers)
    for (plant, _), base in asked.bases.items():
        for label, one in list(left.items()):
            try:
                prepare(contestant_in(base, label, one.on(plant), asked.blocks.plants[plant].rate))
            except ConfigError:
                continue
            del left[label]
    assert not left
