"""What is said of an observer that is lost on a recording."""

from __future__ import annotations

import numpy as np
import pytest
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
