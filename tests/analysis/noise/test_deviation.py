"""What noise does to an estimate over the steady window, as a course: against the run minus the one without noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, sinusoid

from hgorun.analysis.noise.deviation import deviation_in_window
from hgorun.analysis.noise.prediction import without_noise
from hgorun.analysis.reasons import NO_SLOPES, SLIDING, NoValue
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare, simulate, simulate_prepared

SHGO: Block = {"type": "shgo", "theta": 3}
PLANT = chain(2, "-x1 - x2 + sin(t)")
TWO = inline({"x1": "x2", "x2": "-x1 - x2 + 0.2*x3", "x3": "-x3 + 0.1*x1"}, ["x1", "x3"])
HELD: Block = {"type": "uniform", "low": -0.2, "high": 0.2, "hold": 0.05}


def made(measurement: Block, plant: Block = PLANT, block: Block = SHGO, **more: Any) -> Experiment:
    options = {"end": 12.0, "output_step": 0.02, "step": 0.005} | more
    return experiment(plant, {"o": block}, measurement=measurement, **options)


def compared(found: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """Predicted and simulated, shape (K, n)."""
    run, noise_free, noisy = prepare(found), simulate(without_noise(found)), simulate(found)
    inside, deviation = deviation_in_window(run, "o", noise_free, lambda: noisy)
    return deviation, (noisy.observers["o"].xhat - noise_free.observers["o"].xhat)[inside]


@pytest.mark.measured("late", "late, in proportion", "held", "in proportion")
@pytest.mark.slow
@pytest.mark.parametrize(
    "measurement",
    [
        {"noise": [*sinusoid(0.3, 9, 0.4), *sinusoid(0.2, 0.0, np.pi / 2)]},
        {"noise": sinusoid(0.3, 9), "delay": 0.06},
        {"noise": [*sinusoid(0.3, 9), HELD], "delay": 0.06},
        {"noise": sinusoid(0.3, 9), "delay": 0.06, "mode": "multiplicative"},
        {"noise": [HELD]},
        {"noise": sinusoid(0.3, 9), "mode": "multiplicative"},
        {"noise": [HELD], "sampling": {"period": 0.1}, "delay": 0.03},
    ],
    ids=["steady", "late", "late and held", "late, in proportion", "held", "in proportion", "sampled"],
)
def test_the_course_is_the_simulations(measurement: Block) -> None:
    predicted, measured = compared(made(measurement))
    size = np.max(np.abs(measured), axis=0)
    assert np.all(size > 1e-3)
    np.testing.assert_array_less(np.max(np.abs(predicted - measured), axis=0) / size, 0.05)


def test_of_an_observer_that_jumps() -> None:
    measurement = {"noise": [HELD], "sampling": {"period": 0.1}}
    predicted, measured = compared(made(measurement, chain(2, "-x1"), {"type": "reduced_sampled", "H": 2}))
    np.testing.assert_allclose(predicted, measured, atol=0.02 * float(np.max(np.abs(measured))))


def test_two_outputs_have_noise_of_their_own() -> None:
    outputs = {"x1": {"noise": sinusoid(0.2, 7)}, "x3": {"noise": sinusoid(0.1, 11)}}
    predicted, measured = compared(made({"outputs": outputs}, TWO))
    np.testing.assert_allclose(predicted, measured, atol=0.03 * float(np.max(np.abs(measured))))


def reason(found: Experiment) -> str:
    run, noise_free = prepare(found), simulate(without_noise(found))
    with pytest.raises(NoValue) as caught:
        deviation_in_window(run, "o", noise_free, lambda: simulate_prepared(run))
    return str(caught.value)


def test_an_observer_that_slides_has_no_slope() -> None:
    assert reason(made({"noise": sinusoid(0.1, 9)}, block={"type": "levant", "G": 5}, step=0.001, end=2.0)) == SLIDING


def test_a_run_that_diverges_with_or_without_noise() -> None:
    plant = inline({"x1": "x2", "x2": "-x1 - x2 + x2**3"}, "x1", start=0.1)
    near = SHGO | {"initial": {"x1": 0.1, "x2": 0.1}}
    assert reason(made({"noise": sinusoid(20, 1), "delay": "0.01 + 0.005*sin(t)"}, plant, near)) != ""
    found = made({"noise": sinusoid(20, 1), "sampling": {"period": 0.05}}, plant, near)
    assert reason(found) == "the observer diverged"
    run, result = prepare(found), simulate(found)
    with pytest.raises(NoValue, match="the observer diverged"):
        deviation_in_window(run, "o", result, lambda: result)


def test_slopes_that_change_make_no_steady_response_of_a_late_output() -> None:
    plant = chain(2, "-x1 - (2 + sin(t))*x2")
    found = reason(made({"noise": sinusoid(0.1, 5), "delay": 0.1}, plant))
    assert found == "the linearisation of the observer changes along the run, and its output is continuous and delayed"


def test_slopes_that_are_none() -> None:
    root = inline({"x1": "x2", "x2": "-sqrt(abs(x1)) - x2"}, "x1", start=0.0)
    assert reason(made({"noise": sinusoid(0.1, 5), "delay": 0.1}, root)) == NO_SLOPES


def test_a_delay_that_is_too_short_to_be_followed() -> None:
    assert "following the noise of a delayed output would take" in reason(
        made({"noise": sinusoid(0.1, 5e4), "delay": 1e-3})
    )


def test_outputs_that_differ_in_their_delay_are_followed_no_way() -> None:
    outputs = {"x1": {"delay": 0.05}, "x3": {"delay": 0.1}}
    assert "continuous and delayed" in reason(made({"noise": sinusoid(0.1, 5), "outputs": outputs}, TWO))
