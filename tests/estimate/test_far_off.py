"""An outlier among samples that are held out is named, with the score that there would be without it."""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import Block
from recordings import PENDULUM, POLES, START, assessed_of, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.result.result import Result

TAKEN = np.arange(0, 10, 0.1)
ASIDE = TAKEN[2::5]  # 20 of them
NUMBERS = r"is ([0-9.e-]+) in place of ([0-9.e-]+)"


def found(
    outliers: dict[int, float],
    labels: str = "o",
    std: float | None = 0.05,
    count: int = 20,
    leave_out: int | None = None,
) -> Result:
    random = np.random.default_rng(3)
    noise = 0.05 * random.normal(size=(2, TAKEN.size))
    y = np.sin(TAKEN) + noise[0]  # which a pendulum without friction is not quite
    aside = np.sin(ASIDE) + noise[1][: ASIDE.size]
    for k, size in outliers.items():
        aside[k] += size
    blocks: Block = {label: {"type": "shgo", **POLES, "theta": 2 + k} for k, label in enumerate(labels)}
    text = {"plant": {**PENDULUM, "initial": START}, "observers": blocks, "solver": {"step": 0.02}}
    chosen = [k for k in range(count) if k != leave_out]
    held_out = {"a": signal("a", ASIDE[chosen], aside[chosen])}
    log = recording(signal("a", TAKEN, y, std=std))
    return estimate(source(text), log, sensitivity=False, held_out=held_out)


def told(result: Result) -> list[str]:
    return [one for one in result.remarks if "held-out sample" in one]


@pytest.mark.parametrize("std", [0.05, None])
def test_an_outlier_is_named_with_the_score_without_it(std: float | None) -> None:
    result = found({7: 3.0}, std=std)
    (one,) = told(result)
    assert re.match(
        r"a: 1 held-out sample is [0-9.]+ standard deviations farther .* at t = 3.7: an .* without it holdout",
        one,
    )
    ((rest, whole),) = re.findall(NUMBERS, one)
    scores = [assessed_of(each, "o").scores["holdout_rmse"]["a"] for each in (result, found({}, std=std, leave_out=7))]
    assert [float(whole), float(rest)] == pytest.approx(scores, rel=5e-3)  # as they are written
    assert scores[0] == pytest.approx(3.0 / 20**0.5, rel=0.05)


def test_of_several_the_first_is_named_and_every_observer() -> None:
    (one,) = told(found({7: 3.0, 12: -2.0}, "op"))
    assert "2 held-out samples are " in one
    assert "the first at t = 3.7: outliers, or some were used shortly before; without them holdout_rmse of o is" in one
    assert ", holdout_rmse of p is" in one


@pytest.mark.parametrize(
    ("outliers", "count"),
    [
        ({}, 20),
        ({7: 0.3}, 20),  # not far
        ({0: 3.0}, 20),  # as where an estimate is still on its way
        ({k: 3.0 for k in (5, 8, 11)}, 20),  # too many
        ({4: 3.0}, 7),  # too few to tell
    ],
)
def test_others_are_not_named(outliers: dict[int, float], count: int) -> None:
    assert not told(found(outliers, count=count))


def test_of_observers_that_are_lost_nothing_is_told() -> None:
    assert not told(found({7: np.inf}))
