"""Numbers of filters that follow from the time between samples: from the mean of those that are used."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from recordings import recording, signal, source

from hgorun.estimate.completed import completed, streamed
from hgorun.estimate.holdout import HoldOut, held_out
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.simulation.experiment.experiment import Experiment

PLANT = {"states": ["x", "v"], "dynamics": {"x": "v", "v": "-x"}, "output": "x"}
START = {"x": 1.0, "v": 0.0}
FILTERS = {
    "KB": {"type": "kalman_bucy", "theta": 2.0, "initial": START},
    "EKF": {"type": "ekf", "theta": 2.0, "initial": START},
    "HG": {"type": "hg_ekf", "theta": 2.0, "update": "jump", "initial": START},
}
BURSTS = np.sort(np.concatenate([second + np.arange(6) / 50 for second in range(20)]))


def whole(taken: Any, observers: dict[str, Any] = FILTERS, every: int = 0, **more: Any) -> Experiment:
    """The observers of a recording with samples at these times, every so many-th held out."""
    of = recording(signal("x", taken, np.cos(taken), std=0.1))
    if every:
        of, _ = held_out(of, [HoldOut("x", every)])
    return completed(source({"plant": PLANT, "observers": observers, **more}), of, "estimate", "")


def intervals(experiment: Experiment) -> dict[str, float]:
    """T of each filter, by its numbers: R_c = var T, q = var T theta^4, R/T."""
    of = {label: design.gains for label, design in experiment.designs.items()}
    assert of["KB"]["q"] == pytest.approx(of["KB"]["R"] * 16)
    return {
        "KB": float(of["KB"]["R"][0]) / 0.01,
        "EKF": float(of["EKF"]["q"][0]) / 0.16,
        "HG": 1 / float(of["HG"]["R"][0]),
    }


@pytest.mark.parametrize(
    ("taken", "every", "more", "mean"),
    [
        (BURSTS, 0, {}, 19.1 / 119),
        (np.arange(31) / 10, 3, {}, (3.0 - 0.0) / 20),  # 0, 0.2, 0.3, 0.5 ... : the median is 0.1
        (np.concatenate([np.arange(11.0), 100.0 + np.arange(11.0)]), 0, {}, 110 / 21),  # with a night between
        (np.repeat(np.arange(11.0), 2), 0, {}, 10 / 21),
        (BURSTS, 0, {"time": {"start": 0.95, "end": 3.5}}, 2.1 / 17),
    ],
)
def test_the_mean_time_between_the_samples_that_are_used(taken: Any, every: int, more: Any, mean: float) -> None:
    found = intervals(whole(taken, every=every, **more))
    assert found == pytest.approx(dict.fromkeys(found, mean), rel=1e-12)


@pytest.mark.parametrize(("stated", "of_output"), [(0.1, False), (0.1, True), (0.10001, False)])
def test_a_period_that_is_stated_is_that_of_a_stream(stated: float, of_output: bool) -> None:
    """Stamps of 7.3, 7.4, ... are 0.1 apart but for their rounding; a period that differs by more is another one."""
    taken = np.round(7.3 + np.arange(201) / 10, 1)
    sampling = {"sampling": {"period": stated}}
    block = {"outputs": {"x": sampling}} if of_output else sampling
    given = source({"plant": PLANT, "observers": FILTERS, "solver": {"step": 0.01}, "measurement": block})
    of_stream = streamed(given, StatedOfData(inputs=(), gates={}, std={"x": 0.1}, block=None), "stream")
    found, wanted = intervals(whole(taken, measurement=block)), intervals(of_stream)
    assert (found == wanted) == (stated == 0.1)
    assert intervals(whole(taken)) != intervals(of_stream)


def test_as_a_simulation_with_samples_at_these_times() -> None:
    simulated = Experiment(
        {
            "time": {"end": 20.0, "output_step": 0.1},
            "plant": {**PLANT, "initial": START},
            "observers": FILTERS,
            "measurement": {"sampling": {"times": BURSTS.tolist()}, "noise": [{"type": "gaussian", "std": 0.1}]},
        }
    )
    of_recording = whole(BURSTS)
    for again in (of_recording, pickle.loads(pickle.dumps(of_recording)), of_recording.varied({"time.end": 18.0})):
        for label, design in simulated.designs.items():
            for name, value in design.gains.items():
                assert np.array_equal(value, again.designs[label].gains[name]), (label, name)


def test_stamps_that_are_even_but_for_their_rounding_have_one_step() -> None:
    taken = np.round(np.arange(301) * 0.1, 1)
    assert intervals(whole(taken))["KB"] == pytest.approx(float(np.median(np.diff(taken))), rel=1e-15)


def test_a_gain_for_one_period_is_that_of_the_usual_one() -> None:
    taken = np.delete(np.arange(31) / 10, [4, 5, 17])
    exact = {"L": {"type": "luenberger_exact", "poles": [-1.0, -1.2], "initial": START}}
    adaptive = {"A": {"type": "aekf", "theta_1": 2.0, "update": "jump", "copies": 3, "initial": START}}
    even = whole(np.arange(31) / 10, {**exact, **adaptive})
    missing = whole(taken, {**exact, **adaptive})
    assert missing.designs["L"].gains["L"] == pytest.approx(even.designs["L"].gains["L"], rel=1e-12)
    before, now = (one.designs["A"].gains for one in (even, missing))
    assert now["T"] == pytest.approx(before["T"], rel=1e-12)
    assert now["R"] == pytest.approx(1 / (3.0 / 27))
    assert before["R"] == pytest.approx(10.0)
