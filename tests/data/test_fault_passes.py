"""What machine code finds in long logs, beside the same written out with numpy."""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np
import pytest

from hgorun.data.faults.fault_passes import equal_runs, gaps_above, large_steps, straight_runs
from hgorun.data.times import time_steps


def _signal(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Noise with three digits, some of it filled in, with a step of units and some uneven times."""
    drawn = np.random.default_rng(seed)
    t = np.cumsum(drawn.choice([1.0, 1.0, 1.0, 0.5, 30.0], 500))
    y = np.round(drawn.normal(size=t.size), 3)
    few = np.unique(np.append(drawn.integers(200, 400, 20), [200, 399]))
    y[200:400] = np.interp(t[200:400], t[few], y[few])
    y[450:] = 1000 * y[450:] + 273.15
    return t, y


@pytest.mark.parametrize("seed", range(5))
def test_lines_are_those_that_numpy_finds(seed: int) -> None:
    t, y = _signal(seed)
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    bends = [np.abs(y[:-2] + share * (y[2:] - y[:-2]) - y[1:-1]), np.abs(0.5 * (y[:-2] + y[2:]) - y[1:-1])]
    bend = np.where(np.abs(share - 0.5) < 0.005, np.minimum(*bends), bends[0])
    rise = np.abs(y[2:] - y[1:-1])
    exact = 1e-12 * np.maximum(np.abs(y[1:-1]), rise)
    for quantum in (0.0, 1e-3):
        straight = (bend <= np.maximum(exact, quantum)) & (rise > 1000 * exact) & (rise > 5 * quantum)
        runs = [list(run) for true, run in groupby(range(straight.size), key=straight.__getitem__) if true]
        expected = [[run[0], run[-1] + 1] for run in runs if len(run) >= 2]
        assert len(expected) > 3
        assert straight_runs(t, y, quantum, 2).tolist() == expected


@pytest.mark.parametrize("seed", range(5))
def test_large_steps_and_gaps_are_those_that_numpy_finds(seed: int) -> None:
    t, y = _signal(seed)
    small, large = np.sort(np.abs([y[:-1], y[1:]]), axis=0)
    factors, shifts = large_steps(y)
    assert factors.tolist() == (np.flatnonzero((large > 45 * small) & (small > 0)) + 1).tolist()
    assert shifts.tolist() == (np.flatnonzero(np.abs(np.abs(np.diff(y)) - 273.15) < 5) + 1).tolist()
    assert gaps_above(t, 20.0).tolist() == (np.flatnonzero(np.diff(t) > 20) + 1).tolist()
    assert factors.size
    assert gaps_above(t[:1], 1.0).size == 0


@pytest.mark.parametrize("count", [0, 1, 2, 3, 500])
def test_equal_neighbours_are_those_that_python_finds(count: int) -> None:
    values = np.random.default_rng(count).integers(0, 2, count).astype(float)
    for last in (0.0, 1.0, np.nan):
        values[-1:] = last
        ends = np.cumsum([0, *(len(list(run)) for _, run in groupby(values.tolist()))])
        expected = [[a, b] for a, b in pairwise(ends.tolist()) if b - a > 1]
        assert equal_runs(values).tolist() == expected


@pytest.mark.parametrize("kind", ["rounded", "random", "two steps", "repeated", "of two thirds"])
@pytest.mark.parametrize("count", [3001, 3002])
def test_the_median_step_of_many_times_is_that_of_numpy(kind: str, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_steps, "_MANY", 100)
    monkeypatch.setattr(time_steps, "_PIECE", 256)
    drawn = np.random.default_rng(count)
    times = {
        "rounded": 1e4 + np.round(1e-3 * np.arange(count), 3),
        "random": np.cumsum(drawn.random(count)),
        "two steps": np.cumsum(np.arange(count) % 2 + 1.0),
        "repeated": np.sort(drawn.integers(0, 500, count).astype(float)),
        "of two thirds": np.cumsum(np.where(np.arange(count) < 2000, 0.1, 5.0)),
    }[kind]
    steps = np.diff(times)
    assert time_steps.median_step(times) == np.median(steps[steps > 0])


@pytest.mark.parametrize("piece", [7, 1 << 15])
def test_the_step_of_times_with_gaps_has_no_rounding_of_theirs(piece: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_steps, "_PIECE", piece)
    for start, step, digits in ((0.0, 0.1, 1), (1.7e9, 0.01, 2), (-3.0, 0.07, 2)):
        k = np.delete(np.arange(20_000 // max(1, 1000 // piece)), [3, 5, 6, 70])
        times = np.round(start + step * k, digits)
        found = time_steps.even_step(times)
        assert np.max(np.abs(times[0] + k * found - times)) <= 2 * np.spacing(np.max(np.abs(times)))
    for uneven in ([0.0, 1.0, 2.0, 4.5, 5.5], [0.0, 1.0, 2.0 + 1e-9, 3.0, 5.0], [2.0, 2.0, 2.0, 2.0]):
        times = np.array(uneven)
        np.testing.assert_equal(time_steps.even_step(times), time_steps.median_step(times))
