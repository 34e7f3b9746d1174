"""What is said of an observer that is lost on a recording."""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import inline
from recordings import PENDULUM, held_input, observers, recording, signal, source
from scipy.integrate import quad

from hgorun.estimate.estimate import estimate
from hgorun.estimate.scores.why_left import Followed, grown
from hgorun.result.result import Result


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
    monkeypatch.setattr("hgorun.estimate.scores.why_left._MOST", 10)
    taken = np.arange(0, 2, 0.1)
    text = {"plant": PENDULUM, "observers": observers("shgo"), "solver": {"step": 0.02, "divergence": 0.7}}
    found = estimate(source(text), recording(signal("a", taken, np.sin(taken))), sensitivity=False)
    (trouble,) = found.troubles()
    assert "its numbers passed the bound of 0.7 (solver.divergence): look at" in trouble


@pytest.mark.parametrize(("divergence", "bound"), [(None, "3e+12"), (1e9, "1e+09")])
def test_one_that_is_lost_before_the_first_sample_is_told(divergence: float | None, bound: str) -> None:
    """x'' = x^3 from x = v = 3 on has v^2 = x^4/2 - 31.5, and x grows beyond all numbers in a finite time."""
    escape, _ = quad(lambda x: (x**4 / 2 - 31.5) ** -0.5, 3.0, np.inf)
    text = {
        "time": {"start": 0.0, "end": 4.0},
        "plant": inline({"x": "v", "v": "x**3"}, "x"),
        "observers": {"S": {"type": "shgo", "theta": 3, "initial": {"x": 3, "v": 3}}},
        "solver": {"step": 1e-3} | ({} if divergence is None else {"divergence": divergence}),
    }
    taken = np.arange(3.0, 4.0, 0.1)
    found = estimate(source(text), recording(signal("x", taken, np.zeros(10))), sensitivity=False)
    verdict = found.observers["S"].verdict
    assert verdict.status == "diverged"
    assert verdict.at == pytest.approx(escape, abs=5e-3)
    assert str(verdict.reason).startswith("its estimate of v grew until x = ")
    assert f"the bound is {bound} (solver.divergence): look at its initial values" in str(verdict.reason)


@pytest.mark.parametrize(
    ("gaps", "said"),
    [  # errors of the SHGO of three integrators grow from theta T = 2.896 on, computed apart from this program
        ([0.1], "period"),
        ([0.07, 0.1], "longest usual gap"),
        ([0.05], None),
    ],
)
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
        assert (
            f"theta = 50 is too large for the {said} 0.1 s, since even small errors grow where the estimate begins: "
            f"they do not with theta of at most 28, or a {said} of at most 0.057 s; its "
        ) in trouble
        assert "look at" not in trouble


INTEGRATORS = inline({"x1": "x2", "x2": "x3", "x3": "0"}, "x1")


def followed(taken: np.ndarray, age: np.ndarray | float, divergence: float = 1e6, **keys: object) -> Result:
    """Three integrators at rest, from an estimate beside them."""
    observer = {"S": {"type": "shgo", "theta": 50, "initial": {"x1": 1}, **keys}}
    text = {"plant": INTEGRATORS, "observers": observer, "solver": {"step": 0.01, "divergence": divergence}}
    log = recording(signal("x1", taken, np.zeros(taken.size), taken + age))
    return estimate(source(text), log, sensitivity=False)


@pytest.mark.parametrize(
    ("late", "said"),
    [
        (np.full(60, 0.05), "the period 0.1 s with the delay 0.05 s"),
        (np.resize([0.01, 0.05], 60), "the period 0.1 s with the longest usual delay 0.05 s"),
    ],
)
def test_of_late_samples_the_theta_that_is_advised_holds(late: np.ndarray, said: str) -> None:
    """Beneath it errors vanish, somewhat above it they grow."""
    taken = 0.1 * np.arange(60)
    (trouble,) = followed(taken, late).troubles()
    match = re.search(
        rf"theta = 50 is too large for {said}, since .*: they do not with theta of at most (\S+); ", trouble
    )
    assert match is not None, trouble
    advised = float(match[1])
    slower, faster = (followed(0.1 * np.arange(300), 0.05, 1e13, theta=part * advised) for part in (0.95, 1.05))
    for found, factors in ((slower, (0.0, 0.01)), (faster, (100.0, np.inf))):
        error = np.max(np.abs(found.observers["S"].xhat), axis=1)
        assert factors[0] < np.max(error[-20:]) / np.max(error[:20]) < factors[1]


def test_of_late_samples_that_are_left_out_or_gone_back_to() -> None:
    """The former are as if they had not been, the latter as if they had not been late."""
    taken, late = 0.05 * np.arange(60), np.resize([0.0, 0.06], 60)
    (dropped,) = followed(taken, late, late="drop").troubles()
    assert "theta = 50 is too large for the period 0.1 s, since" in dropped
    (replayed,) = followed(taken, late, theta=80, late="replay").troubles()
    assert "theta = 80 is too large for the period 0.05 s, since" in replayed
    assert "they do not with theta of at most 57, or a period of at most" in replayed  # 2.896 / 0.05


def test_samples_that_newer_ones_overtook_are_none() -> None:
    """Neither their delay counts nor their time, as if they had been left out."""
    taken, late = 0.1 * np.arange(120), np.resize([0.0, 0.0, 0.0, 0.0, 0.0, 0.15], 120)
    (overtaken,), (dropped,) = (followed(taken, late, 1e9, late=how).troubles() for how in ("innovation", "drop"))
    assert "theta = 50 is too large for the longest usual gap 0.2 s, since" in overtaken
    assert overtaken.partition(";")[0] == dropped.partition(";")[0]


@pytest.mark.parametrize(("count", "divergence"), [(5, 1e4), (3, 1e3), (40, 30.0)])
def test_few_samples_tell_it_but_not_before_errors_can_have_grown(count: int, divergence: float) -> None:
    (trouble,) = followed(0.1 * np.arange(count), 0.0, divergence).troubles()
    assert ("too large" in trouble) == (count == 5)


def test_a_recorded_input_is_as_it_is_at_the_start() -> None:
    """The same limits as of one that is written out."""
    taken, found = 0.1 * np.arange(40), []
    for u in ("0", "40"):
        plant = inline({"x1": "x2", "x2": "-u*x2"}, "x1", inputs={"u": u})
        observer = {"S": {"type": "shgo", "theta": 150, "initial": {"x1": 1}}}
        text = {"plant": plant, "observers": observer, "solver": {"step": 0.005, "divergence": 1e9}}
        one = signal("x1", taken, np.zeros(40))
        log = recording(one, u=held_input("u", taken, np.full(40, 40.0))) if u == "0" else recording(one)
        (trouble,) = estimate(source(text), log, sensitivity=False).troubles()
        found += re.findall(r"they do not with theta of at most 83, or a period of at most \S+ s", trouble)
    assert len(found) == 2
    assert found[0] == found[1]
