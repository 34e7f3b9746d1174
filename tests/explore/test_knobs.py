"""What of a configuration can be varied, the states of a page, and their addresses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun import Experiment
from hgorun.errors import ConfigError
from hgorun.explore.knobs import Knob, by_name, knobs_of
from hgorun.explore.state import History, State, from_query
from hgorun.study.loading import load_study

EXPERIMENTS = Path(__file__).parents[2] / "experiments"


def config(**more: Any) -> dict[str, Any]:
    """An oscillator with two observers, sampled late with noise of every kind."""
    return {
        "time": {"end": 4, "output_step": 0.05},
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
        "measurement": {
            "sampling": {"period": 0.1},
            "delay": 0.02,
            "noise": [
                {"type": "gaussian", "std": 0.01},
                {"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 9}, {"amplitude": 0.2, "omega": 7}]},
                {"type": "uniform", "low": -0.1, "high": 0.3},
                {"type": "expression", "value": "0.1*sin(k)"},
                {"type": "outliers", "size": 1, "probability": 0.01},
            ],
        },
        "observers": {
            "F": {"type": "fhgo2", "r": 2, "theta": 2, "poles": ["-1+1j", "-1-1j", -2, -3], "initial": {"x1": 2}},
            "S": {"type": "shgo", "theta": 3, "poles": [-1, -2]},
        },
        "solver": {"step": 0.01},
        **more,
    }


BASE = Experiment(config())
KNOBS = by_name(knobs_of(BASE))


def test_noise_of_a_named_output_is_called_by_it() -> None:
    """As its period and delay are; noise of the same output is counted."""
    gaussian = {"type": "gaussian", "std": 0.1}
    plant = {
        "states": ["h", "T"],
        "dynamics": {"h": "-h", "T": "-T"},
        "output": {"level": "h", "temp": "T"},
        "initial": {"h": 1, "T": 1},
    }
    outputs = {"level": {"noise": [gaussian]}, "temp": {"noise": [gaussian, gaussian]}}
    observers = {"S": {"type": "shgo", "theta": 2}}
    measured = config(plant=plant, observers=observers, measurement={"sampling": {"period": 0.1}, "outputs": outputs})
    labels = [knob.label for knob in knobs_of(Experiment(measured)) if knob.name.endswith("std")]
    assert labels == ["std of noise of level", "std of noise 1 of temp", "std of noise 2 of temp"]
    alone = config(measurement={"sampling": {"period": 0.1}, "noise": [gaussian]})
    assert "std of the noise" in [knob.label for knob in knobs_of(Experiment(alone))]


def test_what_the_configuration_has() -> None:
    assert list(KNOBS) == [
        "observers.F.theta",
        "observers.F.r",
        "observers.F.poles",
        "observers.F.initial error",
        "observers.S.theta",
        "observers.S.poles.0",
        "observers.S.poles.1",
        "observers.S.initial error",
        "measurement.sampling.period",
        "measurement.delay",
        "measurement.noise.0.std",
        "measurement.noise.1.level",
        "measurement.noise.2.level",
        "measurement.noise.3.level",
        "measurement.noise.4.size",
        "seed",
    ]
    assert all(knob.low <= knob.start <= knob.high for knob in KNOBS.values())
    assert KNOBS["measurement.sampling.period"].unit == "s"
    assert {k.scale for k in KNOBS.values()} == {"linear", "log", "integer"}


def test_ranges_keep_to_what_a_key_admits() -> None:
    """Either end of every slider of every built-in experiment is no value that its own key refuses."""
    for path in (
        "robles2023/chapter3/contois_te025.yaml",
        "astolfi2016/noise_linear.yaml",
        "katayama/van_der_pol.yaml",
    ):
        study = load_study(EXPERIMENTS / path)
        experiment = next(iter(study.runs.values())).experiment
        for knob in knobs_of(experiment):
            for value in (knob.low, knob.high):
                experiment.varied(knob.changes(value))


def changed(name: str, value: float) -> Experiment:
    return BASE.varied(State().with_value(KNOBS[name], value).changes(KNOBS))


def test_levels_of_noise_multiply_it() -> None:
    def noise(name: str) -> Any:
        return (changed(name, 2.0).measurement.noise or ())[int(name.split(".")[2])]

    assert [term.amplitude for term in noise("measurement.noise.1.level").terms] == [0.2, 0.4]
    assert (noise("measurement.noise.2.level").low, noise("measurement.noise.2.level").high) == (-0.2, 0.6)
    text = noise("measurement.noise.3.level").value
    assert eval(text, {"sin": math.sin, "k": 0.5}) == pytest.approx(0.2 * math.sin(0.5))


def test_an_initial_error_is_a_part_of_the_file_s() -> None:
    for part in (0.0, 0.5, 3.0):
        initial = changed("observers.F.initial error", part).observers["F"].initial
        assert initial == {"x1": 1 + part}  # x2 starts at the truth
    assert changed("observers.S.initial error", 0.0).observers["S"].initial == {"x1": 1.0}


def test_poles_of_all_kinds() -> None:
    poles = changed("observers.F.poles", 2.0).observers["F"].poles  # type: ignore[attr-defined]  # of this family
    assert poles == (-2 + 2j, -2 - 2j, -4, -6)
    assert changed("observers.S.poles.1", -7.5).observers["S"].poles == (-1, -7.5)  # type: ignore[attr-defined]


def test_the_file_s_own_value_changes_nothing() -> None:
    for knob in KNOBS.values():
        assert State().with_value(knob, knob.start) == State()
        assert State().with_value(knob, knob.high).with_value(knob, knob.start) == State()


@pytest.mark.parametrize(("typed", "value"), [("1+1", 2.0), (" 0.5*pi ", math.pi / 2), ("1e-3", 1e-3)])
def test_what_is_typed_may_be_an_expression(typed: str, value: float) -> None:
    state = State().with_value(KNOBS["observers.F.theta"], typed)
    assert state.values.get("observers.F.theta", KNOBS["observers.F.theta"].start) == value


@pytest.mark.parametrize(("typed", "said"), [("2,5", "with a point"), ("2 h", "no unit"), ("2*theta", "`theta`")])
def test_what_is_typed_wrongly_is_told_with_what_is_right(typed: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        State().with_value(KNOBS["observers.F.theta"], typed)


@pytest.mark.parametrize("value", ["", "two", "nan", "inf", None, [], "1e999", "0x10"])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(ConfigError, match="expected a number"):
        State().with_value(KNOBS["observers.F.theta"], value)
    with pytest.raises(ConfigError, match="expected a whole number"):
        State().with_value(KNOBS["observers.F.r"], 1.5)


numbers = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def states(draw: st.DrawFn) -> State:
    state = State(off=draw(st.frozensets(st.sampled_from(["F", "S"]))))
    for name in draw(st.sets(st.sampled_from(sorted(KNOBS)))):
        value = draw(st.integers(0, 10**6) if KNOBS[name].scale == "integer" else numbers)
        state = state.with_value(KNOBS[name], value)
    return state


@pytest.mark.costly
@settings(max_examples=40)
@given(states())
def test_an_address_is_the_state(state: State) -> None:
    """Bit for bit."""
    assert from_query(state.query(), KNOBS, ["F", "S"]) == state


@settings(max_examples=40)
@given(st.lists(st.one_of(states(), st.sampled_from(["undo", "redo", "preview"])), max_size=12))
def test_undo_and_redo(steps: list[State | str]) -> None:
    """As a list with a place in it; a preview leaves no trace."""
    history, known, place = History(State()), [State()], 0
    for step in steps:
        if step == "undo":
            history, place = history.undone(), max(place - 1, 0)
        elif step == "redo":
            history, place = history.redone(), min(place + 1, len(known) - 1)
        elif step == "preview":
            history = history.previewed(State({"observers.F.theta": 1.0}))
            assert history.shown.values == {"observers.F.theta": 1.0}
            continue
        elif isinstance(step, State):
            history = history.stepped(step)
            if step != known[place]:
                known, place = [*known[: place + 1], step], place + 1
        assert history.shown == history.present == known[place]
        assert (len(history.past), len(history.future)) == (place, len(known) - place - 1)


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("observers.F.thata=2", "Did you mean `observers.F.theta`?"),
        ("observers.F.theta=two", "expected a number or an expression of numbers, such as 0.5 or pi/4: `two`"),
        ("off=G", "no observer is called 'G'"),
        ("seed=1.5", "expected a whole number"),
        ("plant.parameters.mu=__import__('os')", "nothing here is called"),
    ],
)
def test_an_address_that_says_something_else_is_refused(query: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        from_query(query, KNOBS, ["F", "S"])
    assert said in str(caught.value)
    assert from_query("bokeh-session-id=x", KNOBS, ["F", "S"]) == State()


def test_knobs_are_what_they_say() -> None:
    knob = KNOBS["observers.F.theta"]
    assert isinstance(knob, Knob)
    assert knob.changes(3.0) == {"observers.F.theta": 3.0}
    assert KNOBS["seed"].changes(4.0) == {"seed": 4}
