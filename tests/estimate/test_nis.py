"""The normalised innovation of late samples: innovation and variance are of one moment."""

from __future__ import annotations

import numpy as np
import pytest
from examples import inline
from recordings import recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate

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
