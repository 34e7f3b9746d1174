"""Enclosures against sampling and closed forms: never too narrow, and tight where they can be."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgorun.config.expressions import parse
from hgorun.symbolic.enclosures import Enclosure, largest

TEXTS = [
    "sin(x)*y + cos(x*y)",
    "tanh(x*y) - x/(3 + y**2)",
    "exp(-x**2)*y**3",
    "abs(x - y) + sign(x)*y",
    "min(x, y)*max(x, 0.3)",
    "where(x > 0.2, x, y)",
    "where((x > 0 and y < 0) or not (x <= y), x*y, 1 + x)",
    "sqrt(1 + x**2 + y**2)",
    "log(4 + x + y)*atan(x)",
    "asin(x/4) + acos(y/4)",
    "cosh(x) - sinh(y)",
    "tan(x/3)",
    "(x - 4)**-2",
    "(4 + x)**0.5",
    "(4 + x)**y",
    "floor(x) + ceil(y)",
    "atan2(x, y)",
    "1/x",
    "x**2 - x*x",
]
corner = st.floats(-3, 3)


def function(text: str) -> ca.Function:
    x = ca.SX.sym("x", 2)
    return ca.Function("f", [x], [parse(text, names=("x", "y")).symbol({"x": x[0], "y": x[1]})])


@pytest.mark.measured("(4 + x)**y")
@pytest.mark.slow
@pytest.mark.parametrize("text", TEXTS)
@given(st.tuples(corner, corner, corner, corner))
def test_no_value_lies_outside(text: str, corners: tuple[float, float, float, float]) -> None:
    ends = np.sort(np.array(corners).reshape(2, 2), axis=0)
    enclosure = Enclosure(function(text))
    low, high = enclosure(ends[:1], ends[1:])
    inside = ends[0] + (ends[1] - ends[0]) * np.random.default_rng(1).random((200, 2))
    points = np.vstack([inside, ends, [[ends[0, 0], ends[1, 1]], [ends[1, 0], ends[0, 1]]]])
    values = enclosure.at(points)
    values = values[np.isfinite(values)]
    assert np.all(values >= low)
    assert np.all(values <= high)


@pytest.mark.parametrize(
    ("text", "box", "expected"),
    [
        ("sin(x)", ((0.0, 1.0), (0, 0)), np.sin(1)),
        ("sin(x)", ((0.0, 2.0), (0, 0)), 1.0),
        ("sin(x)", ((4.0, 5.0), (0, 0)), 1.0),
        ("cos(x)", ((1.0, 2.0), (0, 0)), np.cos(1)),
        ("1 - tanh(x)**2", ((-1.0, 2.0), (0, 0)), 1.0),
        ("x*(1 - x)", ((0.0, 1.0), (0, 0)), 0.25),
        ("x*y - y", ((0.0, 3.0), (-2, 1)), 4.0),
        ("x**3 - x", ((-1.0, 1.0), (0, 0)), 2 / 3**1.5),
    ],
)
def test_cutting_a_box_finds_the_largest_value(
    text: str, box: tuple[tuple[float, float], ...], expected: float
) -> None:
    low, high = (np.array(side, dtype=float) for side in zip(*box, strict=True))
    found = largest(Enclosure(function(text)), low, high)
    assert found.reached <= expected * (1 + 1e-12)
    assert found.bound >= expected * (1 - 1e-12)
    assert found.bound <= 1.011 * expected


def test_a_pole_in_the_box_has_no_bound() -> None:
    assert largest(Enclosure(function("1/x")), np.array([-1.0, 0.0]), np.array([1.0, 0.0])).bound == np.inf


def test_a_pole_is_found_once_and_for_all() -> None:
    """Of a box that holds it nothing is known, however it is cut; of others all that was known before."""
    enclosure = Enclosure(function("x*y/(x**2 - 2)"))
    low, high = np.array([-1.0, -2.0]), np.array([1.7, 2.5])
    assert not enclosure.has_pole(low, high)
    assert largest(enclosure, low, high).bound == np.inf
    assert enclosure.has_pole(low, high)
    assert enclosure.has_pole(np.array([1.4142135, -2.0]), np.array([1.4142136, 2.5]))  # to the last digits
    assert not enclosure.has_pole(np.array([1.5, -2.0]), high)
    assert largest(enclosure, low, high).bound == np.inf
    inside, fresh = (
        largest(one, np.array([1.5, 1.0]), np.array([1.7, 2.5])) for one in (enclosure, Enclosure(enclosure.function))
    )
    assert (inside.bound, inside.reached) == (fresh.bound, fresh.reached)
    assert inside.reached <= 1.5 * 2.5 / 0.25 <= inside.bound


def test_a_pole_is_looked_for_where_that_of_other_constants_is() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")

    def of(k: float) -> Enclosure:
        return Enclosure(ca.Function("f", [ca.vertcat(x, y)], [y / (x - k)]))

    low, high = np.array([0.0, 1.0]), np.array([2.0, 3.0])
    assert not of(1.2).has_pole(low, high)
    assert largest(of(1.2), low, high).bound == np.inf
    assert of(1.201).has_pole(low, high)
    assert not of(1.3).has_pole(low, high)  # it is somewhere else
    assert not of(2.001).has_pole(low, high)  # outside, if near the edge
    assert largest(of(2.5), low, high).bound == pytest.approx(3 / 0.5, rel=0.02)
    assert largest(of(1.3), low, high).bound == np.inf


@pytest.mark.costly
@pytest.mark.parametrize("text", ["x*y", "x - y", "1/(x + 4)", "x**3 + y", "sin(x) + cos(y)"])
def test_many_boxes_are_rounded_like_one(text: str) -> None:
    """Numbers that are counted through by their bits end where nextafter takes them: zero and infinity are not."""
    ends = np.random.default_rng(3).uniform(-3, 3, (2, 500, 2))
    ends[:, :4] = np.array([0.0, -0.0, 1e-310, 3.0])[None, :, None]
    ends.sort(axis=0)
    enclosure = Enclosure(function(text))
    for low, high in (ends, ends[:, 4:]):
        together = enclosure(low, high)
        alone = [enclosure(low[k : k + 1], high[k : k + 1]) for k in range(len(low))]
        np.testing.assert_array_equal(np.array(together), np.hstack(alone))


def test_a_function_of_nothing() -> None:
    found = largest(Enclosure(function("0.5 - 3")), np.zeros(2), np.ones(2))
    assert found.bound == found.reached == 2.5
