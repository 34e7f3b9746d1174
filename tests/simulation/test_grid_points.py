"""Points of a grid that are made when they are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from examples import inline

from hgorun import simulate
from hgorun.config.models import Metrics, Time
from hgorun.ensemble.collected.collected import last_point
from hgorun.result.windows import MetricSettings, points_in
from hgorun.simulation.timeline.grid import EvenPoints, grid_of


@pytest.mark.parametrize(("step", "every"), [(1e-3, 1), (1 / 3, 7), (0.1, 3), (1e-300, 2)])
def test_points_are_those_of_the_whole(step: float, every: int) -> None:
    whole = (np.arange(2000.0) * step)[::every]
    points = EvenPoints(whole.size, step, every)
    for some in (slice(None), slice(0, 0), slice(13, 41), slice(200, None), slice(whole.size, None)):
        np.testing.assert_array_equal(points[some], whole[some])
    for sought in (*whole, *np.nextafter(whole, np.inf), *np.nextafter(whole, -np.inf), -1.0, 0.55 * step, 3000 * step):
        assert points.before(sought) == np.searchsorted(whole, sought)


def test_points_are_at_listed_samples_on_a_clock_of_long_ago() -> None:
    """Times since then are rounded by 1e-10, much more than a part of a step."""

    def of(start: float) -> np.ndarray:
        times = [round(start + 0.1 * k, 1) for k in range(30)]
        found = simulate(
            {
                "time": {"start": start, "end": start + 3, "output_step": 0.1},
                "plant": inline({"x": "v", "v": "-x"}, "x", initial={"x": 1, "v": 0}),
                "observers": {"O": {"type": "ekf", "q": 1, "initial": {"x": 0.5}}},
                "measurement": {"noise": [{"type": "gaussian", "std": 0.1}], "sampling": {"times": times}},
                "solver": {"step": 0.01},
            }
        )
        return found.observers["O"].xhat

    np.testing.assert_allclose(of(1e6), of(0.0), rtol=0, atol=1e-8)


FAR = [0.0, 1e6, 1e8, 1.7e9, -1.7e9, 0.123 + 1.7e9]
LENGTHS = [(0.1, 103), (0.1, 100), (0.3, 11), (0.01, 70), (0.07, 5), (0.3, 1), (1e-3, 1000)]


@pytest.mark.parametrize("start", FAR)
@pytest.mark.parametrize(("step", "count"), LENGTHS)
def test_a_grid_far_from_0_has_its_last_point(start: float, step: float, count: int) -> None:
    """The difference of two times of a clock is rounded by more than a billionth of a step."""
    end = start + step * count
    for metrics in (Metrics(), Metrics(record=step / 2)):
        points, of_output, of_metrics = grid_of(
            Time(start=start, end=end, output_step=step), metrics, states=2, observers=1
        )
        assert (points[::of_output].size, of_metrics) == (count + 1, 1)
        assert start + points[-1] == pytest.approx(end, abs=4 * np.spacing(abs(end)) + 1e-12 * end)
    assert last_point(start, end, step) > end - 0.01 * step


@pytest.mark.parametrize("start", FAR)
def test_a_grid_far_from_0_ends_before_a_point_that_is_not_reached(start: float) -> None:
    points, _, _ = grid_of(Time(start=start, end=start + 10.29, output_step=0.1), Metrics(), states=2, observers=1)
    assert points.size == 103


@pytest.mark.parametrize("start", FAR)
def test_a_window_far_from_0_has_the_points_at_its_ends(start: float) -> None:
    points = 0.1 * np.arange(104)
    for low, high in ((34, 103), (33, 67), (3, 6)):
        window, whole = (start + 0.1 * low, start + 0.1 * high), Time(start=start, end=start + 10.3, output_step=0.1)
        since = MetricSettings.of(Metrics(window=window, transient=window), whole).since(start)
        assert points_in(points, since.steady) == points_in(points, since.transient) == slice(low, high + 1)
        assert points_in(start + points, window) == slice(low, high + 1)
        for off in (-1, 1):  # a window as somebody writes it, with another rounding
            moved = window[0] + off * np.spacing(window[0]), window[1] + off * np.spacing(window[1])
            assert points_in(start + points, moved) == slice(low, high + 1)


def test_metrics_far_from_0_are_those_of_the_same_run_at_0() -> None:
    def of(start: float) -> list[float]:
        found = simulate(
            {
                "time": {"start": start, "end": start + 10.3, "output_step": 0.1},
                "plant": inline({"x": "v", "v": "-x"}, "x", initial={"x": 1, "v": 0}),
                "observers": {"O": {"type": "shgo", "theta": 2}},
                "metrics": {"window": [start + 3.4, start + 10.3], "transient": [start, start + 0.3]},
                "solver": {"step": 0.02},
            }
        )
        metrics = found.metrics()["O"]
        return [*metrics["rmse"].values(), *metrics["peak"].values()]

    assert of(1.7e9) == pytest.approx(of(0.0), rel=1e-6)
