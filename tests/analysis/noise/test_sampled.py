"""Noise on samples, periodic ones above all: predicted by the loop from sample to sample, and simulated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import chain, experiment, sinusoid

import hgorun
from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.noise.sampled import SampledLoop
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.analysis.reasons import NoValue
from hgorun.noise.base import Draws, Wave
from hgorun.simulation.simulate import prepare

PERIOD = 0.1


def loop(delay: float = 0.0, theta: float = 2.0) -> SampledLoop:
    run = prepare(experiment(chain(2, start=0), {"o": {"type": "shgo", "theta": theta}}))
    observer = Linearisation(run, "o")
    return SampledLoop(observer.at(0.0, observer.at_truth(np.zeros(2))), PERIOD, delay)


def simulated(noise: list[dict[str, Any]], delay: float, end: float = 60.0) -> np.ndarray:
    """Mean squares of the estimate over the last two thirds, the truth being zero."""
    measurement = {"sampling": {"period": PERIOD}, "delay": delay, "noise": noise}
    observers = {"o": {"type": "shgo", "theta": 2}}
    made = experiment(chain(2, start=0), observers, end=end, output_step=0.002, step=0.01, measurement=measurement)
    result = hgorun.simulate(made)
    late = result.time > end / 3
    return np.asarray(np.mean(result.observers["o"].xhat[late] ** 2, axis=0))


@pytest.mark.parametrize("delay", [0.0, 0.04])
@pytest.mark.parametrize("turns", [0.31, 0.5, 1.0, 1.5], ids=lambda t: f"{t} a sample")
def test_sinusoids_fast_and_slow(turns: float, delay: float) -> None:
    """Half a turn a sample: they alternate; a whole one: they are constant."""
    omega, phase = 2 * np.pi * turns / PERIOD, 0.6
    power = loop(delay).power([NoiseTerms(waves=(Wave(0.7 * np.exp(1j * phase), omega),))], 0.0)
    np.testing.assert_allclose(power, simulated(sinusoid(0.7, omega, phase), delay), rtol=0.02, atol=1e-12)


def test_a_mean_is_a_constant_wave() -> None:
    constant = loop().power([NoiseTerms(draws=(Draws(0.3, 0.0, None),))], 0.0)
    wave = loop().power([NoiseTerms(waves=(Wave(0.3j, 0.0),))], 0.0)
    np.testing.assert_allclose(constant, wave, rtol=1e-12)
    both = loop().power([NoiseTerms(draws=(Draws(0.3, 0.2, None),))], 0.0)
    drawn = loop().power([NoiseTerms(draws=(Draws(0.0, 0.2, None),))], 0.0)
    np.testing.assert_allclose(both, constant + drawn, rtol=1e-12)


def test_two_waves_with_one_alias_add_before_they_are_squared() -> None:
    """Of opposite sign they cancel: sin(w t) and -sin((w + 2 pi/T) t) are one sequence of samples."""
    omega = 7.0
    waves = (Wave(0.7, omega), Wave(-0.7, omega + 2 * np.pi / PERIOD))
    np.testing.assert_allclose(loop().power([NoiseTerms(waves=waves)], 0.0), 0, atol=1e-20)


def test_the_gain_is_the_power_of_one_sinusoid() -> None:
    omega = np.array([3.0, 25.0, 40.0])
    gain = loop(0.03).gain(omega)
    for w, found in zip(omega, gain, strict=True):
        power = loop(0.03).power([NoiseTerms(waves=(Wave(1.0, w),))], 0.0)
        np.testing.assert_allclose(found**2 / 2, power, rtol=1e-9)


def test_reasons() -> None:
    with pytest.raises(NoValue, match="held longer than a sampling period"):
        loop().power([NoiseTerms(draws=(Draws(0.0, 1.0, 0.2),))], 0.0)
    with pytest.raises(NoValue, match="not stable: spectral radius"):
        loop(theta=60.0)
