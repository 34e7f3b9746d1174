"""Measurements that cannot be: which numbers are refused, with the key and what was found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import chain, experiment, inline, simulated

from hgorun.errors import ConfigError, PluginError
from hgorun.measurement.blocks import Measurement, Periodic, noise_blocks
from hgorun.noise.base import NOISE
from hgorun.noise.uniform import UniformNoise
from hgorun.simulation.simulate import prepare

OBSERVERS = {"o": {"type": "shgo", "theta": 2}}


@pytest.mark.parametrize("sampling", ["continuous", {"period": 0.1}])
@pytest.mark.parametrize(
    ("delay", "words"),
    [
        ("-1", r"the delay must be a number >= 0, found -1"),
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
        ({"type": "normal"}, "no noise is called 'normal'. Did you mean .*gaussian"),
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


@pytest.mark.parametrize(
    ("measurement", "key", "words"),
    [
        ({"sampling": {"steps": "1.0e-7"}}, "measurement.sampling.steps", r"\d+ samples, which take about \S+ GiB"),
        ({"sampling": {"period": 1e-7, "jitter": 1e-8}}, "measurement.sampling.period", "samples"),
        (
            {"noise": [{"type": "uniform", "low": -1, "high": 1, "hold": 1e-7}], "delay": 0.1},
            "measurement.noise.0.hold",
            r"1e\+07 draws take about \S+ GiB; time.max_memory leaves",
        ),
    ],
)
def test_more_than_the_memory_holds(measurement: dict[str, Any], key: str, words: str) -> None:
    time = {"end": 1, "output_step": 0.1, "max_memory": 1e8}
    with pytest.raises(ConfigError, match=words) as error:
        prepare(experiment(chain(2), OBSERVERS, step=0.01, measurement=measurement, time=time))
    assert error.value.key == key


def test_samples_that_come_back_after_a_delay_again_and_again() -> None:
    """One output is sampled, the other late: what happens at a sample returns a delay later, five times."""
    plant = inline({"x1": "x2", "x2": "-x1"}, ["x1", "x2"])
    outputs = {"x1": {"sampling": {"period": 1e-3}}, "x2": {"delay": 0.1234567}}
    time = {"end": 1, "output_step": 0.1, "max_memory": 2e6}
    with pytest.raises(ConfigError, match=r"come back after the delay make \d+ events, about") as error:
        prepare(experiment(plant, OBSERVERS, step=0.05, measurement={"outputs": outputs}, time=time))
    assert error.value.key == "measurement.outputs.x2.delay"


def test_a_noise_of_the_wrong_shape_is_told() -> None:
    class Twice(UniformNoise):
        def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
            return random.uniform(size=2 * count)

    with NOISE.replaced("twice", Twice):
        noise = [{"type": "twice", "low": -1, "high": 1}]
        measurement = {"sampling": {"period": 0.25}, "noise": noise}
        with pytest.raises(
            PluginError, match=r"noise 'twice': draw returned an array of shape \(10,\), expected \(5,\)"
        ):
            simulated(chain(2), OBSERVERS, step=0.01, measurement=measurement)


def test_noise_and_sampling_that_are_blocks_already_are_taken() -> None:
    item = UniformNoise(type="uniform", low=-1, high=1)
    made = Measurement.model_validate({"sampling": Periodic(period=0.5), "noise": [item]})
    assert made.noise == (item,)
    assert made.sampling == Periodic(period=0.5)


def test_every_place_where_noise_is_given() -> None:
    noise = [{"type": "uniform", "low": -1, "high": 1}]
    made = Measurement.model_validate(
        {
            "noise": noise,
            "outputs": {"a": {"noise": noise}, "b": {"delay": 0.1}},
            "phases": [{"until": 1}, {"until": 2, "noise": noise, "outputs": {"c": {"noise": []}, "d": {}}}],
        }
    )
    assert [path for path, _ in noise_blocks(made)] == [
        "measurement.noise",
        "measurement.outputs.a.noise",
        "measurement.phases.1.noise",
        "measurement.phases.1.outputs.c.noise",
    ]


def test_a_long_run_holds_its_draws_from_their_own_times_on() -> None:
    """At k hold the k-th draw begins, whatever the rounding of many thousand holds."""
    noise = [{"type": "uniform", "low": -1, "high": 1, "hold": 1e-3}]
    run = prepare(experiment(chain(2), OBSERVERS, end=50, output_step=1, step=0.01, measurement={"noise": noise}))
    held = run.channels[0].noise[0]
    times = 1e-3 * np.arange(50_000)
    np.testing.assert_array_equal(held.held(times), held.held(times + 5e-4))
    assert np.all(np.diff(held.held(times)) != 0)
