"""Where a curve passes what is narrow in its states: what is found, and what is not searched for."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from hgorun.symbolic import features
from hgorun.symbolic.crossings import Search, TooMany
from hgorun.symbolic.curves import Curve
from hgorun.symbolic.features import Feature
from hgorun.symbolic.narrow import features_of

CELLS, NONE = 200, np.zeros(0)


def reciprocal_of_determinant(size: int) -> Feature:
    """The feature of 1/det of a matrix whose entries are the states."""
    t, p, w = ca.SX.sym("t"), ca.SX.sym("p", 0), ca.SX.sym("w", 0)
    z = ca.SX.sym("z", size * size)
    function = ca.Function("f", [t, p, z, w], [1 / ca.det(ca.reshape(z, size, size))])
    return max(features_of([function], range(size * size)), key=lambda f: len(f.states))


def along(entries: Callable[[np.ndarray], np.ndarray]) -> Curve:
    """The curve of matrices (N, size, size) at times (N,) from 0 to 1."""
    edges = np.linspace(0, 1, CELLS + 1)
    times = edges[:-1, None] + np.array([0, 1, 2, 3]) / 3 * np.diff(edges)[:, None]
    states = np.swapaxes(entries(times.ravel()), 1, 2).reshape(CELLS, 4, -1)
    return Curve.through(edges[:-1], edges[1:], states)


def rotating(t: np.ndarray) -> np.ndarray:
    """Large entries that cancel: the determinant is 2."""
    turn, shear = 20 * t, 12 + 4 * np.sin(9 * t)
    c, s, one, zero = np.cos(turn), np.sin(turn), np.ones_like(t), np.zeros_like(t)
    first = np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]).transpose(2, 0, 1)
    second = np.array([[one, shear, shear**2], [zero, 2 * one, shear], [zero, zero, one]]).transpose(2, 0, 1)
    return np.asarray(np.swapaxes(second, 1, 2) @ first @ second)


def test_what_only_seems_to_come_near_zero_is_not_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        raise AssertionError("cells are cut in two")

    feature, curve = reciprocal_of_determinant(3), along(rotating)
    (low, high), _ = feature.argument.bounds(curve.low, curve.high, NONE, feature._cells(curve))
    assert np.mean((low < 0) & (high > 0)) > 0.9  # interval arithmetic alone tells next to nothing
    monkeypatch.setattr(Search, "between", never)
    assert feature.found(curve, NONE).size == 0


@pytest.mark.parametrize("least", [1e-12, 1e-9, 1e-7])
def test_a_determinant_that_is_small_for_a_moment(least: float) -> None:
    at = 0.3713

    def entries(t: np.ndarray) -> np.ndarray:
        s, root = t - at, np.full_like(t, np.sqrt(least))
        return np.array([[s, -root], [root, s]]).transpose(2, 0, 1)

    found = reciprocal_of_determinant(2).found(along(entries), NONE)
    np.testing.assert_allclose(found, [at], atol=1e-12)


def test_a_search_that_would_take_too_long_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(features, "_WORK", 1e4)
    monkeypatch.setattr(features, "_TAIL", 1e9)  # nothing is left out
    with pytest.raises(TooMany):
        reciprocal_of_determinant(3).found(along(rotating), NONE)
