"""Samples that a gate leaves out one after the other: so many are told of, however long the log is."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from examples import Block, experiment
from recordings import PENDULUM, START, assessed_of, recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.scores.row_left_out import _longest
from hgorun.estimate.scores.shut_out import of_start, shut_out, too_small
from hgorun.estimate.stream import notes
from hgorun.estimate.stream.estimator import Estimator
from hgorun.observers.base import AnyObserver
from hgorun.result.reading import read
from hgorun.result.result import Result

COUNT, STEPPED, GATE = 150, 90, 5.0
TAKEN = 0.1 * np.arange(1, COUNT + 1)
EKF: Block = {"type": "ekf", "Q": {"b": 1e-4}, "R": 0.01, "initial": START}
SHGO: Block = {"type": "shgo", "theta": 2, "poles": -1, "initial": START}
MEASUREMENT = {"noise": [{"type": "gaussian", "std": 0.1}], "sampling": {"period": 0.1}}


def values(away: int) -> np.ndarray:
    """A pendulum whose angle reads 30 too much for some samples; there is one outlier long before, and one behind."""
    found = np.sin(0.98 * TAKEN) * np.exp(-0.05 * TAKEN)
    found[STEPPED : STEPPED + away] += 30.0
    found[[20, 130]] -= 30.0
    return np.asarray(found)


def of_log(away: int, **blocks: Block) -> Result:
    config = {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": 0.5},
        "plant": PENDULUM,
        "observers": blocks,
        "measurement": MEASUREMENT,
        "solver": {"step": 0.02},
    }
    log = recording(signal("a", TAKEN, values(away), gate=GATE))
    return estimate(source(config), log, sensitivity=False)


@pytest.mark.parametrize(("away", "told"), [(19, False), (20, True), (28, True)])
def test_as_many_as_outliers_never_are_is_told(away: int, told: bool) -> None:
    """All of them below a fifth of the samples."""
    result = of_log(away, E=EKF)
    row = assessed_of(result, "E").in_a_row["a"]
    assert row.count == away
    np.testing.assert_allclose([row.first, row.last], TAKEN[[STEPPED, STEPPED + away - 1]], rtol=1e-12)
    assert assessed_of(result, "E").scores["gated"] == {"a": away + 2}
    said = [words for words in result.remarks if "too many for outliers" in words]
    assert bool(said) == told == any(shut_out(result))
    if told:
        assert f"left out {away + 2} of {COUNT} samples, {away} of them one after the other (t = 9.1 to" in said[0]
        assert said[0].endswith("the model, and whether std, Q or the gate of 5 is too small")


def test_of_a_row_near_the_start_the_start_may_be_the_cause() -> None:
    """The speed starts 100 too low, and the filter takes that for exact; a row far behind says nothing of the start."""
    near = of_log(0, E={**EKF, "initial": {"a": 0.0, "b": -100.0}, "internal": {"P": 1e-6}}).remarks
    said = [words for words in near if "too many for outliers" in words]
    assert len(said) == 1
    keys = "observers.E.initial, internal: {P: ...}, how far off it may be"
    assert f"look at the start, near which most of them lie ({keys}), the unit of the column, the model" in said[0]
    assert of_start("S", observer_of(SHGO), given=False).endswith("(observers.S.initial, data.first_samples), ")


def observer_of(block: Block) -> AnyObserver:
    (one,) = experiment(PENDULUM, {"O": block}, end=1.0).observers.values()
    return one


def test_a_stream_counts_alike_also_from_checkpoints() -> None:
    """With an observer that is shut out for good, and one whose median lets it follow."""
    blocks, away = {"E": EKF, "S": SHGO}, COUNT - STEPPED
    wanted = {}
    for label, used in zip(blocks, recorded_of(of_log(away, **blocks)).outputs["a"].used.T.tolist(), strict=True):
        wanted[label] = {"a": max(len(list(group)) for taken, group in groupby(used) if not taken)}
    one = experiment(PENDULUM, blocks, end=float(TAKEN[-1]), step=0.02, measurement=MEASUREMENT)
    estimator = Estimator(one, gates={"a": GATE})
    for k, (t, y) in enumerate(zip(TAKEN.tolist(), values(away).tolist(), strict=True)):
        estimator.update(t, {"a": y})
        if k % 40 == 39:
            kept, estimator = estimator.checkpoint(), Estimator(one, gates={"a": GATE})
            estimator.restore(kept)
    assert estimator.gated_in_a_row == wanted
    assert wanted["E"]["a"] == 130 - STEPPED > wanted["S"]["a"] > 20  # the outlier there is what the filter expects


@pytest.mark.parametrize(
    ("observer", "numbers"),
    [
        (SHGO, "std or the gate of 5"),
        ({"type": "ekf", "theta": 2, "R": 0.01}, "std, theta or the gate of 5"),
        ({"type": "savgol", "window": 5}, "std or the gate of 5"),
    ],
)
def test_what_may_be_too_small_is_what_the_observer_has(observer: Block, numbers: str) -> None:
    assert too_small(observer_of(observer), GATE) == f"whether {numbers} is too small"


def test_a_file_of_a_result_has_none(tmp_path: Path) -> None:
    result = of_log(28, E=EKF)
    result.save(tmp_path / "r.h5")
    again = read(tmp_path / "r.h5")
    assert assessed_of(again, "E").in_a_row == {}
    assert not any(shut_out(again))  # 30 of 150 are no more than a fifth


def test_checkpoints_of_before_have_no_rows() -> None:
    said = [[True], [[0.5]], [0], 0.5, None, [[4]], [[2]], [], [], [0.5]]
    assert notes.read(said, 1, [(0,)], [(0,)])[-2] == (((0, 0),),)
    assert notes.read([*said, [[[1, 2]]]], 1, [(0,)], [(0,)])[-2:] == ((((1, 2),),), 0)


def test_the_longest_of_several() -> None:
    random = np.random.default_rng(1)
    for marked in [random.random(30) < 0.7 for _ in range(20)]:
        first, last = _longest(marked)
        assert marked[first : last + 1].all()
        assert last - first + 1 == max(len(list(group)) for one, group in groupby(marked.tolist()) if one)
