"""Means along segments, enclosed: the bits of interval arithmetic, and closed forms between them."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from hgorun.analysis.convergence.segments import _PARTS, _means, _parts
from hgorun.memo import Memo
from hgorun.symbolic import segment_means
from hgorun.symbolic.enclosures import Enclosure
from hgorun.symbolic.segment_means import Form, SegmentMeans, can_be_compiled

A, B, C = (ca.SX.sym(name) for name in "abc")
COUNT = 13  # boxes: no multiple of those in a group
COMPILED = [
    *(A, C, ca.SX(3.5), A + B, A - C, A * B, A / B, 1 / A, -A, A + A, A**2, A**3, A**-2, A**-3, ca.fabs(A)),
    *(ca.sqrt(A), ca.fmin(A, B), ca.fmax(A, C), ca.exp(A), ca.log(B), ca.tanh(A), ca.atan(C)),
    A * ca.exp(C) / (1 + B**2),
]  # fmt: skip


def enclosure(*values: ca.SX) -> Enclosure:
    return Enclosure(ca.Function("f", [ca.vertcat(A, B, C)], [ca.densify(ca.vertcat(*values))]))


def compiled(of: Enclosure) -> SegmentMeans:
    return SegmentMeans(Form(of.instructions, 2, 1, of.function.numel_out(0), _PARTS))


@pytest.fixture
def nothing_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_means, "_CODE", Memo[object](4))


def boxes(seed: int, width: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """At both ends of the segments, and of what stays."""
    draw = np.random.default_rng(seed)
    lows = [draw.normal(1.0, 1.0, (COUNT, columns)) for columns in (2, 2, 1)]
    return [(low, low + draw.uniform(0, width, low.shape)) for low in lows]


def rows(found: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    return np.vstack([side.T for box in found for side in box])


@pytest.mark.parametrize("width", [0.0, 0.5])
def test_they_have_the_bits_of_interval_arithmetic(width: float) -> None:
    of, (first, second, common) = enclosure(*COMPILED), boxes(1, width)
    assert can_be_compiled(of.instructions)
    expected = _means(of, _parts(first, second), [(common[0][:, 0], common[1][:, 0])])
    for one, other in zip(compiled(of)(rows([first, second, common])), expected, strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.isinf(expected[0]).any()  # some quotients have no bound


@pytest.mark.parametrize(
    ("value", "mean"),
    [
        (ca.exp(A), lambda a, b: (np.exp(b) - np.exp(a)) / (b - a)),
        (A**3, lambda a, b: (a + b) * (a**2 + b**2) / 4),
        (A * C, lambda a, b: (a + b) / 2 * 0.75),
    ],
)
def test_they_hold_the_mean_itself(value: ca.SX, mean: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> None:
    first, second, _ = boxes(2, 0.0)
    whole = np.full((COUNT, 1), 0.75)
    low, high = compiled(enclosure(value))(rows([first, second, (whole, whole)]))
    exact = mean(first[0][:, 0], second[0][:, 0])
    assert np.all(low[:, 0] < exact)
    assert np.all(exact < high[:, 0])
    largest = np.max(high - low)
    assert 0 < largest < 2


@pytest.mark.parametrize("value", [ca.sin(A), A**B, A**0.5 * ca.sign(B)])
def test_what_is_not_compiled_is_told(value: ca.SX) -> None:
    assert not can_be_compiled(enclosure(value).instructions)


@pytest.mark.parametrize("count", [1, COUNT])
def test_boxes_alone_have_the_same_bits(count: int, nothing_compiled: None) -> None:
    of = enclosure(*COMPILED)
    low = np.random.default_rng(3).normal(0.0, 2.0, (count, 3))
    expected = of.each(low, low + 0.3)
    assert of.compile()
    assert not of.compile()
    for one, other in zip(of.each(low, low + 0.3), expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_code_is_shared_by_functions_that_differ_in_constants_only(nothing_compiled: None) -> None:
    def of(k: float, exponent: int = 3) -> Enclosure:
        return enclosure(k * A**exponent + B / (k + 2.5), ca.SX(k))

    first, other = of(1.5), of(0.1)
    low = np.random.default_rng(4).normal(0.0, 2.0, (COUNT, 3))
    expected = other.each(low, low + 0.3)
    first.compile()
    assert other.compiled() is not None
    for one, exact in zip(other.each(low, low + 0.3), expected, strict=True):
        np.testing.assert_array_equal(one, exact)
    np.testing.assert_array_equal(first.each(low, low)[0][:, 1], 1.5)
    np.testing.assert_array_equal(other.each(low, low)[0][:, 1], 0.1)
    assert of(0.1, 5).compiled() is None  # how often it is multiplied is part of the code
    assert of(0.0).compiled() is None  # so is what CasADi leaves out
