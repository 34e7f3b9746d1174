"""Measurements that cannot be: which numbers are refused, with the key and what was found."""

from __future__ import annotations

from typing import Any

import pytest
from examples import chain, experiment, simulated

from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare

OBSERVERS = {"o": {"type": "shgo", "theta": 2}}


@pytest.mark.parametrize("sampling", ["continuous", {"period": 0.1}])
@pytest.mark.parametrize(
    ("delay", "words"),
    [
        ("sin(7*t)", r"the delay must be a number >= 0, found -\S+ at t = "),
        ("0.1 - t", r"the delay must be a number >= 0, found -0\.9 at t = 1"),
        ("sqrt(0.55 - t)", r"the delay must be a number >= 0, found nan at t = 0\.[56]"),
    ],
)
def test_a_delay_is_a_number_and_not_negative(sampling: Any, delay: str, words: str) -> None:
    measurement = {"sampling": sampling, "delay": delay}
    with pytest.raises(ConfigError, match=words) as error:
        simulated(chain(2), OBSERVERS, step=0.01, measurement=measurement)
    assert error.value.key == "measurement.delay"


@pytest.mark.parametrize("delay", ["0", "0.1*(1 - t)", "abs(sin(t))"])
def test_a_delay_may_vanish(delay: str) -> None:
    for sampling in ("continuous", {"period": 0.1}):
        prepare(experiment(chain(2), OBSERVERS, step=0.01, measurement={"sampling": sampling, "delay": delay}))


@pytest.mark.parametrize(
    ("sampling", "words"),
    [
        ({"times": [0.1, 0.3, 0.2]}, "times must increase, found 0.3 before 0.2"),
        ({"times": [0.1, 0.1]}, "times must increase, found 0.1 before 0.1"),
        ({"times": [3, 4]}, "no sample lies between 0 and 1"),
        ({"steps": "0.1 - 0.02*k"}, r"steps must be positive, found \S+ at k = 5"),
        ({"steps": "0.1/(k - 2)"}, "steps must be positive, found -0.05 at k = 0"),
        ({"period": 0.1, "steps": "1"}, "exactly one of period, times and steps, found period and steps"),
        ({"jitter": 0.1}, "exactly one of period, times and steps, found jitter"),
        ({}, "exactly one of period, times and steps, found none"),
        ("often", "expected continuous or a mapping with period, times or steps, found 'often'"),
        ({"period": 0.1, "dropout": 1.1}, "a number of at most 1"),
    ],
)
def test_samples_that_cannot_be_taken(sampling: Any, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        simulated(chain(2), OBSERVERS, step=0.01, measurement={"sampling": sampling})


def test_steps_may_stop_being_positive_after_the_run() -> None:
    result = simulated(chain(2), OBSERVERS, step=0.01, measurement={"sampling": {"steps": "0.5 - 0.1*k"}})
    assert result.measurements.time == pytest.approx([0, 0.5, 0.9])


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        ("loud", "expected a mapping with type: .*found 'loud'"),
        ({"std": 1}, "type is missing; one of"),
        ({"type": "gausian"}, "no noise is called 'gausian'. Did you mean .*gaussian"),
    ],
)
def test_noise_that_is_none(noise: Any, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        experiment(chain(2), OBSERVERS, measurement={"noise": [noise]})


@pytest.mark.parametrize(
    ("measurement", "key"),
    [
        ({"outputs": {"y": {"delay": 0.1}}}, "measurement.outputs.y"),
        ({"phases": [{"until": 1, "outputs": {"y": {"delay": 0.1}}}]}, "measurement.phases.0.outputs.y"),
        ({"phases": [{"until": 0.5}, {"until": 1, "outputs": {"x2": {}}}]}, "measurement.phases.1.outputs.x2"),
    ],
)
def test_an_output_that_the_plant_has_not(measurement: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError, match="x1") as error:
        prepare(experiment(chain(2), OBSERVERS, step=0.01, measurement=measurement))
    assert error.value.key == key
