"""Parameters, initial state and inputs of the plant on a page: the numbers of ``hgorun simulate``, without new code."""

from __future__ import annotations

from pathlib import Path

import pytest
from live import Live
from test_session import numbers, sorted_digits, written

from hgorun import load, simulate
from hgorun.explore.state import State

DRIVEN = """\
time: {end: 2, output_step: 0.05}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: -k*x1 - d*x2 + u + v + w - c/100}
  output: x1
  parameters: {k: 4, d: k/10, c: 2*pi}
  inputs: {u: 0.5*sin(3*t) + 0.5*t**(4/2), v: 1.5, w: "where(t < 1, 0, -2)"}
  initial: {x1: 1, x2: 0}
  units: {x1: m, u: N, v: N}
measurement: {sampling: {period: 0.1}}
observers:
  S: {type: shgo, theta: 3, poles: [-1, -2]}
solver: {method: rk4, step: 0.01}
"""


@pytest.fixture
def live(tmp_path: Path) -> Live:
    path = tmp_path / "a.yaml"
    path.write_text(DRIVEN)
    return Live(path)


def test_every_number_of_the_plant_can_be_varied(live: Live) -> None:
    """But for a parameter that follows from another, and an exponent."""
    knobs = {name: knob for name, knob in live.bench.knobs.items() if knob.group == "plant"}
    assert {name: (knob.start, knob.unit) for name, knob in knobs.items()} == {
        "plant.parameters.k": (4.0, ""),
        "plant.parameters.c": (6.283185307179586, ""),
        "plant.initial.x1": (1.0, "m"),
        "plant.initial.x2": (0.0, ""),
        "plant.inputs.u.1": (0.5, ""),
        "plant.inputs.u.2": (3.0, ""),
        "plant.inputs.u.3": (0.5, ""),
        "plant.inputs.v": (1.5, "N"),
        "plant.inputs.w.1": (1.0, ""),
        "plant.inputs.w.2": (0.0, ""),
        "plant.inputs.w.3": (2.0, ""),
    }
    assert knobs["plant.inputs.u.2"].label == "3 in u = 0.5*sin(3*t) + 0.5*t**(4/2)"
    assert knobs["plant.inputs.u.3"].label == "0.5 (its number 3) in u = 0.5*sin(3*t) + 0.5*t**(4/2)"
    assert (knobs["plant.initial.x1"].low, knobs["plant.initial.x1"].high) == (0.0, 3.0)
    assert (knobs["plant.initial.x2"].low, knobs["plant.initial.x2"].high) == (-1.0, 1.0)


def test_numbers_of_one_expression_are_changed_side_by_side(live: Live) -> None:
    state = State()
    for name, value in (("u.3", 0.25), ("u.1", -2.0), ("w.3", 1e-7)):
        state = state.with_value(live.bench.knobs[f"plant.inputs.{name}"], value)
    assert state.changes(live.bench.knobs) == {
        "plant.inputs.u": "(-2.0)*sin(3*t) + 0.25*t**(4/2)",
        "plant.inputs.w": "where(t < 1, 0, -1e-07)",
    }


def test_what_is_shown_is_what_is_simulated_and_needs_no_new_code(live: Live) -> None:
    before = live.digits
    for name, value in (
        ("parameters.k", 5.0),
        ("initial.x2", -0.25),
        ("inputs.u.2", 2.5),
        ("inputs.v", 0.75),
        ("inputs.w.1", 0.5),
    ):
        state = live.session.history.present.with_value(live.bench.knobs[f"plant.{name}"], value)
        assert live.bench.ready(state).compiled
        told = live.set(f"plant.{name}", value)
        assert told.get("error", "") == ""
        assert live.digits != before
        before = live.digits
    file = written(live)
    assert sorted_digits(live.digits) == sorted_digits(numbers(simulate(load(file))))
    text = file.read_text()
    assert "d: k/10" in text  # it still follows from k
    assert "0.5*sin(2.5*t) + 0.5*t**(4/2)" in text
    again = Live(live.bench.path, query=told["query"])
    assert again.digits == live.digits
    for _ in range(5):
        live.ask("undo")
    assert live.digits == Live(live.bench.path).digits
