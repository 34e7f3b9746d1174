"""Streams with automatic steps: shorter ones close behind the start, where a file has them, with its bits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import yaml
from examples import Block
from recordings import recording, signal, source

from hgorun.engine.early import Early
from hgorun.estimate import prepared
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.steps import first_steps
from hgorun.estimate.stream import live_system
from hgorun.estimate.stream.estimator import Estimator

STEP, END = 2.0**-8, 1.0
PAIR: Block = {
    "states": list("abcd"),
    "dynamics": {"a": "b", "b": "-sin(a) + 0.3*c - 0.1*b", "c": "d", "d": "-c - 0.2*a*b"},
    "output": ["a", "c"],
}
START = {"a": 0.8, "b": 0.1, "c": 0.3, "d": -0.2}
OBSERVERS: Block = {
    "KB": {"type": "kalman_bucy", "Q": {"b": 0.3, "d": 0.2}, "R": {"a": 1e-4, "c": 2e-4}, "internal": {"P": 100.0}},
    "SHGO": {"type": "shgo", "theta": 3, "poles": -1},
}
FIRST = STEP * np.array([0.0, 0.004, 0.3, 1.7])  # in the shortened phase
TIMES = [np.sort(np.append(FIRST, np.arange(0.05, END, 0.1))), np.append(0.0, np.arange(0.07, END, 0.22))]
Row = tuple[float, float, str, float]  # known, taken, output, value


def rows_of(late: Sequence[float]) -> list[Row]:
    """Of two outputs; each of the other one is known so much later, one after the other."""
    found = []
    for name, times in zip("ac", TIMES, strict=True):
        y = np.cos(times) + 0.1 * np.random.default_rng(3).normal(size=times.size)
        known = times + (np.resize(late, times.size) if name == "c" else 0.0)
        found += list(zip(known.tolist(), times.tolist(), [name] * times.size, y.tolist(), strict=True))
    return sorted(row for row in found if row[0] <= END)


def config(**more: Block) -> Block:
    observers = {label: {"initial": START, **block} for label, block in OBSERVERS.items()}
    time = {"start": 0.0, "end": END, "output_step": END}
    return {"plant": PAIR, "observers": observers, "time": time, **more}


def of_file(rows: Sequence[Row], **more: Block) -> dict[str, np.ndarray]:
    """The estimates at the end."""
    signals = []
    for name in "ac":
        known, taken, y = (np.array([row[i] for row in rows if row[2] == name]) for i in (0, 1, 3))
        signals.append(signal(name, taken, y, known))
    result = estimate(source(config(**more)), recording(*signals), sensitivity=False)
    return {label: one.xhat[-1] for label, one in result.observers.items()}


def of_stream(rows: Sequence[Row], folder: Path, restored: Sequence[int] = (), **more: Block) -> dict[str, np.ndarray]:
    """The same, of one that is killed and restored after some rows."""
    (folder / "config.yaml").write_text(yaml.safe_dump(config(**more)))
    estimator = Estimator.load(folder / "config.yaml")
    for k, (known, taken, name, y) in enumerate(rows):
        estimator.update(taken, {name: y}, available=known)
        if k in restored:
            stored, estimator = estimator.checkpoint(), Estimator.load(folder / "config.yaml")
            estimator.restore(stored)
    return estimator.predict(END)


@pytest.fixture(autouse=True)
def _few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a long log, in which the first steps are too long; with a given step they are used as they are."""
    for module in (prepared, live_system):
        monkeypatch.setattr(module, "nominal_step", lambda one: STEP if one.given_step is None else one.given_step)


@pytest.mark.parametrize("late", [(0.0,), (0.3 * STEP, 0.09, 0.0, 0.31)], ids=["on time", "late"])
def test_a_stream_has_the_first_steps_of_a_file(late: Sequence[float], tmp_path: Path) -> None:
    rows = rows_of(late)
    wanted = of_file(rows)
    for restored in ((), (0, 1, 2, 3, 4), (6, 9)):
        found = of_stream(rows, tmp_path, restored)
        for label, xhat in wanted.items():
            assert np.isfinite(xhat).all()
            np.testing.assert_array_equal(found[label], xhat, err_msg=f"{label}, restored after {restored}")


def test_with_a_given_step_both_lose_the_filter(tmp_path: Path) -> None:
    rows = rows_of((0.0,))
    solver: Block = {"step": STEP}
    for found in (of_file(rows, solver=solver), of_stream(rows, tmp_path, solver=solver)):
        assert not np.isfinite(found["KB"]).all()
        assert np.isfinite(found["SHGO"]).all()


def test_a_sample_next_to_a_first_step_is_the_end_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where times are as far apart as a clock of many digits can tell, no step is as short as that."""
    first = 0.05 / (2 * 100.0 / 1e-4)  # of 1/rate
    rows = [(0.0, 0.0, "a", 0.8), (first * (1 + 1e-7), first * (1 + 1e-7), "a", 0.8), (0.5, 0.5, "c", 0.2)]
    monkeypatch.setattr(first_steps, "tolerances_of", lambda stretches, step: (0.0, 1e-6 * first))
    wanted, found = of_file(rows), of_stream(rows, tmp_path)
    for label, xhat in wanted.items():
        np.testing.assert_array_equal(found[label], xhat)


def test_samples_are_taken_one_by_one_while_steps_are_short(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config()))
    one, given = Estimator.load(tmp_path / "config.yaml"), source(config())
    several = Estimator(streamed(given, StatedOfData.of(given), "e"), remembered=0)  # nothing may come late
    t = np.array([0.0, 0.25 * STEP, 0.5 * STEP, 0.5, 0.75])
    taken = [int(several.at_once(t, np.zeros(5, dtype=np.int64)))]
    for k, now in enumerate(t.tolist()):
        for estimator in (one, several):
            estimator.update(now, {"a": 0.1 * k})
        taken.append(several.at_once(t[k + 1 :], np.zeros(4 - k, dtype=np.int64)))
    assert taken == [0, 0, 0, 0, 1, 0]
    for label, xhat in one.estimate().items():
        np.testing.assert_array_equal(several.estimate()[label], xhat)


def test_times_between_two_of_a_flow() -> None:
    early = Early(np.array([1.0, 2.0, 3.0]), 0.1)
    assert list(early.between(0.0, 3.5)) == [1.0, 2.0, 3.0]
    assert list(early.between(0.95, 3.05)) == [2.0]
    assert list(early.between(1.05, 1.99)) == []
    assert early.clear(0.5) == (-np.inf, 0.9)
    assert early.clear(1.0) == (np.nextafter(1.0, 0.0), 1.9)
    assert early.clear(3.5) == (np.nextafter(3.0, 0.0), np.inf)
