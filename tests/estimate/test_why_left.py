"""What is said of an observer that is lost on a recording."""

from __future__ import annotations

import numpy as np
import pytest
from examples import inline
from recordings import PENDULUM, observers, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.why_left import Followed, grown


@pytest.mark.parametrize(
    ("xhat", "rest", "said"),
    [
        ([1.0, -5e5], [2.0], "its estimate of b grew until a = 1, b = -5e+05 at t = 3"),
        ([1.0, -5.0], [4e9], "its own states (its gain, P) grew to 4e+09 while it estimated a = 1, b = -5 at t = 3"),
        ([1.0, -5.0], [2.0], "its numbers grew within one step from the estimates a = 1, b = -5 at t = 3"),
    ],
)
def test_what_grew_is_named(xhat: list[float], rest: list[float], said: str) -> None:
    before = Followed(np.arange(3.0), np.ones((3, 2)), np.full((3, 1), 2.0))
    last = Followed(np.array([3.0]), np.array([xhat]), np.array([rest]))
    assert grown(("a", "b"), before, last, "t = 3", 1e13) == said


def test_of_long_logs_the_bound_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hgorun.estimate.why_left._MOST", 10)
    taken = np.arange(0, 2, 0.1)
    text = {"plant": PENDULUM, "observers": observers("shgo"), "solver": {"step": 0.02, "divergence": 0.7}}
    found = estimate(source(text), recording(signal("a", taken, np.sin(taken))), sensitivity=False)
    (trouble,) = found.troubles()
    assert "its numbers passed the bound of 0.7 (solver.divergence): look at" in trouble


@pytest.mark.parametrize(
    ("gaps", "said"),
    [  # errors of the SHGO of three integrators grow from theta T = 2.896 on, computed apart from this program
        ([0.1], "the period 0.1 s, since even small errors grow: they do not with theta of at most 28, or a period of "
         "at most 0.057 s; "),
        ([0.07, 0.1], "the longest usual gap 0.1 s, since even small errors grow: they do not with theta of at most "
         "28, or a longest usual gap of at most 0.057 s; "),
        ([0.05], None),
    ],
)  # fmt: skip
def test_a_theta_that_is_too_large_for_the_samples_is_named(gaps: list[float], said: str | None) -> None:
    taken = np.concatenate([[0.0], np.cumsum(np.resize(gaps, 40))])
    plant = inline({"x1": "x2", "x2": "x3", "x3": "0"}, "x1")
    observer = {"S": {"type": "shgo", "theta": 50, "initial": {"x1": 1}}}
    text = {"plant": plant, "observers": observer, "solver": {"step": 0.005, "divergence": 1e6 if said else 10.0}}
    found = estimate(source(text), recording(signal("x1", taken, np.zeros(41))), sensitivity=False)
    (trouble,) = found.troubles()
    if said is None:
        assert "too large" not in trouble
    else:
        assert f"theta = 50 is too large for {said}its " in trouble
        assert "look at" not in trouble
