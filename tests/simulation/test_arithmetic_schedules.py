"""Samples and noise that follow from their numbers are not tabulated: the events and the bits of tables."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment, inline

import hgorun
from hgorun import Result
from hgorun.errors import ConfigError, Problem
from hgorun.measurement import in_order, long, sampling
from hgorun.measurement.chance import streams
from hgorun.measurement.long import LongSchedule
from hgorun.measurement.trains import Train
from hgorun.noise import compiled
from hgorun.noise.normal import standard_normal
from hgorun.noise.streams import Stream
from hgorun.noise.uniform import UniformNoise
from hgorun.simulation.preparation import preparation, scheduling
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

SHGO: dict[str, Block] = {"H": {"type": "shgo", "theta": 2}}
GAUSSIAN = {"type": "gaussian", "std": 0.1}
HELD = {"type": "uniform", "low": -0.1, "high": 0.1, "hold": 0.07}
OTHER = {"type": "gaussian", "std": 0.1, "hold": 0.05}
TERMS = [{"amplitude": 1, "omega": 7}]
EKF: dict[str, Block] = {"E": {"type": "ekf", "q": 1}}
FILTER: dict[str, Block] = {"E": {"type": "kalman_bucy", "q": 1}}
TWO = inline({"x1": "x2", "x2": "-x1 + abs(sin(9*t))"}, {"y1": "x1", "y2": "x2"})
CASES: dict[str, dict[str, Any]] = {
    "sampled": {"measurement": {"sampling": {"period": 0.05}, "noise": [GAUSSIAN, OTHER]}},
    "offset": {
        "measurement": {"sampling": {"period": 0.05, "offset": 0.02}, "noise": [HELD], "mode": "multiplicative"}
    },
    "sinusoids": {
        "measurement": {
            "sampling": {"period": 0.05},
            "noise": [
                {"type": "sinusoids", "terms": [{"amplitude": 1, "omega": 7}]},
                {"type": "expression", "value": "k"},
            ],
        }
    },
    "held noise": {"measurement": {"noise": [HELD, OTHER]}},
    "phases": {
        "measurement": {
            "phases": [
                {"until": 1, "sampling": {"period": 0.05}, "noise": [OTHER]},
                {"until": 1.51, "noise": [HELD]},
                {"until": 2, "sampling": {"period": 0.03, "offset": 0.1}, "noise": [GAUSSIAN]},
                {"until": 9, "sampling": {"period": 0.05}},
            ]
        },
    },
    "two rates and kinks": {
        "plant": TWO,
        "measurement": {
            "outputs": {"y1": {"sampling": {"period": 0.05}, "noise": [GAUSSIAN]}, "y2": {"noise": [HELD]}}
        },
        "observers": FILTER,
    },
    "two rates": {
        "plant": TWO,
        "measurement": {
            "outputs": {
                "y1": {"sampling": {"period": 0.05}, "noise": [GAUSSIAN]},
                "y2": {"sampling": {"period": 0.025, "offset": 0.0125}, "noise": [GAUSSIAN]},
            }
        },
        "observers": EKF,
    },
    "given times beside": {
        "plant": TWO,
        "measurement": {
            "outputs": {
                "y1": {"sampling": {"times": [0.1, 0.33, 0.4, 2.9]}, "noise": [GAUSSIAN]},
                "y2": {"sampling": {"period": 0.02}, "noise": [GAUSSIAN]},
            }
        },
        "observers": EKF,
    },
    "jumps": {
        "measurement": {"sampling": {"period": 0.05}, "noise": [GAUSSIAN]},
        "observers": {"D": {"type": "deadbeat"}},
    },
    "corrections": {
        "measurement": {"sampling": {"period": 0.05}, "noise": [GAUSSIAN]},
        "observers": EKF,
    },
    "adaptive": {"measurement": {"noise": [HELD]}, "solver": {"method": "dopri5", "rtol": 1e-6}},
    "automatic": {"measurement": {"sampling": {"period": 0.1}, "noise": [GAUSSIAN]}, "solver": {"step": "auto"}},
    "steps that are too long": {
        "measurement": {"sampling": {"period": 0.05}},
        "observers": {"H": {"type": "shgo", "theta": 300}},
    },
    "undefined": {
        "plant": inline({"x1": "x2", "x2": "1-sqrt(x1+1)-x2"}, "x1"),
        "observers": {"H": {"type": "shgo", "theta": 5, "initial": {"x1": -0.4}}},
        "measurement": {"sampling": {"period": 0.05}, "noise": [{"type": "gaussian", "std": 0.5}]},
    },
    "a clock of its own": {
        "time": {"start": 1.7e9, "end": 1.7e9 + 3, "output_step": 0.03},
        "measurement": {"sampling": {"period": 0.05}, "noise": [OTHER]},
    },
}


def prepared(plant: Block = VAN_DER_POL, observers: dict[str, Block] = SHGO, **more: Any) -> PreparedRun:
    return prepare(experiment(plant, observers, end=3.0, output_step=0.03, step=0.02, **more))


def simulated(plant: Block = VAN_DER_POL, observers: dict[str, Block] = SHGO, **more: Any) -> Result:
    return hgorun.simulate(experiment(plant, observers, end=3.0, output_step=0.03, step=0.02, **more))


@pytest.fixture
def short_parts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Runs of a few samples go the way of long ones."""
    monkeypatch.setattr(long, "_PART", 7)
    monkeypatch.setattr(long, "_FEW", 5)
    monkeypatch.setattr(in_order, "_PART", 5)
    monkeypatch.setattr(sampling, "_LONG", 5)
    scheduling._SCHEDULES.clear()
    preparation._CHANNELS.clear()
    yield
    scheduling._SCHEDULES.clear()
    preparation._CHANNELS.clear()


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize("case", CASES)
def test_a_long_run_has_the_bits_of_tables(case: str, request: pytest.FixtureRequest) -> None:
    expected = simulated(**CASES[case])
    request.getfixturevalue("short_parts")
    assert isinstance(prepared(**CASES[case]).schedule, LongSchedule)
    found = simulated(**CASES[case])
    for name in ("time", "taken", "y"):
        np.testing.assert_array_equal(getattr(found.measurements, name), getattr(expected.measurements, name))
    np.testing.assert_array_equal(found.x, expected.x)
    for label, observer in expected.observers.items():
        np.testing.assert_array_equal(found.observers[label].xhat, observer.xhat)
        assert found.observers[label].verdict == observer.verdict
        for metric, value in observer.metrics.items():
            np.testing.assert_array_equal(found.observers[label].metrics[metric], value)
    assert found.integration is not None
    assert expected.integration is not None
    assert found.integration.evaluations == expected.integration.evaluations
    assert found.integration_error == expected.integration_error


