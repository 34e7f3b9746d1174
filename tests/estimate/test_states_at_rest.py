"""An estimate that rests at zero has no size, and its rounding is no error of the steps."""

from __future__ import annotations

import numpy as np
import pytest
from examples import inline
from recordings import recording, signal, source

from hgorun.estimate.carrying import relative_error
from hgorun.estimate.estimate import estimate


def test_derivatives_of_a_constant_are_exact() -> None:
    """Zero, but for rounding below 1e-20, by which two passes differ."""
    plant = inline({"x": "v", "v": "-x - 0.2*v"}, "x")
    text = {"plant": plant, "observers": {"s": {"type": "savgol", "window": 5}}}
    taken = 0.1 * np.arange(40)
    found = estimate(source(text), recording(signal("x", taken, np.full(40, 0.5))), sensitivity=False)
    np.testing.assert_allclose(found.observers["s"].xhat, [[0.5, 0.0]] * len(found.time), rtol=0, atol=1e-15)
    assert found.observers["s"].xhat[:, 1].any()
    assert found.status == "ok"
    assert (found.integration_error or {})["s"] < 1e-15


@pytest.mark.parametrize(
    ("sizes", "gaps", "error"),
    [
        ([2.0, 1e-25], [0.0, 1e-25], 5e-17),  # over 1e-9 of 2
        ([2.0, 1e-8], [0.0, 1e-9], 0.1),  # small, and not at rest
        ([2.0, 0.5], [0.1, 0.05], 0.1),
        ([0.0, 0.0], [0.0, 0.0], 0.0),
        ([np.inf, 1.0], [0.0, 0.5], 0.0),  # lost
    ],
)
def test_differences_count_over_the_size_of_what_moves(sizes: list[float], gaps: list[float], error: float) -> None:
    (found,) = relative_error(1.0, np.array([sizes]), np.array([gaps]))
    assert found == pytest.approx(error, rel=1e-12)
