"""A long run is tabulated part by part while it is carried out: the tables and the bits of the whole at once."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment

from hgorun.simulation.passes.passes import as_given, carry_out, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare
from hgorun.simulation.timeline import actions, tabulated

DRAWN = {"type": "gaussian", "std": 0.1}
HELD = {"type": "uniform", "low": -0.1, "high": 0.1, "hold": 0.07}
SHGO: dict[str, Block] = {"H": {"type": "shgo", "theta": 2}}
CASES: dict[str, dict[str, Any]] = {
    "sampled": {"measurement": {"sampling": {"period": 0.1}, "noise": [DRAWN]}},
    "jitter and losses": {"measurement": {"sampling": {"period": 0.1, "jitter": 0.04, "dropout": 0.3}}},
    "late by turns": {"measurement": {"sampling": {"period": 0.1}, "delay": "0.2 + 0.19*sin(5*t)"}},
    "held noise": {"measurement": {"noise": [HELD]}},
    "phases": {
        "measurement": {"phases": [{"until": 1, "sampling": {"period": 0.1}}, {"until": 9, "noise": [HELD]}]},
    },
    "jumps": {"measurement": {"sampling": {"period": 0.1}}, "observers": {"D": {"type": "deadbeat"}}},
    "adaptive": {"measurement": {"noise": [HELD]}, "solver": {"method": "dopri5", "rtol": 1e-6}},
}


def prepared(observers: dict[str, Block] = SHGO, **more: Any) -> PreparedRun:
    return prepare(experiment(VAN_DER_POL, observers, end=3.0, output_step=0.03, step=0.02, **more))


@pytest.mark.measured("sampled-None")
@pytest.mark.costly
@pytest.mark.parametrize("uneven", [None, 0.62])
@pytest.mark.parametrize("case", CASES)
def test_parts_are_those_of_the_whole(case: str, uneven: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    run = prepared(**CASES[case])
    how = as_given(run)
    if uneven is not None and how.tolerance is None:
        how = type(how)(method=how.method, step=how.step, uneven=uneven)
    whole, start = plan_of(run, how)
    monkeypatch.setattr(tabulated, "_PART_EVENTS", 7)
    plan, _ = plan_of(run, how, in_parts=True)
    assert plan.following is not None
    assert (plan.steps, plan.span) == (whole.steps, whole.span)
    expected, found = carry_out(run, how, whole, start), carry_out(run, how, plan, start)
    for field in fields(expected):
        np.testing.assert_array_equal(getattr(found, field.name), getattr(expected, field.name))
    one = plan.whole()
    assert one.following is None
    np.testing.assert_array_equal(one.spans, whole.spans)
    np.testing.assert_array_equal(one.counts, whole.counts)
    np.testing.assert_array_equal(one.actions, whole.actions)


def test_a_plan_that_needs_the_history_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tabulated, "_PART_EVENTS", 7)
    run = prepared(measurement={"delay": 0.1, "noise": [HELD]})
    assert plan_of(run, as_given(run), in_parts=True)[0].following is None


def test_a_long_run_tells_its_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tabulated, "_PART_EVENTS", 7)
    run, told = prepared(**CASES["sampled"]), list[float]()
    how = as_given(run)
    carry_out(run, how, *plan_of(run, how, in_parts=True), told.append)
    assert told == sorted(told)
    assert 0 < told[0] < 0.5
    assert told[-1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("case", CASES)
def test_what_happens_together_is_as_if_it_were_sorted(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples that arrive when they are taken, and whatever else: one table."""
    run = prepared(**CASES[case])
    kinds = actions.Actions(run.timeline.events, run.channels, run.structure.system, None)
    ranges = [(0, run.schedule.events.size), (1, 9), (3, 3), (run.schedule.events.size - 2, run.schedule.events.size)]
    found = [kinds.at(*one) for one in ranges]
    monkeypatch.setattr(actions, "_alike", lambda found: False)
    for one, (rows, places) in zip(ranges, found, strict=True):
        expected = kinds.at(*one)
        np.testing.assert_array_equal(rows, expected[0])
        np.testing.assert_array_equal(places, expected[1])
    if case == "sampled":
        monkeypatch.undo()
        monkeypatch.setattr(np, "argsort", None)  # there is nothing to sort
        kinds.at(2, 12)
