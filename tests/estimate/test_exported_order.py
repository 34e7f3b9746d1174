"""Several samples of one time, of two outputs: the lines that are exported give a stream the bits of the log."""

from __future__ import annotations

import csv
from collections.abc import Mapping

import numpy as np
import pytest
from examples import Block
from recordings import recording, signal, source

from hgorun.commands.exported_samples import lines
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.stream.estimator import Estimator

GAP = 0.125
T = np.repeat(GAP * np.arange(9), 2)
NOISE = np.random.default_rng(3).normal(scale=0.05, size=(2, T.size))
TEXT: Block = {
    "plant": {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-sin(a)"}, "output": ["a", "b"]},
    "observers": {"O": {"type": "impulsive", "theta": 2, "poles": -1, "initial": {"a": 1.0, "b": 0.5}}},
    "time": {"start": 0.0, "end": 1.0, "output_step": GAP},
    "solver": {"step": GAP / 4},
}


def values() -> Mapping[str, np.ndarray]:
    return {"a": np.cos(T) + NOISE[0], "b": -np.sin(T) + NOISE[1]}


def test_the_second_samples_stand_behind_the_first_ones_of_all_outputs() -> None:
    log = recording(*(signal(name, T, y) for name, y in values().items()))
    rows = list(csv.reader(list(lines(log))[1:]))
    assert [row[1] for row in rows] == ["a", "b"] * T.size
    given = source(TEXT)
    estimator = Estimator(streamed(given, StatedOfData.of(given), "e"))
    found = {}
    for t, name, y in rows:
        estimator.update(float(t), {name: float(y)})
        found[float(t)] = estimator.estimate()["O"].copy()
    result = estimate(given, log, sensitivity=False).observers["O"]
    np.testing.assert_array_equal(np.array(list(found.values())), result.xhat)


@pytest.mark.parametrize("known", [T, T + 0.5])
def test_of_one_output_they_stand_in_their_order(known: np.ndarray) -> None:
    y = values()["a"]
    rows = list(csv.reader(list(lines(recording(signal("a", T, y, known))))[1:]))
    assert [float(row[2]) for row in rows] == y.tolist()
