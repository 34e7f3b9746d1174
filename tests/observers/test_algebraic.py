"""The algebraic differentiator: weights by integration of the kernel, exactness, delays, uneven and late samples."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, simulated
from numpy.polynomial import Polynomial
from scipy.special import beta

from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare

PLANT = chain(3, "-x1 - 0.5*x2 + sin(3*t)", [1, 0, 0])
NOISE: Block = {"noise": [{"type": "gaussian", "std": 0.1}]}


def weights(ages: np.ndarray, i: int, kappa: int, mu: int) -> np.ndarray:
    """Of the samples of these ages, ascending: trapezoidal, then the nearest that are exact for degree i."""
    T, one = ages[-1], Polynomial([0, 1])
    K = (one ** (kappa + i) * (1 - one) ** (mu + i)).deriv(i) / beta(kappa + i + 1, mu + i + 1)
    half = np.diff(ages / T) / 2
    w = K(ages / T) * (np.append(half, 0) + np.append(0, half)) / T**i
    V = np.vander(-ages, i + 1, increasing=True).T
    target = np.zeros(i + 1)
    target[i] = np.prod(np.arange(1, i + 1))
    return np.asarray(w + np.linalg.pinv(V) @ (target - V @ w))


@pytest.mark.costly
@pytest.mark.parametrize("given", [{}, {"kappa": 0, "mu": 0}, {"kappa": 1, "mu": 3}])
def test_a_run_has_the_weights_of_the_kernel(given: Block) -> None:
    block = {"type": "algebraic", "window": 9, **given}
    run = simulated(PLANT, {"D": block}, end=2, output_step=0.1, step=0.05,
                    measurement={"sampling": {"period": 0.1}, **NOISE})  # fmt: skip
    y, xhat = run.measurements.y[:, 0], run.observers["D"].xhat
    for i in range(3):
        w = weights(0.1 * np.arange(9), i, given.get("kappa", i), given.get("mu", i))
        expected = [w @ y[k - 8 : k + 1][::-1] for k in range(8, 21)]
        np.testing.assert_allclose(xhat[8:, i], expected, rtol=0, atol=1e-9)


def test_times_that_are_uneven_and_a_window_that_fills() -> None:
    times = [0.1, 0.15, 0.4, 0.55, 0.9, 1.0, 1.35, 1.4, 1.7, 1.95]
    run = simulated(PLANT, {"D": {"type": "algebraic", "window": 6}}, end=2, output_step=0.05, step=0.05,
                    measurement={"sampling": {"times": times}, **NOISE})  # fmt: skip
    y = run.measurements.y[:, 0]
    for k, t in enumerate(times):
        row, past = run.observers["D"].xhat[round(t / 0.05)], slice(max(k - 5, 0), k + 1)
        ages = (t - np.array(times[past]))[::-1]
        expected = [weights(ages, i, i, i) @ y[past][::-1] for i in range(3)] if k >= 2 else np.zeros(3)
        np.testing.assert_allclose(row, expected, rtol=0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("i", "kappa", "of_powers"), [(1, 0, [0, 1, -0.4]), (2, 1, [0, 0, 2, -6 * 0.2])])
def test_a_degree_more_is_exact_at_half_the_window(i: int, kappa: int, of_powers: list[float]) -> None:
    """T = 0.4: t^2 has the derivative -2 T/2 at the newest sample, t^3 the second one -6 T/2."""
    plant = chain(i + 1, "3", 0.0)  # y^(i) = 3 t
    found = weights(np.linspace(0, 0.4, 401), i, kappa, kappa)
    np.testing.assert_allclose([found @ (-np.linspace(0, 0.4, 401)) ** j for j in range(i + 2)], of_powers, atol=1e-4)
    block = {"type": "algebraic", "window": 41, "kappa": kappa, "mu": kappa}
    run = simulated(plant, {"D": block}, end=1, step=0.01, measurement={"sampling": {"period": 0.01}})
    np.testing.assert_allclose(run.observers["D"].xhat[-1, i], 3 * (1 - 0.2), rtol=1e-7)


def test_late_samples_are_put_where_they_belong() -> None:
    """All samples of a ramp are in the window at the end: its slope is found whatever the order of arrival."""
    run = simulated(chain(2, "0", [1, -2]), {"D": {"type": "algebraic", "window": 8}}, end=2, step=0.05,
                    measurement={"sampling": {"period": 0.1}, "delay": "0.2 + 0.15*sin(30*t)"})  # fmt: skip
    assert run.observers["D"].xhat[-1, 1] == pytest.approx(-2, abs=1e-8)


@pytest.mark.costly
def test_a_continuous_output_is_measured_at_the_steps() -> None:
    blocks: dict[str, Block] = {"D": {"type": "algebraic", "window": 12}}
    continuous = simulated(PLANT, blocks, end=1, step=0.02)
    sampled = simulated(PLANT, blocks, end=1, step=0.02, measurement={"sampling": {"period": 0.02}})
    np.testing.assert_allclose(continuous.observers["D"].xhat, sampled.observers["D"].xhat, rtol=0, atol=1e-9)


def test_what_does_not_fit_is_refused() -> None:
    sampled: Block = {"sampling": {"period": 0.1}}
    with pytest.raises(ConfigError, match="these take 3 samples or more"):
        prepare(experiment(PLANT, {"D": {"type": "algebraic", "window": 2}}, measurement=sampled))
    with pytest.raises(ConfigError, match="kappa"):
        prepare(experiment(PLANT, {"D": {"type": "algebraic", "window": 5, "kappa": -1}}, measurement=sampled))
    with pytest.raises(ConfigError, match="as it is then: sample"):
        prepare(experiment(PLANT, {"D": {"type": "algebraic", "window": 5}}, measurement={"delay": 0.1}, step=0.01))