@pytest.mark.measured("phases")
@pytest.mark.costly
@pytest.mark.parametrize("case", [name for name in CASES if name != "automatic"])
@pytest.mark.usefixtures("short_parts")
def test_the_parts_of_a_schedule_are_those_of_the_whole(case: str) -> None:
    run = prepared(**CASES[case])
    assert isinstance(run.schedule, LongSchedule)
    whole, parts = run.schedule.whole, list(run.schedule.parts())
    assert len(parts) > 3
    ends = [part.schedule.size - (not part.last) for part in parts]
    events = np.concatenate([part.schedule.events[:end] for part, end in zip(parts, ends, strict=True)])
    np.testing.assert_array_equal(events, whole.events)
    inward = np.concatenate([part.schedule.inward[:end] for part, end in zip(parts, ends, strict=True)])
    np.testing.assert_array_equal(inward, whole.inward)
    variant = np.concatenate([part.schedule.variant for part in parts])[: whole.variant.size]
    assert [run.schedule.variants[i] for i in variant] == [whole.variants[i] for i in whole.variant]
    assert (run.schedule.size, run.schedule.longest_gap) == (whole.size, whole.longest_gap)


@pytest.mark.usefixtures("short_parts")
def test_every_so_many_samples_are_kept_where_all_would_take_too_much(tmp_path: Path) -> None:
    """No more than a twentieth of time.max_memory: 24 bytes a sample of one output."""
    case = CASES["sampled"]
    time = {"end": 3.0, "output_step": 3.0}
    whole = simulated(**case, time=time)
    few = simulated(**case, time=time | {"max_memory": 20 * 24 * 22})
    assert (whole.measurements.every, few.measurements.every) == (1, 3)
    for name in ("time", "taken", "y"):
        np.testing.assert_array_equal(getattr(few.measurements, name), getattr(whole.measurements, name)[::3])
    few.save(tmp_path / "few.h5")
    assert hgorun.read(tmp_path / "few.h5").measurements.every == 3
    with h5py.File(tmp_path / "few.h5") as file:
        np.testing.assert_array_equal(file["measurement/number"][()], np.arange(0, 61, 3))


