"""Noise for which there is no prediction: each case with its reason, and none with a number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, sinusoid

from hgorun.analysis.linear.linear import Linear
from hgorun.analysis.noise.along_run import noise_along
from hgorun.analysis.noise.continuous import continuous_power
from hgorun.analysis.noise.prediction import measured_noise, predicted_noise, without_noise
from hgorun.analysis.noise.terms import NoiseTerms, grouped
from hgorun.analysis.reasons import NEEDS_HOLD, NO_SLOPES, NoValue
from hgorun.noise.base import Draws, Wave
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare, simulate, simulate_prepared

SHGO: Block = {"type": "shgo", "theta": 3}
HELD: Block = {"type": "gaussian", "std": 0.1, "hold": 0.05}
SAMPLED: Block = {"period": 0.1}


def made(measurement: Block, plant: Block | None = None, block: Block = SHGO, **more: Any) -> Experiment:
    options = {"end": 6.0, "output_step": 0.01, "step": 0.01} | more
    return experiment(plant or chain(2, "-x1 - x2"), {"o": block}, measurement=measurement, **options)


def reason(found: Experiment, *, along: bool) -> str:
    run, noise_free = prepare(found), simulate(without_noise(found))
    with pytest.raises(NoValue) as caught:
        predicted_noise(run, "o", noise_free, simulate_prepared(run) if along else None)
    return str(caught.value)


LATE_IN_PART = {"noise": sinusoid(0.1, 5), "phases": [{"until": 3}, {"until": 6, "sampling": SAMPLED}]}
TWO = inline({"x1": "-x1 + 0.1*x2", "x2": "-x2"}, ["x1", "x2"])


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.parametrize(
    ("measurement", "along", "words"),
    [
        ({"noise": sinusoid(0.1, 5), "delay": 2}, False, "the delay 2 is beyond the stability limit 1.351"),
        ({"noise": [{"type": "expression", "value": "sin(t)**3"}]}, False, "noise of type expression has no spectrum"),
        ({"noise": [{"type": "expression", "value": "sin(t)**3"}]}, True, "noise of type expression has no spectrum"),
        (LATE_IN_PART, False, "a measurement that does not change"),
        (LATE_IN_PART, True, "the output is continuous in one phase and something else in another"),
        ({"noise": [HELD], "sampling": SAMPLED | {"jitter": 0.01}}, False, "without jitter and dropout"),
        ({"noise": [HELD], "mode": "multiplicative"}, False, "only additive noise"),
    ],
)
def test_measurements_without_a_prediction(measurement: Block, along: bool, words: str) -> None:
    assert words in reason(made(measurement), along=along)


def test_outputs_of_different_periods_have_no_common_one() -> None:
    measurement = {"noise": sinusoid(0.1, 5), "outputs": {"x1": {"sampling": SAMPLED}}}
    assert "different sampling" in reason(made(measurement, TWO), along=False)


def test_a_plant_without_slopes_where_it_stays() -> None:
    root = inline({"x1": "x2", "x2": "-sqrt(abs(x1)) - x2"}, "x1", start=0.0)
    for along in (False, True):
        assert reason(made({"noise": sinusoid(0.1, 5)}, root), along=along) == NO_SLOPES


def test_a_divergence_that_only_the_noise_brings() -> None:
    plant = inline({"x1": "x2", "x2": "-x1 - x2 + x2**3"}, "x1", start=0.1)
    found = made({"noise": sinusoid(20, 1)}, plant, SHGO | {"initial": {"x1": 0.1, "x2": 0.1}}, metrics={})
    run, noise_free = prepare(found), simulate(without_noise(found))
    result = simulate_prepared(run)
    assert noise_free.observers["o"].diverged_at is None
    assert result.observers["o"].diverged_at is not None
    with pytest.raises(NoValue, match="the observer diverged"):
        predicted_noise(run, "o", noise_free, result)
    with pytest.raises(NoValue, match="the observer diverged"):
        predicted_noise(run, "o", result)


def test_noise_beyond_the_slopes() -> None:
    """The predictions move away from each other, round after round."""
    plant = inline({"x1": "x2", "x2": "-x1 - x2 - x1**3 + 3*x2*x1**2"}, "x1", start=0.1)
    found = made({"noise": sinusoid(3, 2)}, plant, SHGO, step=0.002)
    run, noise_free = prepare(found), simulate(without_noise(found))
    with pytest.raises(NoValue, match="too large to predict its effect"):
        noise_along(run, "o", noise_free, noise_free)


def test_three_points_are_too_few_to_follow_anything() -> None:
    found = made({"noise": sinusoid(0.1, 5)}, end=1.0, output_step=0.5)
    run, result = prepare(found), simulate(found)
    with pytest.raises(NoValue, match="too few points"):
        noise_along(run, "o", result, simulate(without_noise(found)))


LAG = Linear(*(np.array([[v]]) for v in (-1.0, -1.0, 1.0, 1.0, 0.0, 0.0)))  # xi' = -xi - (xi - v)


def test_a_lag_under_a_constant_and_a_wave_is_two_numbers() -> None:
    """xi' = -2 xi + v: half of a constant, and 1/sqrt(4 + omega^2) of a sinusoid."""
    power = continuous_power(LAG, [NoiseTerms((Wave(0.7, 3.0),), (Draws(0.4, 0.0, np.inf),))])
    np.testing.assert_allclose(power, 0.2**2 + 0.7**2 / 2 / (4 + 9), rtol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_white_noise_of_a_continuous_output_has_no_power(delay: float) -> None:
    with pytest.raises(NoValue, match=NEEDS_HOLD):
        continuous_power(LAG, [NoiseTerms(draws=(Draws(0.0, 1.0, None),))], delay)


def test_waves_of_one_frequency_are_one_wave() -> None:
    """Im(a exp(-j w t)) is Im(-conj(a) exp(j w t))."""
    (one,) = grouped([Wave(1 + 2j, 3.0), Wave(2j, -3.0)])
    t = np.linspace(0, 5, 20)
    wanted = ((1 + 2j) * np.exp(3j * t)).imag + (2j * np.exp(-3j * t)).imag
    np.testing.assert_allclose((one.phasor * np.exp(1j * one.omega * t)).imag, wanted, atol=1e-12)


def test_a_sinusoid_that_stands_still_is_a_constant() -> None:
    """Its size is that of its phase; the estimate moves by it, times the gain at rest."""
    found = made({"noise": sinusoid(0.3, 0, np.pi / 2) + sinusoid(0.1, 9)}, chain(2, "-x1 - x2", 0.0), end=30.0)
    run, noise_free = prepare(found), simulate(without_noise(found))
    np.testing.assert_allclose(
        predicted_noise(run, "o", noise_free), measured_noise(simulate_prepared(run), noise_free, "o"), rtol=0.01
    )
