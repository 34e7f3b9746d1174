"""What leaving late samples out means for observers of one period or a longest gap, and what is said to others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from plain_logs import estimated, written
from plain_observers import Array, Sample
from recordings import recording, signal, source

from hgorun.errors import ConfigError
from hgorun.estimate.estimate import estimate

PLANT: Block = {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-a"}, "output": "a"}
ON_TIME: list[Sample] = [(0.25 * k, 0.25 * k, 0, float(np.cos(0.25 * k))) for k in range(8)]
BETWEEN: list[Sample] = [(0.4, 1.1, 0, 5.0), (0.9, 1.3, 0, -5.0)]  # taken between them, and late
ONE_LATE: list[Sample] = [*ON_TIME[:3], (0.75, 0.9, 0, 1.0), *ON_TIME[4:]]


def estimate_of(samples: Sequence[Sample], folder: Path, kind: str, **keys: object) -> Array:
    data = written(folder, sorted(samples), "a", {})
    return estimated(folder, {"plant": PLANT, "data": data, "observers": {"O": {"type": kind, **keys}}})["O"]


def test_samples_that_are_left_out_do_not_break_the_period(tmp_path: Path) -> None:
    """When they become known has nothing to do with when the others are taken."""
    keys: Block = {"poles": [-1, -2], "late": "drop", "initial": {"a": 0.5, "b": 0.0}}
    found = estimate_of([*ON_TIME, *BETWEEN], tmp_path, "luenberger_exact", **keys)
    without = estimate_of(ON_TIME, tmp_path, "luenberger_exact", **keys)
    np.testing.assert_allclose(found, without, rtol=0, atol=1e-7)  # steps end at other times: 3e-9


@pytest.mark.parametrize(
    ("kind", "keys", "samples", "message"),
    [
        ("luenberger_exact", {"poles": [-1, -2]}, [*ON_TIME, *BETWEEN], "of a are 0.1 to 0.25 apart, not whole"),
        ("tracking", {"r": 3, "h_0": 0.3, "late": "drop"}, ONE_LATE, "the time between samples, 0.5; found 0.3"),
        ("hgo_fd", {"eps": 0.5}, ONE_LATE, r"a is late: leave late samples out \(late: drop\), or `available`"),
        ("hgo_fd", {"eps": 0.5, "late": "replay"}, ONE_LATE, r"it can leave late ones out \(late: drop\)"),
        ("predictor_chain", {"theta": 2, "m": 2}, ONE_LATE, "a delay that is constant and known"),
        ("predictor_chain", {"theta": 2}, ONE_LATE, "not of data or a stream: take shgo, whose innovation"),
    ],
)
def test_what_cannot_be_is_refused_with_what_can(
    kind: str, keys: Block, samples: Sequence[Sample], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=message):
        estimate_of(samples, tmp_path, kind, **keys)


@pytest.mark.parametrize(
    ("late", "expected"),
    [("drop", "2 of 6 samples of a were left out since they were late (late: drop)"), ("replay", None)],
)
def test_how_many_are_left_out_is_told(late: str, expected: str | None) -> None:
    taken = 0.5 * np.arange(6)
    log = recording(signal("a", taken, np.cos(taken), taken + np.array([0, 0.2, 0, 0, 0.3, 0])))
    config = {"plant": PLANT, "observers": {"O": {"type": "shgo", "theta": 2, "late": late}}, "solver": {"step": 0.05}}
    told = [words for words in estimate(source(config), log, sensitivity=False).remarks if "left out" in words]
    assert told == ([] if expected is None else [expected])