@pytest.mark.usefixtures("short_parts")
def test_arrays_of_all_that_happens_need_memory() -> None:
    run = prepared(time={"end": 3.0, "output_step": 3.0, "max_memory": 1e4}, **CASES["sampled"])
    with run.experiment.located(), pytest.raises(Problem, match=r"(draws|samples) take about"):
        _ = run.schedule.events


@pytest.mark.usefixtures("short_parts")
def test_noise_that_is_not_a_number_is_said_where_it_stands() -> None:
    with pytest.raises(ConfigError, match=r"not a finite number at t = 2\b") as error:
        simulated(measurement={"sampling": {"period": 0.05}, "noise": [{"type": "expression", "value": "1/(k - 40)"}]})
    assert error.value.key == "measurement.noise"


def test_a_class_that_changes_what_is_drawn_at_once_is_not_drawn_in_parts() -> None:
    class Rounded(UniformNoise):
        def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
            return np.round(super().draw(random, count))

    assert in_order.drawn_in_parts((UniformNoise(type="uniform", low=0, high=1),))
    assert not in_order.drawn_in_parts((Rounded(type="uniform", low=0, high=1),))


@pytest.mark.parametrize("train", [Train(0.3, 0.1, 50, 0.0, 9.0), Train(1e6, 1e-3, 1000, -1e9, 1e9, number=77)])
def test_a_train_finds_its_times(train: Train) -> None:
    times = train.at(np.arange(train.size))
    asked = np.concatenate([times, times + 1e-9 * train.spacing, times - train.spacing / 3, [-np.inf, np.inf]])
    assert [train.before(t) for t in asked] == np.searchsorted(times, asked).tolist()


def test_draws_that_are_too_close_to_call_leave_the_stream_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """What machine code cannot decide is drawn again with decimal numbers, and the next part goes on behind it."""
    of = streams(np.array([3]), "noise")
    expected = standard_normal(of.generator(0), 3000)
    monkeypatch.setattr(compiled, "SURE", 1e-3)
    code = compiled._Code()
    monkeypatch.setattr(compiled, "_code", lambda: code)
    assert np.any(compiled.normal(of.states, 3000)[1].argument == 0)
    stream = Stream(of)
    np.testing.assert_array_equal(np.concatenate([stream.normal(n) for n in (1, 999, 1500, 500)]), expected)


@pytest.mark.slow
def test_a_million_samples_take_little_memory() -> None:
    """Traced: 136 MB as tables."""
    config = {"measurement": {"sampling": {"period": 1e-6}, "noise": [GAUSSIAN]}}
    hgorun.simulate(experiment(VAN_DER_POL, SHGO, end=0.1, output_step=0.1, step=1e-6, **config))
    tracemalloc.start()
    try:
        result = hgorun.simulate(experiment(VAN_DER_POL, SHGO, end=1.0, output_step=0.1, step=1e-6, **config))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert result.measurements.time.size == 1_000_001
    assert peak < 100e6
