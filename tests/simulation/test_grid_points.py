"""Points of a grid that are made when they are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from examples import inline

from hgorun import simulate
from hgorun.simulation.timeline.grid import EvenPoints


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
