"""A stream ends its steps at kinks and jumps of functions of time where a file does, and has its bits."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block
from recordings import recording, signal, source

from hgorun.estimate.completed import streamed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.steps.breaks import KinksAhead, breaks_of
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

STEP = 1 / 64
SHGO: Block = {"type": "shgo", "theta": 2, "poles": -1, "initial": {"a": 0.5, "b": 0.0}}
EKF: Block = {
    "type": "ekf",
    "Q": {"b": 0.1},
    "R": {"a": 0.01},
    "internal": {"P": 0.01},
    "initial": {"a": 0.5, "b": 0.0},
}


def text_of(u: str, observer: Block, start: float = 0.0, *, automatic: bool = False) -> Block:
    return {
        "plant": {"states": ["a", "b"], "inputs": {"u": u}, "dynamics": {"a": "b", "b": "-sin(a) + u"}, "output": "a"},
        "observers": {"O": observer},
        "time": {"start": start, "end": start + 8.0, "output_step": 0.125},
        **({} if automatic else {"solver": {"step": STEP}}),
    }


def experiment_of(text: Block) -> Experiment:
    given = source(text)
    return streamed(given, StatedOfData.of(given), "e")


def of_file(text: Block, t: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    log = recording(signal("a", t, np.cos(t), known))
    return np.array(estimate(source(text), log, sensitivity=False).observers["O"].xhat)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("u", "start", "observer"),
    [
        ("abs(sin(3*t))", 0.0, SHGO),
        ("sign(sin(9*t))", 0.0, EKF),
        ("max(sin(2*t), 0.1*sin(40*t))", 3.0, SHGO),
        ("floor(2*t + 0.1)", 100.0, EKF),
        ("1e9*(t > 1.25)*(t < 1.25 + 1e-12) + 1e9*(t > 2.3)*(t < 2.3 + 1e-12)", 0.0, SHGO),
    ],
)
def test_a_stream_has_the_bits_of_a_file(
    u: str, start: float, observer: Block, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hgorun.estimate.steps.breaks._PIECE", 100.0)  # 1.6 of 8
    t, text = start + np.arange(65) / 8, text_of(u, observer, start)
    experiment, whole = experiment_of(text), of_file(text, t)
    one, several = Estimator(experiment), Estimator(experiment, remembered=0)
    found, together, k = [], [], 0
    for time in t.tolist():
        one.update(time, {"a": np.cos(time)})
        found.append(one.estimate()["O"].copy())
    np.testing.assert_array_equal(found, whole)
    kinds, calls = np.zeros(t.size, dtype=np.int64), 0
    while k < t.size:
        count = several.at_once(t[k:], kinds[k:])
        if count:
            some = slice(k, k + count)
            together += list(several.update_many(t[some], kinds[some], np.cos(t[some]))["O"][0])
        else:
            several.update(float(t[k]), {"a": float(np.cos(t[k]))})
            together.append(several.estimate()["O"].copy())
        k, calls = k + max(count, 1), calls + 1
    np.testing.assert_array_equal(together, whole)
    assert calls < t.size


def test_with_late_samples_and_predictions() -> None:
    t = np.arange(65) / 8
    known = t + np.where((np.arange(t.size) % 5 == 3) & (t < 7), 3 / 16, 0.0)
    text = text_of("sign(sin(9*t))", {**EKF, "late": "replay"})
    estimator = Estimator(experiment_of(text))
    for when, taken in sorted(zip(known.tolist(), t.tolist(), strict=True)):
        estimator.update(taken, {"a": np.cos(taken)}, available=when)
        estimator.predict(when + 1.0)
    np.testing.assert_array_equal(estimator.estimate()["O"], of_file(text, t, known)[-1])


def test_beside_shorter_first_steps() -> None:
    """With P(0) = 1 beside R = 1e-6 the first steps are short, and there is a kink among them."""
    fast = {**EKF, "type": "kalman_bucy", "R": {"a": 1e-6}, "internal": {"P": 1.0}}
    text = text_of("sign(sin(9*t - 0.01))", fast, automatic=True)
    experiment = experiment_of(text)
    ahead = breaks_of(experiment, 0.01)
    assert isinstance(ahead, KinksAhead)
    early = ahead.first.times
    between = np.array(list(ahead.between(0.0, 1.0)))
    assert early.size > 3
    np.testing.assert_array_equal(np.sort(between), between)
    assert set(early[early < 1.0].tolist()) <= set(between.tolist())
    np.testing.assert_allclose(np.setdiff1d(between, early), (0.01 + np.pi * np.arange(3)) / 9, rtol=1e-12)


def test_a_pole_is_refused_when_it_is_seen() -> None:
    text = text_of("1/(t - 2)", SHGO)
    with pytest.raises(ValueError, match=r"plant.inputs.u: this is not finite at t = 2"):
        Estimator(experiment_of(text)).update(1.0, {"a": 0.0})


def test_without_kinks_nothing_is_sought() -> None:
    assert not isinstance(breaks_of(experiment_of(text_of("sin(9*t)", SHGO)), STEP), KinksAhead)
