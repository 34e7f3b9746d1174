"""Fronts against their definition."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun.ensemble.statistics.fronts import knee, non_dominated

NUMBERS = st.one_of(st.integers(0, 4).map(float), st.just(float("inf")), st.just(float("nan")))


@pytest.mark.costly
@settings(deadline=None)
@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=12))
def test_nothing_beats_what_is_chosen(points: list[tuple[float, float, float]]) -> None:
    values = np.array(points)
    finite = [bool(np.all(np.isfinite(p))) for p in values]
    naive = [
        finite[i] and not any(f and np.all(q <= p) and np.any(q < p) for f, q in zip(finite, values, strict=True))
        for i, p in enumerate(values)
    ]
    assert non_dominated(values).tolist() == naive


def test_the_knee_of_a_hyperbola_is_its_middle() -> None:
    x = np.geomspace(0.01, 100, 41)
    front = np.column_stack([x + 1, 1 / x + 1])  # two straight arms in logarithms
    assert knee(front) == 20
    assert knee(front * np.array([1e6, 1e-9])) == 20  # units do not matter


def test_the_knee_of_few_points() -> None:
    assert knee(np.array([[1.0, 2.0]])) == 0
    assert knee(np.array([[0.0, 2.0], [0.5, 0.1], [3.0, 0.0]])) == 1


@pytest.mark.parametrize("size", [0, 1])
def test_fronts_of_next_to_nothing(size: int) -> None:
    assert non_dominated(np.ones((size, 2))).tolist() == [True] * size
