"""The built-in metrics in machine code: the bits of the records, which are plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun.result.evaluation import columns
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.evaluation.measure import by_records, measure
from hgorun.result.metrics.base import all_metrics
from hgorun.result.windows import MetricSettings


@pytest.mark.costly
@given(
    points=st.integers(2, 300),
    states=st.integers(2, 4),
    observers=st.integers(1, 5),
    bounds=st.tuples(*[st.floats(-0.5, 30) for _ in range(4)]),
    average=st.floats(0.05, 3),
    part=st.floats(0.01, 1.5),
    scale=st.sampled_from([1e-200, 1e-3, 1.0, 1e6]),
    seed=st.integers(0, 2**32),
)
@settings(max_examples=100)
def test_they_have_the_bits_of_the_records(
    points: int,
    states: int,
    observers: int,
    bounds: tuple[float, ...],
    average: float,
    part: float,
    scale: float,
    seed: int,
) -> None:
    random = np.random.default_rng(seed)
    t, x = 0.1 * np.arange(points), scale * random.normal(size=(points, states))
    xhat = x[:, None] + scale * random.normal(size=(points, observers, states)) * np.exp(-t)[:, None, None]
    (a, b), (c, d) = sorted(bounds[:2]), sorted(bounds[2:])
    s = MetricSettings((a, b), (c, d), average, part)
    found = columns.measured(t, Estimated.same(x, xhat.shape[1]), Estimated.of_stack(xhat), s)
    with np.errstate(all="ignore"):
        expected = by_records(t, x[:, None], xhat, s, tuple(all_metrics().values()))
    if found is None:  # a window without points
        assert np.isnan(expected["sup"]).all() or np.isnan(expected["peak"]).all()
        return
    for metric, values in found.items():
        np.testing.assert_array_equal(values, expected[metric.name])


def test_they_are_the_built_in_ones() -> None:
    t, x = 0.1 * np.arange(50), np.random.default_rng(1).normal(size=(50, 2))
    settings = MetricSettings((1.0, 4.9), (0.0, 1.0), 0.3, 0.05)
    found = columns.measured(t, Estimated.same(x, 1), Estimated.of_stack(x[:, None] + 1), settings)
    assert found is not None
    assert {metric.name: metric for metric in found} == all_metrics()


def test_what_is_not_finite_is_left_to_the_records() -> None:
    t, x = 0.1 * np.arange(50), np.random.default_rng(1).normal(size=(50, 2))
    s = MetricSettings((1.0, 4.9), (0.0, 1.0), 0.3, 0.05)
    for bad in (np.nan, np.inf, -np.inf):
        for row in (0, 20, 49):
            xhat = np.stack([x + 1, x + 2], axis=1)
            xhat[row, 0, 1] = bad
            assert columns.measured(t, Estimated.same(x, xhat.shape[1]), Estimated.of_stack(xhat), s) is None
            found = measure(t, x, {"lost": xhat[:, 0], "good": xhat[:, 1]}, s)
            assert all(np.all(np.isinf(values)) for values in found["lost"].values())
            np.testing.assert_equal(found["good"], measure(t, x, {"good": x + 2}, s)["good"])
