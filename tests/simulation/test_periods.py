"""Outputs known up to whole periods: the same run as with the angle that is not wrapped."""

from __future__ import annotations

from typing import Any

import examples
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError

PENDULUM = {
    "states": ["th", "om"],
    "dynamics": {"th": "om", "om": "-9.81*sin(th) - 0.1*om"},
    "initial": {"th": 0, "om": 9},
    "units": {"th": "rad", "om": "rad/s"},
}
NOISE = [{"type": "gaussian", "std": 0.02}]
WRAPPED = {"phi": {"value": "th", "period": "2*pi"}}


def simulated(output: dict[str, Any], observer: dict[str, Any], measurement: dict[str, Any], **more: Any) -> Any:
    observers = {"S": observer | {"initial": {"th": 0.2, "om": 0}}}
    settings = {"end": 10, "step": 1e-3, "measurement": measurement, **more}
    return hgorun.simulate(examples.experiment(PENDULUM | {"output": output}, observers, **settings))


@pytest.mark.slow
@pytest.mark.parametrize(
    "measurement",
    [
        {"sampling": {"period": 0.01}, "noise": NOISE},
        {"sampling": {"period": 0.01}, "noise": NOISE, "delay": 0.03},
        {"noise": [NOISE[0] | {"hold": 0.01}]},
        {"noise": [NOISE[0] | {"hold": 0.01}], "delay": 0.03},
    ],
    ids=["sampled", "late samples", "continuous", "late"],
)
@pytest.mark.parametrize(
    "observer",
    [
        {"type": "shgo", "theta": 10},
        {"type": "fhgo1", "theta": 10, "delta": 3},
        {"type": "direct", "theta": 10},
    ],
)
def test_the_innovation_is_wrapped(observer: dict[str, Any], measurement: dict[str, Any]) -> None:
    plain, wrapped = (simulated(output, observer, measurement) for output in ({"phi": "th"}, WRAPPED))
    assert np.ptp(plain.x[:, 0]) > 2 * np.pi
    np.testing.assert_allclose(wrapped.observers["S"].xhat, plain.observers["S"].xhat, atol=1e-9)
    y = wrapped.measurements.y[:, 0]
    assert np.nanmax(np.abs(y)) <= np.pi
    turns = (y - plain.measurements.y[:, 0]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)


@pytest.mark.parametrize("observer", [{"type": "deadbeat"}, {"type": "reduced_sampled", "H": 20}])
def test_observers_that_jump_get_differences_without_whole_turns(observer: dict[str, Any]) -> None:
    measurement = {"sampling": {"period": 0.01}}
    plain, wrapped = (simulated(output, observer, measurement) for output in ({"phi": "th"}, WRAPPED))
    np.testing.assert_allclose(wrapped.observers["S"].xhat[:, 1], plain.observers["S"].xhat[:, 1], atol=1e-9)


def test_an_angle_that_the_equations_wrap() -> None:
    """atan2(sin, cos) is the same measurement."""
    output = {"phi": {"value": "atan2(sin(th), cos(th))", "period": "2*pi"}}
    measurement = {"sampling": {"period": 0.01}, "noise": NOISE}
    one, two = (simulated(o, {"type": "shgo", "theta": 10}, measurement) for o in (output, WRAPPED))
    np.testing.assert_allclose(one.observers["S"].xhat, two.observers["S"].xhat, atol=1e-9)


def test_units_of_a_plant_of_ones_own() -> None:
    result = simulated(WRAPPED, {"type": "shgo", "theta": 10}, {}, end=0.1)
    assert result.units["om"] == "rad/s"


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"output": {"phi": {"value": "th", "period": 0}}}, "plant.output.phi.period", "above 0"),
        ({"output": {"phi": {"value": "th", "turn": 1}}}, "plant.output.phi.turn", "unknown key"),
        ({"output": {"phi": {"value": "tth", "period": 1}}}, "plant.output.phi.value", "Did you mean"),
        ({"output": "th", "units": {"omm": "1"}}, "plant.units.omm", "Did you mean `om`"),
    ],
)
def test_what_is_wrong_is_said_at_its_key(change: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        hgorun.simulate(examples.experiment(PENDULUM | change, {}, end=1))
    assert error.value.key == key
