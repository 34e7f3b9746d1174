"""Points of a grid that are made when they are asked for."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.simulation.timeline.grid import EvenPoints


@pytest.mark.parametrize(("step", "every"), [(1e-3, 1), (1 / 3, 7), (0.1, 3), (1e-300, 2)])
def test_points_are_those_of_the_whole(step: float, every: int) -> None:
    whole = (np.arange(2000.0) * step)[::every]
    points = EvenPoints(whole.size, step, every)
    for some in (slice(None), slice(0, 0), slice(13, 41), slice(200, None), slice(whole.size, None)):
        np.testing.assert_array_equal(points[some], whole[some])
    for sought in (*whole, *np.nextafter(whole, np.inf), *np.nextafter(whole, -np.inf), -1.0, 0.55 * step, 3000 * step):
        assert points.before(sought) == np.searchsorted(whole, sought)
