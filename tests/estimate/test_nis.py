"""The normalised innovation, also where several samples correct at one moment: innovation and variance are of one."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, inline
from recordings import recorded_of, recording, signal, source

from hgorun.data.recording import Signal
from hgorun.estimate.estimate import estimate
from hgorun.result.records.recorded import Recorded

Q, R = 0.2, 0.01


@pytest.mark.parametrize("order", [("replay", "drop"), ("drop", "replay")], ids=lambda order: order[0])
def test_late_samples_are_judged_by_the_variance_of_when_they_were_taken(order: tuple[str, str]) -> None:
    """x' = 0 with process noise: P grows by Q t from what an update has left of it, P R/(P + R).

    What observers made of the samples stands in the order of the configuration, whichever are taken back in a run.
    """
    taken = np.arange(0.5, 10.0)
    available = taken + np.where(np.arange(taken.size) % 3 == 1, 0.7, 0.0)  # every third, after no newer one
    y = np.random.default_rng(0).standard_normal(taken.size)
    block = {"type": "ekf", "Q": {"x": Q}, "R": R, "initial": {"x": 0.0}, "internal": {"P": 1.0}}
    plant = {key: value for key, value in inline({"x": "0"}, "x").items() if key != "initial"}
    observers = {late: block | {"late": late} for late in order}
    config = {"plant": plant, "observers": observers, "solver": {"step": 0.1}, "time": {"start": 0.0}}
    recorded = recording(signal("x", taken, y, available))
    one = recorded_of(estimate(source(config), recorded, sensitivity=False)).outputs["x"]
    for j, late in enumerate(order):
        P, x, last = 1.0, 0.0, 0.0
        for k, t in enumerate(taken):
            P, last = P + Q * (t - last), t
            expected = (y[k] - x) ** 2 / (P + R)
            takes = late == "replay" or available[k] == t  # a late one is in before the next is taken
            assert one.used[k, j] == takes
            assert one.innovation[k, j] == pytest.approx(y[k] - x, rel=1e-6)
            assert one.nis[k, j] == pytest.approx(expected, rel=1e-4)
            if takes:
                x, P = x + P / (P + R) * (y[k] - x), P * R / (P + R)


def found(config: Block, *outputs: Signal) -> Recorded:
    """What an ekf of x, in which two outputs are measured, makes of them."""
    block = {"type": "ekf", "Q": {"x": Q}, "R": R, "initial": {"x": 0.0}, "internal": {"P": 1.0}}
    plant = {key: value for key, value in inline({"x": "0"}, {"a": "x", "b": "x"}).items() if key != "initial"}
    whole = {"plant": plant, "observers": {"K": block | config}, "solver": {"step": 0.1}, "time": {"start": 0.0}}
    return recorded_of(estimate(source(whole), recording(*outputs), sensitivity=False))


def test_samples_of_one_time_are_judged_one_after_the_other() -> None:
    """The second of an output at one time meets what the first has left of P; two outputs are judged together."""
    taken = np.repeat(np.arange(1.0, 8.0), 2)
    y, z = np.random.default_rng(1).standard_normal((2, taken.size))
    one = found({}, signal("a", taken, y), signal("b", taken[::2], z[::2]))
    P, x, last, judged = 1.0, 0.0, 0.0, []
    for k in range(0, taken.size, 2):
        P, last = P + Q * (taken[k] - last), taken[k]
        for first, values in (True, [y[k], z[k]]), (False, [y[k + 1]]):
            judged.append(((values[0] - x) ** 2 / (P + R), (z[k] - x) ** 2 / (P + R) if first else None))
            S = P + R / len(values)  # as one sample of their mean
            x, P = x + P / S * (np.mean(values) - x), P - P * P / S
    assert one.outputs["a"].nis[:, 0] == pytest.approx([of_a for of_a, _ in judged], rel=1e-7)
    assert one.outputs["b"].nis[:, 0] == pytest.approx([of_b for _, of_b in judged if of_b is not None], rel=1e-7)


@pytest.mark.parametrize("gate", [None, 1e3])
def test_a_sample_is_judged_behind_a_late_one_that_comes_with_it(gate: float | None) -> None:
    """Of b every sample comes a second late, when one of a is taken, and is gone back to."""
    taken = np.arange(1.0, 9.0)
    y, z = np.random.default_rng(2).standard_normal((2, taken.size))
    one = found({"late": "replay"}, signal("a", taken, y, gate=gate), signal("b", taken[:-1], z[:-1], taken[1:]))
    P, x, last = 1.0, 0.0, 0.0
    for k, t in enumerate(taken):
        if k:  # at the time of the last sample of a, where both are taken as one
            S = P + R / 2
            x, P = x + P / S * ((y[k - 1] + z[k - 1]) / 2 - x), P - P * P / S
        P, last = P + Q * (t - last), t
        assert one.outputs["a"].innovation[k, 0] == pytest.approx(y[k] - x, rel=1e-7)
        assert one.outputs["a"].nis[k, 0] == pytest.approx((y[k] - x) ** 2 / (P + R), rel=1e-7)


@pytest.mark.parametrize("gate", [None, 5.0])
@pytest.mark.parametrize("late", [0.0, 0.7])
def test_the_unscented_filter_judges_samples_by_its_own_mean_and_variance(gate: float | None, late: float) -> None:
    """Of y = x^2 with three points: E y = m^2 + P, var y = 2 P^2 + 4 m^2 P, cov(x, y) = 2 m P."""
    taken = np.arange(0.5, 10.0)
    y = 1 + 0.05 * np.random.default_rng(3).standard_normal(taken.size)
    available = taken + np.where(np.arange(taken.size) % 3 == 1, late, 0.0)
    block = {"type": "ukf", "Q": {"x": Q}, "R": R, "kappa": 2, "initial": {"x": 0.05}, "internal": {"P": 1.0}}
    plant = {key: value for key, value in inline({"x": "0"}, {"y": "x**2"}).items() if key != "initial"}
    config = {"plant": plant, "observers": {"U": {**block, "late": "replay"}}, "time": {"start": 0.0}}
    recorded = recording(signal("y", taken, y, available, gate=gate))
    result = estimate(source({**config, "solver": {"step": 0.1}}), recorded, sensitivity=False)
    one = recorded_of(result).outputs["y"]
    P, m, last = 1.0, 0.05, 0.0
    for k, t in enumerate(taken):
        P, last = P + Q * (t - last), t
        S = 2 * P**2 + 4 * m**2 * P + R
        assert one.innovation[k, 0] == pytest.approx(y[k] - m**2 - P, rel=1e-6)
        assert one.nis[k, 0] == pytest.approx((y[k] - m**2 - P) ** 2 / S, rel=1e-5)
        m, P = m + 2 * m * P / S * (y[k] - m**2 - P), P - (2 * m * P) ** 2 / S
    assert one.used.all()
