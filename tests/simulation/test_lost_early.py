"""An observer that its gains lose is lost with all steps: that is found out with few of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import yaml

from hgorun import Experiment, simulate
from hgorun.simulation.divergence.verdict import grow_alike
from hgorun.simulation.error_control import control
from hgorun.simulation.passes.between_steps import Missed
from hgorun.simulation.passes.passes import Again, Pass

# A theta of 40 is far too large for samples every 0.2, and nothing else bounds the error of a chain of integrators.
SAMPLED = """\
time: {end: 12, output_step: 0.02}
plant: {type: integrator_chain, n: 2, phi: 0, initial: {x1: 1, x2: 0}}
measurement: {sampling: {period: 0.2}}
observers:
  lost: {type: shgo, theta: 40, poles: -1}
  sound: {type: shgo, theta: 1, poles: -1}
"""
# Without samples, steps of 0.02 are too long for a pole at -400: only shorter ones follow it.
STIFF = SAMPLED.replace("measurement: {sampling: {period: 0.2}}\n", "").replace("theta: 40", "theta: 400")


def run(text: str) -> Experiment:
    return Experiment(yaml.safe_load(text), name="test")


@pytest.fixture
def shorter(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many times shorter the steps were of what has been carried out again."""
    real, found = Again.plan, list[int]()

    def plan(self: Again, times: int = 1) -> Any:
        found.append(times)
        return real(self, times)

    monkeypatch.setattr(Again, "plan", plan)
    return found


def test_growth_that_shorter_steps_repeat_is_followed_no_further(shorter: list[int]) -> None:
    found = simulate(run(SAMPLED + "solver: {method: rk4, step: 0.01}\n"))
    assert [found.observers[label].status for label in ("lost", "sound")] == ["diverged", "ok"]
    assert [times for times in shorter if times > 1] == [4]


def test_growth_that_is_of_the_steps_ends_with_shorter_ones(shorter: list[int]) -> None:
    """The two growths differ, since each is that of its steps."""
    found = simulate(run(STIFF + "solver: {method: rk4, step: 0.05}\n"))
    assert found.observers["lost"].status == "inaccurate"
    assert "but not with shorter ones: give a step of at most 0.00313" in str(found.observers["lost"].verdict.reason)
    assert max(shorter) == 16


def test_growth_is_alike_where_it_is_a_thousandfold() -> None:
    """Of exp(t), followed with the factors per step of two steps of Euler's method, and nearly exactly."""
    t = np.arange(0.0, 12.0)
    x = np.zeros((t.size, 1))
    exact, near, half, whole = (f ** t[:, None] for f in (math.e, 1.0005 * math.e, 2.25, 2.0))
    assert grow_alike(x, exact, near)  # 0.4 % apart where the error is beyond 1000: at t = 7
    assert not grow_alike(x, whole, half)
    assert not grow_alike(x[:6], exact[:6], near[:6])  # it has grown to 148
    assert not grow_alike(x, exact, np.where(t[:, None] < 7, exact, np.nan))  # the other one has ended


def test_a_peak_that_steps_resolve_alike_is_not_the_growth_that_loses() -> None:
    """The observer comes back from it, and what it is lost with later differs between the steps."""
    t = np.arange(0.0, 24.0)
    x, peak = np.zeros((t.size, 1)), np.exp(np.where(t < 9, t, 0.0))[:, None]
    after = np.maximum(t - 12, 0.0)[:, None]
    one, two, other = (peak + f**after for f in (math.e, 1.0005 * math.e, 2.25))
    assert not grow_alike(x, one, other)
    assert grow_alike(x, one, two)


# With theta = 300 the estimate starts with a peak of theta^2 times the first error, which steps of 5e-4 resolve; from
# t = 2 on the estimate of x3 decays with the rate 40001, for which they are seven times too long.
PEAKED = """\
time: {start: 0, end: 4, output_step: 0.005}
plant:
  states: [x1, x2, x3]
  dynamics: {x1: x2, x2: x3, x3: "-(1 + 40000*where(t >= 2, 1, 0))*x3"}
  output: x1
  initial: {x1: 1, x2: 0, x3: 0}
observers: {H: {type: shgo, theta: 300, initial: {x1: 0}}}
solver: {method: rk4, step: 5.0e-4}
"""


@pytest.mark.parametrize("output_step", [0.005, 0.5])
def test_an_observer_that_shorter_steps_follow_is_inaccurate_whatever_is_written(output_step: float) -> None:
    """Whether the points of the output see its peak, or not."""
    found = simulate(run(PEAKED.replace("output_step: 0.005", f"output_step: {output_step}"))).observers["H"]
    assert found.status == "inaccurate"
    assert "diverges with steps of 0.0005, but not with shorter ones" in str(found.verdict.reason)


def test_what_a_lost_observer_passes_matters_up_to_its_loss_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is asked of the steps between: of the first search up to the loss, of the next one nothing."""
    asked: list[dict[str, float]] = []

    def missed(run: Any, how: Pass, lost: Mapping[str, float]) -> Missed:
        asked.append(dict(lost))
        return Missed(narrow={"lost": np.array([0.31])}) if len(asked) == 1 else Missed()

    monkeypatch.setattr(control, "missed", missed)
    found = simulate(run(SAMPLED))
    assert [found.observers[label].status for label in ("lost", "sound")] == ["diverged", "ok"]
    at = found.observers["lost"].verdict.at
    assert at is not None
    assert [list(one) for one in asked] == [["lost"], ["lost"]]
    assert 0 < asked[0]["lost"] <= at + 0.5
    assert asked[1]["lost"] == -np.inf
