"""Points without a bound, which spare other boxes the search."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from hgorun.symbolic.enclosures import Enclosure, largest
from hgorun.symbolic.interval_operations import Bounds

LOW, HIGH = np.array([-1.0, -2.0, 0.5]), np.array([2.0, 3.0, 1.5])


def enclosure(divisor: str) -> Enclosure:
    """Of 1/divisor in x, y and z."""
    v = ca.SX.sym("v", 3)
    x, y, z = ca.vertsplit(v)
    return Enclosure(ca.Function("f", [v], [1 / eval(divisor, {"x": x, "y": y, "z": z})]))


@pytest.mark.parametrize(
    ("divisor", "on_it"),
    [
        ("x - y*z", lambda p: p[0] - p[1] * p[2]),  # a surface, which lines of all directions meet
        ("y - 1 - 0.1*x*x", lambda p: p[1] - 1 - 0.1 * p[0] ** 2),
    ],
)
def test_one_point_of_a_pole_is_found(divisor: str, on_it: Callable[[np.ndarray], float]) -> None:
    found = enclosure(divisor)
    found.find_pole(LOW, HIGH)
    ((below, above),) = found._poles
    assert abs(on_it(below)) <= 1e-15
    assert np.all(below >= LOW)
    assert np.all(above <= HIGH)
    assert found.has_pole(below - 0.01, above + 0.01)
    assert not found.has_pole(above + 0.01, above + 0.02)
    assert largest(found, below - 0.01, above + 0.01).bound == np.inf


def test_what_only_wide_boxes_hide_is_no_pole() -> None:
    """x - x + 1 is 1: bounds of it hold zero on wide boxes only."""
    found = enclosure("x - x*1.0000001 + z")
    found.find_pole(np.array([-9.0, 0.0, 0.5]), np.array([9.0, 0.0, 0.6]))
    assert found._poles == []


def test_a_surface_takes_a_look_for_each_number_and_some_for_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """64 bits of three numbers, 8 at a look, would be 24."""
    looks: list[int] = []
    real = Enclosure.__call__

    def look(self: Enclosure, low: np.ndarray, high: np.ndarray) -> Bounds:
        looks.append(len(low))
        return real(self, low, high)

    monkeypatch.setattr(Enclosure, "__call__", look)
    enclosure("x - y*z").find_pole(LOW, HIGH)
    assert len([count for count in looks if count > 1]) <= 2 + 9
