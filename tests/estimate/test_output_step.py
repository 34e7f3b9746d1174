"""The points of an estimate show how it moves between few samples, and change nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from examples import inline
from recordings import recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.steps.output_step import output_step


@pytest.mark.parametrize(
    ("gap", "span", "parts"),
    [(1.0, 100.0, 1), (1.0, 99.0, 2), (0.1, 12.3, 1), (0.5, 4.0, 20), (1.4, 3.0, 49), (3600.0, 86400.0, 5)],
)
def test_a_gap_of_few_samples_is_divided_so_that_the_end_is_a_point(gap: float, span: float, parts: int) -> None:
    step = output_step(gap, span)
    assert step == gap / parts
    if parts > 1:
        assert span / step == pytest.approx(round(span / step), abs=1e-9)


@pytest.mark.parametrize(("gap", "span"), [(math.nan, 3.0), (10.0, 3.0), (2.718, 100.0), (7.1, 93.7)])
def test_a_run_is_divided_where_no_gap_or_no_part_of_it_is(gap: float, span: float) -> None:
    intervals = span / output_step(gap, span)
    assert intervals == pytest.approx(round(intervals), abs=1e-9)
    assert 100 <= round(intervals) <= 200


def test_a_grid_of_metrics_keeps_the_gap_as_its_multiple() -> None:
    assert output_step(1.4, 3.0, least=1) == 1.4


SWING = inline({"a": "b", "b": "-9*a"}, "a")


@pytest.mark.parametrize("taken", [[1.5], [0.1, 1.5, 2.9]])
def test_few_samples_hide_no_motion_and_the_points_change_no_estimate(taken: list[float]) -> None:
    log = recording(signal("a", taken, [-0.2, 0.4, 0.3][: len(taken)]))
    config = {
        "plant": SWING,
        "observers": {"o": {"type": "ekf", "Q": {"b": 0.01}, "R": 0.0025, "initial": {"a": 1.0, "b": 0.0}}},
    }
    runs = [
        estimate(source(config | {"time": {"start": 0.0, "end": 3.0} | step}), log, sensitivity=False)
        for step in ({}, {"output_step": 1.5}, {"output_step": 0.003})
    ]
    found = runs[0]
    assert found.time.size > 100
    assert found.time[-1] == pytest.approx(3.0, abs=1e-14)
    before = found.time < taken[0]
    np.testing.assert_allclose(found.observers["o"].xhat[before, 0], np.cos(3 * found.time[before]), atol=1e-8)
    for other in runs[1:]:
        np.testing.assert_array_equal(found.observers["o"].xhat[-1], other.observers["o"].xhat[-1])
        here, there = (recorded_of(one).outputs["a"].innovation for one in (found, other))
        np.testing.assert_array_equal(here, there)
