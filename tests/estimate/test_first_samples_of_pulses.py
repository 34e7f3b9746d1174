"""Starts that are fitted where an input is a pulse between two samples: c' = -k c + u has a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import inline
from recordings import held_input, recording, signal, source

from hgorun.data.recording import InputSignal
from hgorun.errors import ConfigError
from hgorun.estimate.completed import completed
from hgorun.estimate.start import steps

RATE, START, COUNT = 0.01, 4.0, 4
TAKEN = 60.0 * np.arange(COUNT)
FROM = 20.3  # seconds behind a sample


def sampled(length: float, pulses: int = COUNT) -> np.ndarray:
    """c at the samples, beside pulses of the area 2 behind the first ones of them."""
    t, c = TAKEN, START * np.exp(-RATE * TAKEN)
    for begin in TAKEN[:pulses] + FROM:
        end, behind = begin + length, t > begin + length
        c[behind] += 2 / length * (np.exp(-RATE * (t[behind] - end)) - np.exp(-RATE * (t[behind] - begin))) / RATE
    return c


def start_of(c: np.ndarray, recorded: InputSignal | None = None, function: str = "0", inflow: str = "u") -> float:
    """That of c' = -k c + inflow + function."""
    plant = inline({"c": f"-{RATE}*c + {inflow} + {function}"}, {"y": "c"})
    del plant["initial"]
    log = recording(signal("y", TAKEN, c, std=0.05, gate=5.0))
    log = replace(log, inputs={} if recorded is None else {"u": recorded}, first_samples=COUNT)
    config = {"plant": {**plant, "inputs": {"u": "0"}}, "observers": {"o": {"type": "shgo", "theta": 0.02}}}
    return completed(source({**config, "solver": {"step": 0.5}}), log, "start", "").observers["o"].initial["c"]


def pulses(length: float) -> InputSignal:
    """Such pulses as they are recorded."""
    times = np.concatenate([[0.0], np.stack([TAKEN + FROM, TAKEN + FROM + length], axis=1).ravel()])
    return held_input("u", times, np.append(0.0, np.tile([2 / length, 0.0], COUNT)))


@pytest.mark.parametrize("length", [2.0, 1e-3])
def test_pulses_that_are_recorded_count_however_short_they_are(length: float) -> None:
    """Moments at which all steps look at u, however often they are halved, lie beside a short one."""
    assert start_of(sampled(length), pulses(length)) == pytest.approx(START, abs=1e-6)


def test_pulses_that_are_functions_of_time_count() -> None:
    """The derivative at either side of a jump is that of its own side."""
    length = 1e-2
    pulse = f"where(t > {FROM}, where(t > {FROM + length}, 0, {2 / length}), 0)"
    assert start_of(sampled(length, 1), function=pulse) == pytest.approx(START, abs=1e-6)


def test_lines_between_recorded_values_bend_where_steps_end() -> None:
    """A triangle of 0.02 s, whose area is 2, as nearly as the decay within it matters."""
    begins = TAKEN + FROM
    times = np.concatenate([[0.0], np.stack([begins, begins + 0.01, begins + 0.02], axis=1).ravel()])
    since = TAKEN[:, None] - begins - 0.01
    c = START * np.exp(-RATE * TAKEN) + 2 * np.sum(np.where(since > 0, np.exp(-RATE * since), 0.0), axis=1)
    line = held_input("u", times, np.append(0.0, np.tile([0.0, 200.0, 0.0], COUNT)), hold="linear")
    assert start_of(c, line) == pytest.approx(START, abs=1e-6)


def test_of_too_many_changes_the_largest_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small ones between the pulses are followed as far as steps look at them."""
    monkeypatch.setattr(steps, "_MOST_CHANGES", 8)
    whole = pulses(0.5)
    times = np.sort(np.concatenate([whole.times, np.arange(0.7, 200, 1.3)]))
    at = np.searchsorted(whole.times, times, side="right") - 1
    ripple = 1e-6 * (-1.0) ** np.arange(times.size)
    values = whole.values[at] + np.where(np.isin(times, whole.times), 0.0, ripple)
    assert start_of(sampled(0.5), held_input("u", times, values)) == pytest.approx(START, abs=1e-3)


def switched(value: float, inflow: float) -> tuple[np.ndarray, InputSignal]:
    """c at the samples where an input is switched on 4 times a second, and the input."""
    period, duty = 0.25, 0.4
    on = np.arange(0, TAKEN[-1], period)
    times = np.stack([on, on + duty * period], axis=1).ravel()
    ends = np.append(times, TAKEN[-1])
    c = [START]
    for u, factor in zip(np.tile([inflow, 0.0], on.size), np.exp(-RATE * np.diff(ends)), strict=True):
        c.append(c[-1] * factor + u / RATE * (1 - factor))
    assert times.size > 1024
    return np.array(c)[np.searchsorted(ends, TAKEN)], held_input("u", times, np.tile([value, 0.0], on.size))


def test_inputs_that_change_too_often_count_by_their_means() -> None:
    """Steps that looked at u at some moments saw a part of it as another mean."""
    assert start_of(*switched(0.1, 0.1)) == pytest.approx(START, abs=2e-3)


@pytest.mark.parametrize(("value", "inflow"), [(24.0, "u**2/5760"), (-24.0, "abs(u)/240")])
def test_all_changes_of_inputs_are_followed_whose_means_say_nothing(value: float, inflow: str) -> None:
    """The mean of a square is not the square of the mean."""
    assert start_of(*switched(value, 0.1), inflow=inflow) == pytest.approx(START, abs=1e-6)


def test_more_changes_of_such_inputs_than_can_be_followed_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps, "_MOST", 1024)
    with pytest.raises(ConfigError, match="the model or its inputs change too fast"):
        start_of(*switched(24.0, 0.1), inflow="u**2/5760")


def test_a_held_input_may_change_at_every_sample() -> None:
    """Also at the last one, as in a table of both; the last step ends before that."""
    values, decay, c = np.array([0.1, 0.9, 0.2, 50.0]), np.exp(-RATE * 60), [START]
    for value in values[:-1]:
        c.append(c[-1] * decay + value * (1 - decay) / RATE)
    assert start_of(np.array(c), held_input("u", TAKEN, values)) == pytest.approx(START, abs=1e-5)
