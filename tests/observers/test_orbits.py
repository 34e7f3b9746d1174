"""Orbits with steps of their own: beside closed forms, with kinks on the way."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.observers.orbits import Escaped, followed


def test_orbits_are_right_where_each_has_its_kink_elsewhere() -> None:
    """y' = 1 up to y = 1, and -3 (y - 1) + 1 behind it; one starts behind it, one never comes there."""
    start = np.array([0.0, 0.3, 0.9, 2.0, -9.0])

    def exact(t: float) -> np.ndarray:
        behind = np.maximum(t - np.maximum(1 - start, 0.0), 0.0)
        excess = np.maximum(start - 1, 0.0)
        return np.where(behind > 0, 4 / 3 + (excess - 1 / 3) * np.exp(-3 * behind), start + t)

    def rate(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(y < 1, 1.0, 1 - 3 * (y - 1))

    times = np.array([0.4, 0.7, 2.5])
    for t, y in zip(times, followed(rate, start[:, None], times, 1e-10, 1000), strict=True):
        np.testing.assert_allclose(y[:, 0], exact(float(t)), rtol=0, atol=1e-8)


def test_time_is_that_of_each_orbit() -> None:
    """y' = y cos t."""
    start = np.array([[1.0], [1e3], [0.01]])
    (y,) = followed(lambda t, y: y * np.cos(t)[:, None], start, np.array([3.0]), 1e-11, 1000)
    np.testing.assert_allclose(y, start * np.exp(np.sin(3.0)), rtol=1e-8)


@pytest.mark.parametrize(("most", "near"), [(10_000, 1e-6), (30, 0.3)], ids=["short steps", "many steps"])
def test_an_orbit_that_escapes_is_told(most: int, near: float) -> None:
    """y' = y^2 from 2 reaches infinity at 1/2; from -2 it does not."""
    with pytest.raises(Escaped) as caught:
        list(followed(lambda t, y: y**2, np.array([[-2.0], [2.0]]), np.array([1.0]), 1e-10, most))
    np.testing.assert_array_equal(caught.value.x, [2.0])
    assert caught.value.after == pytest.approx(0.5, rel=near)
