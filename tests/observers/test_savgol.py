"""The Savitzky-Golay differentiator, against scipy's weights and numpy's least squares."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, simulated, sinusoid
from scipy.signal import savgol_coeffs

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.savgol import SavitzkyGolayFilter
from hgorun.testing import check_observer

PLANT = chain(2, "-x1 - 0.5*x1**3", [1, 0])
NOISE: Block = {"noise": [{"type": "gaussian", "std": 0.1}]}


@pytest.mark.costly
def test_contract() -> None:
    check_observer(SavitzkyGolayFilter)


def test_weights_are_those_of_scipy() -> None:
    block = {"type": "savgol", "window": 11, "degree": 3, "initial": {"x1": 7}}
    result = simulated(PLANT, {"D": block}, end=5, output_step=0.1, step=0.05,
                       measurement={"sampling": {"period": 0.1}, **NOISE})  # fmt: skip
    xhat, y = result.observers["D"].xhat, result.measurements.y[:, 0]
    for deriv in (0, 1):
        weights = savgol_coeffs(11, 3, deriv=deriv, delta=0.1, pos=10, use="dot")
        expected = [weights @ y[k - 10 : k + 1] for k in range(10, 51)]
        np.testing.assert_allclose(xhat[10:, deriv], expected, rtol=0, atol=1e-9)
    assert np.all(xhat[:3] == [7, 0])


def test_samples_at_any_times_and_a_window_that_fills() -> None:
    times = [0.1, 0.15, 0.4, 0.55, 0.9, 1.0, 1.35, 1.4, 1.7, 1.95]
    block = {"type": "savgol", "window": 6, "degree": 2}
    result = simulated(PLANT, {"D": block}, end=2, output_step=0.05, step=0.01,
                       measurement={"sampling": {"times": times}, **NOISE})  # fmt: skip
    y = result.measurements.y[:, 0]
    for k, t in enumerate(times):
        row = result.observers["D"].xhat[round(t / 0.05)]
        past = slice(max(k - 5, 0), k + 1)
        if k < 2:
            assert np.all(row == 0)
        else:
            c = np.polynomial.polynomial.polyfit(np.array(times[past]) - t, y[past], 2)
            np.testing.assert_allclose(row, c[:2], rtol=0, atol=1e-9)


def test_late_samples_are_put_where_they_belong() -> None:
    """All samples of a polynomial are in the window at the end: it is found whatever the order of arrival."""
    plant = chain(2, "0.6", [1, -2])
    block = {"type": "savgol", "window": 8}
    result = simulated(plant, {"D": block}, end=2, output_step=0.1, step=0.05,
                       measurement={"sampling": {"period": 0.1}, "delay": "0.2 + 0.15*sin(30*t)"})  # fmt: skip
    taken = np.nanmax(result.measurements.taken)
    np.testing.assert_allclose(result.observers["D"].xhat[-1, 1], -2 + 0.6 * taken, rtol=0, atol=1e-8)


def test_samples_at_fewer_times_than_coefficients_leave_the_estimate() -> None:
    """Late samples of the first moments were all taken at the start."""
    block = {"type": "savgol", "window": 8, "initial": {"x1": 3}}
    result = simulated(PLANT, {"D": block}, end=1, output_step=0.1, step=0.03,
                       measurement={"sampling": {"period": 0.1}, "delay": "0.2", **NOISE})  # fmt: skip
    xhat = result.observers["D"].xhat
    assert np.all(xhat[:4] == [3, 0])
    assert np.all(np.abs(xhat[4:, 0] - 1) < 0.5)


@pytest.mark.costly
@pytest.mark.parametrize("block", [{"type": "savgol", "window": 5}, {"type": "spline", "smoothing": 1e-3}])
def test_a_continuous_output_is_measured_at_the_steps(block: Block) -> None:
    options = {"end": 1, "output_step": 0.1, "step": 0.02}
    continuous = simulated(PLANT, {"D": block}, measurement={"noise": sinusoid(0.02, 7)}, **options)
    sampled = simulated(PLANT, {"D": block}, measurement={"sampling": {"period": 0.02}, "noise": sinusoid(0.02, 7)},
                        **options)  # fmt: skip
    np.testing.assert_allclose(continuous.observers["D"].xhat, sampled.observers["D"].xhat, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("block", "measurement", "message"),
    [
        ({"window": 5, "degree": 0}, {"sampling": {"period": 0.1}}, "2 states take derivatives up to 1"),
        ({"window": 3, "degree": 3}, {"sampling": {"period": 0.1}}, "takes 4 samples or more"),
        ({"window": 5}, {}, "solver.step: .* are its period: give a number"),
    ],
)
def test_what_does_not_fit_is_refused(block: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(PLANT, {"D": {"type": "savgol"} | block}, measurement=measurement))


@pytest.mark.costly
def test_the_state_is_found_from_a_guess_that_is_far_off() -> None:
    """Growth with saturation: a whole step of Newton's method from 40 leads behind the pole at -5."""
    growth = "s/(5 + s)*b"
    plant = inline({"b": f"0.3*{growth} - 0.05*b", "s": f"2 - 0.6*{growth}"}, "b", initial={"b": 4.0, "s": 40.0})
    start = {"initial": {"b": 4.0, "s": 40.0}}
    blocks: dict[str, Block] = {
        "savgol": {"type": "savgol", "window": 10, **start},
        "spline": {"type": "spline", "smoothing": 1e-4, **start},
    }
    result = hgorun.simulate(experiment(plant, blocks, end=15, step=0.02, measurement={"sampling": {"period": 0.1}}))
    for one in result.observers.values():
        assert one.status == "ok"
        np.testing.assert_allclose(one.xhat[-20:, 1], result.x[-20:, 1], rtol=0.05)
