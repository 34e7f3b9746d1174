"""Samples and noise that follow from their numbers are not tabulated: the events and the bits of tables."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment, inline

import hgorun
from hgorun import Result
from hgorun.measurement import in_order, long, sampling
from hgorun.measurement.long import LongSchedule
from hgorun.simulation import preparation
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
    preparation._SCHEDULES.clear()
    preparation._CHANNELS.clear()
    yield
    preparation._SCHEDULES.clear()
    preparation._CHANNELS.clear()


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
        for metric, value in observer.metrics.items():
            np.testing.assert_array_equal(found.observers[label].metrics[metric], value)
    assert found.integration is not None
    assert expected.integration is not None
    assert found.integration.evaluations == expected.integration.evaluations
    assert found.integration_error == expected.integration_error


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
