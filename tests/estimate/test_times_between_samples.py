"""What is asked of times, one after the other or anywhere, beside loops over all samples."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.estimate.scores.bands import Band, since_last
from hgorun.estimate.scores.evaluated import first_undefined
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.steps import count_steps

TAKEN = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 200))
TIMES = {
    "of samples": TAKEN[20:150].copy(),
    "of all": TAKEN.copy(),
    "between": TAKEN[5:120] + 0.2,
    "some before": np.linspace(-2.0, 250.0, 301),
    "none": np.zeros(0),
}


@pytest.mark.parametrize("name", TIMES)
@pytest.mark.parametrize("before", [False, True])
def test_the_time_since_the_newest_sample(name: str, *, before: bool) -> None:
    expected = []
    for t in TIMES[name]:
        known = [one for one in TAKEN if (one < t if before else one <= t)]
        expected.append(t - known[-1] if known else np.inf)
    assert since_last(TIMES[name], TAKEN, TAKEN, before=before).tolist() == expected


@pytest.mark.parametrize("ages", [[0.0, 0.1], [0.1, 0.2], [0.0, 0.3, 2.0, np.inf]])
def test_a_band_is_as_wide_as_its_class(ages: list[float]) -> None:
    band = Band(np.array([0.1, 1.0]), np.array([3.0, 4.0, 5.0]))
    expected = [3.0 if age <= 0.1 else 4.0 if age <= 1.0 else 5.0 for age in ages]
    assert band.at(np.array(ages)).tolist() == expected
    assert Band(np.zeros(0), np.array([2.0])).at(np.array(ages)).tolist() == [2.0] * len(ages)


@pytest.mark.parametrize(("slope", "held"), [(0.0, True), (0.0, False), (0.5, False)])
def test_a_recorded_input_is_on_its_line(slope: float, *, held: bool) -> None:
    times, levels = np.array([0.0, 1.0, 3.0]), np.array([4.0, -1.0, 2.0])
    inputs = RecordedInputs(times, levels[:, None], np.full((3, 1), slope), held=held)
    set_in_turn = [4.0, -1.0, 2.0] if held else [4.0, slope, 0.0, -1.0, slope, 1.0, 2.0, slope, 3.0]
    assert np.concatenate(inputs.values([], before=False)).tolist() == set_in_turn
    moments = np.array([0.0, 0.5, 1.0, 2.0, 3.0, 7.0])
    since, level = np.array([0.0, 0.5, 0.0, 1.0, 0.0, 4.0]), np.array([4.0, 4.0, -1.0, -1.0, 2.0, 2.0])
    assert inputs.at(moments)[:, 0].tolist() == (level + slope * since).tolist()
    assert inputs.at(times)[:, 0].tolist() == levels.tolist()


def test_short_gaps_take_a_step_each_and_others_as_many_as_they_need() -> None:
    assert count_steps(np.array([0.2, 1.0, 0.5]), 1.0).tolist() == [1, 1, 1]
    assert count_steps(np.array([0.2, 2.5, 1.0]), 1.0).tolist() == [1, 3, 1]
    assert count_steps(np.zeros(0), 1.0).tolist() == []


@pytest.mark.parametrize(("row", "column"), [(3, 0), (5, 1), (None, 0)])
def test_an_estimate_ends_where_one_of_its_states_does(row: int | None, column: int) -> None:
    grid, xhat = np.arange(8) / 4, np.ones((8, 5))[:, 1:4]  # some states of a row
    if row is not None:
        xhat[row, column] = np.inf
        xhat[row + 1, 2] = np.nan
    assert first_undefined(grid, xhat) == (np.inf if row is None else grid[row])
