"""One rule for units: a time has a unit of time, and a unit that nobody knows is said to be a label."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment, inline

import hgorun
from hgorun import ConfigError
from hgorun.config.time_units import SECONDS, SHORT
from hgorun.data.units.readable_units import registry
from hgorun.data.units.units import converted, not_known
from hgorun.simulation.preparation.scheduling import remarks

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
        assert registry().Quantity(1, name).to("ns").magnitude == pytest.approx(
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
        registry.cache_clear()
        assert not_known(unit) == ""
    if unit not in ("", "-"):
        registry().Unit(unit)


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


@pytest.mark.parametrize("right_side", ["2*x2", "x2*cos(x1)", "x2/60 + 0.1*x1", "sin(x2)"])
def test_with_a_factor_nothing_is_said_of_a_derivative(right_side: str) -> None:
    plant = inline({"x1": right_side, "x2": "-x1"}, "x1", units={"x1": "rad", "x2": "deg/s"})
    assert not remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"}))


@pytest.mark.parametrize(
    ("speed", "rate", "told"),
    [
        ("rpm", "rad/s^2", "u is in rad/s^2, and its derivative in rpm/s, with time in s: 1 rpm/s is 0.10472 rad/s^2"),
        ("turn", "rad/s", "u is in rad/s, and its derivative in turn/s, with time in s: 1 turn/s is 6.28319 rad/s"),
        ("rad/s", "rpm/s", "u is in rpm/s, and its derivative in rad/s^2, with time in s: 1 rad/s^2 is 9.5493 rpm/s"),
        ("rpm", "rpm/s", ""),
        ("rpm", "1/s^2", ""),  # which does not say what it counts
    ],
)
def test_turns_beside_angles_are_told_of_inputs_too(speed: str, rate: str, told: str) -> None:
    """A turn is 2 pi radians."""
    plant = inline({"n": "u"}, "n", inputs={"u": "sin(t)"}, units={"n": speed, "u": rate})
    found = remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"}))
    assert [told in one for one in found] == [True] * bool(told)


FED = {"S": "g/L", "X": "mg/L", "D": "1/h"}


@pytest.mark.parametrize(
    ("rate", "time", "told"),
    [
        (
            "-D*S + 0.1*X",
            "min",
            "D and S is in g/(h L), and its derivative in g/(L min), with time in min: 1",
        ),
        ("D*(20 - S) + 0.1*X", "min", "D and S is in g/(h L), and its derivative in g/(L min)"),
        (
            "S*D - S*D/3 + 0.1*X",
            "d",
            "S and D is in g/(L h), and its derivative in g/(L d), with time in d: 1 g/(L d) is 0.0416667 g/(L h)",
        ),
        ("0.1*(X - S)", "h", "X is in mg/L, and S, to which it is added, in g/L: 1 g/L is 1000 mg/L. Write"),
        ("-D*X", "h", "D and X is in mg/(h L), and its derivative in g/(L h), with time in h: 1 g/(L h) is 1000 mg"),
        ("D*D*S/D + 0.1*X", "minutes", "D and S is in g/(h L)"),
        ("(D*S)**2/S/D + 0.1*X", "min", "D and S is in g/(h L)"),
        ("(D*S)**3/(D*S)**2 + 0.1*X", "min", "D and S is in g/(h L)"),
        *((right, "h", "") for right in ("-D*S + 0.1*X", "D*(20 - S) + 0.1*X", "0.1*X - S", "-S + 0.1*X", "S*X")),
        *((right, "min", "") for right in ("-D*S/60 + 0.1*X", "-S*S*D + 0.1*X", "D + 0.1*X", "-2*D*S + sin(X)")),
        ("-D*S + 0.1*X", "step", ""),
    ],
)
def test_terms_are_in_the_unit_of_the_rate_or_of_another_kind(rate: str, time: str, told: str) -> None:
    """A factor that is not written may have a unit of another kind, and a number or a function any."""
    plant = inline({"S": rate, "X": "-0.1*X"}, ["S", "X"], inputs={"D": "0.3"}, units=FED)
    found = [one for one in remarks(experiment(plant, OBSERVER).varied({"time.unit": time})) if " is in " in one]
    assert len(found) == (told != "")
    assert told in "".join(found)


@pytest.mark.parametrize(
    ("one", "other", "told"),
    [
        ("degC", "degF", "K is"),
        ("degC", "K", ""),
        ("m", "m^3", ""),
        ("rad", "deg", "1 rad is 57.2958 deg"),
        ("rad", "1", ""),
        ("Hz", "1/s", ""),
        ("a.u.", "m", ""),
        ("m", "m)(", ""),
        ("deg", "-", ""),
        ("m/s/s", "m s^-2", ""),
        ("L", "dm^3", ""),
    ],
)
def test_what_is_added_is_of_one_unit_or_of_another_kind(one: str, other: str, told: str) -> None:
    plant = inline({"x1": "0.1*(x1 + x2)", "x2": "-0.1*x2"}, "x1", units={"x1": other, "x2": one})
    found = [one for one in remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"})) if " is in " in one]
    assert len(found) == (told != "")


@pytest.mark.parametrize(
    ("units", "right_side", "time", "told"),
    [
        (("L", "mL/min"), "u", "h", "u is in mL/min, and its derivative in L/h, with time in h: 1 L/h is 16.6667"),
        (("km/h", "m/s^2"), "u", "h", "1 km/h^2 is 7.71605e-05 m/s^2"),
        (("mmol/L", "mol/(L h)"), "u", "h", "1 mmol/(L h) is 0.001 mol/(L h)"),
        (("L", "L/h"), "u", "h", ""),
        (("K", "kW"), "u", "h", ""),
        (("mg L-1", "d-1"), "-u*x", "h", "u and x is in mg/(d L), and its derivative in mg/(L h), with time in h: 1"),
        (("mg·L⁻¹", "h⁻¹"), "-u*x", "h", ""),
        (("kg", "%"), "u*x", "h", ""),
        (("%", "percent/h"), "u", "h", ""),
        (("%", "ppm/h"), "-u", "h", "1 percent/h is 10000 ppm/h"),
        (("°", "rad/s"), "-u", "s", "1 deg/s is 0.0174533 rad/s"),
        (("dB", "Np/s"), "-u", "s", "1 dB/s is 0.115129 Np/s"),
        (("dB", "Np"), "u", "s", ""),
        (("dBm", "dBW/s"), "-u", "s", ""),
    ],
)
def test_an_input_alone_and_units_in_all_notations_are_compared(
    units: tuple[str, str], right_side: str, time: str, told: str
) -> None:
    plant = inline({"x": right_side}, "x", inputs={"u": "0.3"}, units=dict(zip("xu", units, strict=True)))
    found = [one for one in remarks(experiment(plant, OBSERVER).varied({"time.unit": time})) if " is in " in one]
    assert len(found) == (told != "")
    assert told in "".join(found)


def test_derivatives_of_levels_are_compared() -> None:
    """A neper is 20 lg e = 8.686 dB."""
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", units={"x1": "dB", "x2": "Np"})
    (found,) = remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"}))
    assert "Np is of another kind" in found
    assert converted(np.ones(1), "Np/s", "dB/s", ()) == pytest.approx(20 / np.log(10), rel=1e-12)
    assert converted(np.ones(1), "dBm/s", "dBW/s", ()) == 1


@pytest.mark.parametrize(
    ("right_side", "told"),
    [
        ("0.1*(u - T)", "u is in K, and T, which is compared with it, in degC, from another zero"),
        ("u - T", "u is in K, and T,"),
        ("-(T - u)*T", "in degC"),
        ("0.1*(T - T + u)", ""),
        ("0.1*(u + T)", ""),
        ("u/10", ""),
    ],
)
def test_temperatures_from_two_zeros_have_no_difference(right_side: str, told: str) -> None:
    """A raise by some K of what is in degC is none."""
    plant = inline({"T": right_side}, "T", inputs={"u": "0.3"}, units={"T": "°C", "u": "kelvin"})
    found = [one for one in remarks(experiment(plant, OBSERVER).varied({"time.unit": "h"})) if " is in " in one]
    assert len(found) == (told != "")
    assert told in "".join(found)


def test_units_of_time_that_differ_ask_for_no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = inline({"S": "-D*S"}, "S", inputs={"D": "0.3"}, units={"S": "g/L", "D": "1/h"})
    monkeypatch.setitem(sys.modules, "pint", None)
    registry.cache_clear()
    (found,) = remarks(experiment(plant, OBSERVER).varied({"time.unit": "min"}))
    assert "1 g/(L min) is 60 g/(h L)" in found


@pytest.mark.parametrize("name", ["motor", "fermentation"])
def test_built_in_plants_with_units_have_no_other_ones(name: str) -> None:
    file = Path(__file__).parents[2] / "experiments" / "benchmark" / f"{name}.yaml"
    assert not [one for one in remarks(hgorun.load(file, run="low noise")) if " is in " in one]


def test_a_derivative_with_its_own_unit_asks_for_no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", units={"x1": "rad", "x2": "rad/s"})
    monkeypatch.setitem(sys.modules, "pint", None)
    registry.cache_clear()
    assert not remarks(experiment(plant, OBSERVER).varied({"time.unit": "s"}))
