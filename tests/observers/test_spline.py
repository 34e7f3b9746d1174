"""The causal smoothing spline, against scipy's and against its linear equations."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, simulated
from scipy.interpolate import make_smoothing_spline

from hgorun.observers.spline import SmoothingSpline
from hgorun.testing import check_observer

NOISE: Block = {"noise": [{"type": "gaussian", "std": 0.1}]}


def test_contract() -> None:
    check_observer(SmoothingSpline)


@pytest.mark.parametrize("smoothing", [1e-3, 0.3])
def test_it_is_scipys_spline_of_the_samples_so_far(smoothing: float) -> None:
    times = [0.1, 0.15, 0.4, 0.55, 0.9, 1.0, 1.35, 1.4, 1.7, 1.95, 2.4, 2.5]
    plant, block = chain(2, "-x1 - 0.5*x1**3", [1, 0]), {"type": "spline", "smoothing": smoothing}
    result = simulated(plant, {"D": block}, end=2.5, output_step=0.05, step=0.01,
                       measurement={"sampling": {"times": times}, **NOISE})  # fmt: skip
    y = result.measurements.y[:, 0]
    for k in range(5, len(times)):
        spline = make_smoothing_spline(np.array(times[: k + 1]), y[: k + 1], lam=smoothing)
        expected = [spline(times[k]), spline.derivative()(times[k])]
        found = result.observers["D"].xhat[round(times[k] / 0.05)]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_a_polynomial_of_lower_degree_is_found_whatever_the_smoothing() -> None:
    plant, block = chain(3, "0", [1, -2, 0.6]), {"type": "spline", "smoothing": 1.0}
    result = simulated(plant, {"D": block}, end=3, output_step=0.1, step=0.05,
                       measurement={"sampling": {"period": 0.1}})  # fmt: skip
    np.testing.assert_allclose(result.observers["D"].xhat[-1], result.x[-1], rtol=0, atol=1e-5)
