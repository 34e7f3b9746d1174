"""One rule for units: a time has a unit of time, and a unit that nobody knows is said to be a label."""

from __future__ import annotations

import sys
from fractions import Fraction

import pytest
from examples import VAN_DER_POL, experiment, inline

from hgorun import ConfigError
from hgorun.config.time_units import SECONDS, SHORT
from hgorun.data.units import _registry, not_known
from hgorun.simulation.scheduling import remarks

OBSERVER = {"S": {"type": "shgo", "theta": 2}}


@pytest.mark.parametrize(
    ("unit", "short"),
    [
        *((one, one) for one in ("s", "h", "week", "year", "-", "sample")),
        *(("sec", "s"), ("µs", "us"), ("days", "d"), ("weeks", "week"), ("yr", "year"), ("", "-"), ("steps", "step")),
    ],
)
def test_units_of_time_are_taken_and_have_one_name(unit: str, short: str) -> None:
    made = experiment(VAN_DER_POL, OBSERVER).varied({"time.unit": unit})
    assert made.blocks.time.unit == short
    assert made.varied({"time.unit": short}).blocks.time.unit == short


@pytest.mark.parametrize(
    ("unit", "told"),
    [
        ("kg", ""),
        ("hz", " Did you mean"),
        ("hour s", " Did you mean `hours`?"),
        ("m", " Did you mean `min`"),
        (" s", " Did you mean `s`"),
        ("Tag", ""),
        ("msekk", ""),
    ],
)
def test_other_units_of_time_are_refused(unit: str, told: str) -> None:
    with pytest.raises(ConfigError, match=f"time.unit: '{unit}' is not a unit of time.{told}") as caught:
        experiment(VAN_DER_POL, OBSERVER).varied({"time.unit": unit})
    assert "Known: ns, us, ms, s, min, h, d, week, month, year" in str(caught.value)


@pytest.mark.costly
def test_units_of_time_are_as_long_as_those_of_a_library() -> None:
    for name in (*SECONDS, *SHORT):
        assert _registry().Quantity(1, name).to("ns").magnitude == pytest.approx(
            float(SECONDS[SHORT.get(name, name)] / Fraction(1, 10**9))
        )


@pytest.mark.parametrize(
    ("unit", "told"),
    [
        ("5", "'5' is a number, not a unit."),
        ("m/", "'m/' is not a known unit."),
        ("m//s", "'m//s' is not a known unit."),
    ],
)
def test_a_number_or_half_a_unit_is_none(unit: str, told: str) -> None:
    assert not_known(unit).startswith(told)


def test_a_unit_of_a_state_that_is_not_known_is_told() -> None:
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", units={"x1": "kgg", "x2": "mm/s^2"})
    (found,) = remarks(experiment(plant, OBSERVER))
    assert found.endswith(
        "plant.units.x1: 'kgg' is not a known unit. Did you mean `kg`? It is taken as a label, and converted "
        "to no other"
    )


@pytest.mark.costly
@pytest.mark.parametrize(
    "unit", ["g/L", "g/(L h)", "1/h", "rad/s", "m**2", "m s^-1", "mV", "degC", "-", "", "1", "kPa"]
)
def test_usual_units_are_known_without_the_library_which_knows_them_too(
    unit: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pint", None)
        _registry.cache_clear()
        assert not_known(unit) == ""
    if unit not in ("", "-"):
        _registry().Unit(unit)


@pytest.mark.parametrize("unit", ["fortnight", "parsec", "°C", "USD", "m3", "kg kg kgg"])
def test_what_is_unusual_is_asked_of_the_library(unit: str) -> None:
    known = unit in ("fortnight", "parsec", "°C", "m3")
    assert (not_known(unit) == "") is known


@pytest.mark.parametrize(
    ("place", "speed", "time", "wrong"),
    [
        ("rad", "deg/s", "s", "rad/s, since x1 is in rad and time in s: 1 rad/s is 57.2958 deg/s"),
        ("m", "km/h", "s", "m/s, since x1 is in m and time in s: 1 m/s is 3.6 km/h"),
        ("m", "m/s", "ms", "m/ms, since x1 is in m and time in ms: 1 m/ms is 1000 m/s"),
        ("m/s", "m/s^2", "h", "m/s per h, since x1 is in m/s and time in h: 1 m/s per h is 0.000277778 m/s^2"),
        ("degC", "degF/min", "min", "degC/min, since x1 is in degC and time in min: 1 degC/min is 1.8 degF/min"),
        ("rad", "rpm", "min", "rad/min, since x1 is in rad and time in min: 1 rad/min is 0.159155 rpm"),
        ("m", "kg", "s", "m/s, since x1 is in m and time in s: kg is of another kind"),
        ("m", "m", "s", "m/s, since x1 is in m and time in s: m is of another kind"),
        *(
            (*right, "")
            for right in [
                ("rad", "rad/s", "s"),
                ("rad", "1/s", "s"),
                ("m", "m s^-1", "s"),
                ("km", "km/h", "hours"),
                ("m/s", "m/s^2", "s"),
                ("degC", "K/s", "s"),
                ("°C", "°C/h", "h"),
                ("g/L", "g/(L h)", "h"),
                ("turn", "Hz", "s"),
                ("turn", "rpm", "min"),
                ("-", "kg", "s"),
                ("m", "1", "s"),
                ("m", "a.u.", "s"),
                ("a.u.", "m/s", "s"),
                ("m", "kg", "steps"),
                ("m", "kg", "year"),
            ]
        ),
    ],
)
def test_the_unit_of_a_derivative_is_that_of_its_state_per_time(place: str, speed: str, time: str, wrong: str) -> None:
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", units={"x1": place, "x2": speed})
    made = experiment(plant, OBSERVER).varied({"time.unit": time})
    found = [one.partition(" makes it ")[2].partition(". Write")[0] for one in remarks(made) if "makes it" in one]
    assert found == [wrong] * (wrong != "")


@pytest.mark.parametrize("right_side", ["2*x2", "-x2", "x2 + 0.1*x1"])
def test_with_a_factor_nothing_is_said_of_a_derivative(right_side: str) -> None:
    plant = inline({"x1": right_side, "x2": "-x1"}, "x1", units={"x1": "rad", "x2": "deg/s"})
    assert not remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"}))


def test_a_derivative_with_its_own_unit_asks_for_no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", units={"x1": "rad", "x2": "rad/s"})
    monkeypatch.setitem(sys.modules, "pint", None)
    _registry.cache_clear()
    assert not remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"}))
