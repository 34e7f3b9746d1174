"""Logs of very many samples: what they take, and that they are gone through piece by piece with the same numbers."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from examples import experiment, inline
from recordings import START, held_input, observers, recording, signal

from hgorun.estimate import carrying
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate_prepared
from hgorun.estimate.prepared import prepare_estimate
from hgorun.estimate.scores import evaluated

DRIVEN = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, "a", inputs={"u": "0"})
EKF = {"K": {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01, "initial": START}}
_BYTES = 650  # at most, for each sample of one output with one input


def log_of(count: int) -> tuple[np.ndarray, np.ndarray]:
    t = 0.01 * np.arange(count)
    return t, np.sin(0.7 * t) + 0.01 * np.cos(37 * t)


def test_what_a_sample_takes_does_not_grow_unnoticed() -> None:
    count = 80_000
    t, y = log_of(count)
    log = recording(signal("a", t, y), u=held_input("u", t, np.cos(0.1 * t)))
    whole = experiment(DRIVEN, observers("shgo"), end=1, step=0.01, measurement={"sampling": {"period": 0.01}})
    source = whole.source
    source.data.pop("time", None)
    prepared = prepare_estimate(completed(source, log, "x", ""), log)
    tracemalloc.start()
    result = estimate_prepared(prepared, log, {})
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert result.status == "ok"
    assert peak < _BYTES * count


@pytest.mark.parametrize("blocks", [observers("shgo", "fhgo2"), EKF])
def test_pieces_of_a_log_give_the_numbers_of_the_whole(
    blocks: dict[str, dict[str, object]], monkeypatch: pytest.MonkeyPatch
) -> None:
    t, y = log_of(100)
    log = recording(signal("a", t, y), u=held_input("u", t, np.cos(0.1 * t)))
    whole = experiment(DRIVEN, blocks, end=0.9, step=0.01, measurement={"sampling": {"period": 0.01}})
    prepared = prepare_estimate(completed(whole.source, log, "x", ""), log)

    def found() -> list[object]:
        result = estimate_prepared(prepared, log, {})
        scores = [one.assessed and one.assessed.scores for one in result.observers.values()]
        return [result.integration_error, result.unresolved, *scores]

    expected = found()
    monkeypatch.setattr(carrying, "_ROWS", 7)
    monkeypatch.setattr(evaluated, "_PIECE", 11)
    assert found() == expected
