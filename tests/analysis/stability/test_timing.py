"""The one period and delay that limits are compared with."""

from __future__ import annotations

from typing import Any

import pytest
from examples import chain, experiment, inline

from hgorun.analysis.reasons import NoValue
from hgorun.analysis.stability.critical import timing_of
from hgorun.simulation.simulate import prepare

OBSERVERS = {"o": {"type": "shgo", "theta": 2}}


PHASES = {"phases": [{"until": 0.5, "delay": 0.3}, {"until": 1, "sampling": {"period": 0.2}}]}


@pytest.mark.parametrize(
    ("measurement", "period", "delay", "remark"),
    [
        ({}, None, 0, ""),
        ({"delay": 0.2}, None, 0.2, ""),
        ({"delay": "0.2 + 0.1*sin(20*t)"}, None, 0.3, "with the longest delay, 0.3 s, throughout"),
        ({"sampling": {"period": 0.1}}, 0.1, 0, ""),
        ({"sampling": {"period": 0.1, "jitter": 0.01}}, 0.1, 0, "without jitter and dropout"),
        ({"sampling": {"period": 0.1, "dropout": 0.2}}, 0.1, 0, "without jitter and dropout"),
        ({"sampling": {"times": [0, 0.1, 0.4, 0.6]}}, 0.3, 0, "the longest time between two samples"),
        (
            {"phases": [{"until": 0.5, "delay": 0.3}, {"until": 1, "sampling": {"period": 0.2}}]},
            0.2,
            0,
            "the last phase",
        ),
    ],
)
def test_of_one_output(measurement: dict[str, Any], period: float | None, delay: float, remark: str) -> None:
    found = timing_of(prepare(experiment(chain(2), OBSERVERS, step=0.01, measurement=measurement)))
    assert found.period == (None if period is None else pytest.approx(period))
    assert found.delay == pytest.approx(delay, abs=1e-4)
    said = found.phase + found.regular + found.uneven + found.late
    assert said.startswith(remark)
    assert bool(said) == bool(remark)


@pytest.mark.parametrize("other", [{"sampling": {"period": 0.2}}, {"sampling": {"period": 0.1}, "delay": 0.01}])
def test_outputs_that_differ(other: dict[str, Any]) -> None:
    plant = inline({"a": "-a", "b": "-b"}, ["a", "b"])
    measurement = {"outputs": {"a": {"sampling": {"period": 0.1}}, "b": other}}
    run = prepare(experiment(plant, OBSERVERS, step=0.01, measurement=measurement))
    with pytest.raises(NoValue, match="differ in their sampling or delay"):
        timing_of(run)
