"""Units that count turns, and the ways in which units are written in the names of columns."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.data.units.named_units import AnotherUnit, convertible_in_name
from hgorun.data.units.units import alike, converted
from hgorun.errors import Problem

TURNS = [
    (1.0, "Hz", "rpm", 60.0),
    (60.0, "rpm", "Hz", 1.0),
    (1.0, "Hz", "rad/s", 6.283185307179586),
    (60.0, "rpm", "rad/s", 6.283185307179586),
    (2.0, "kHz", "Hz", 2000.0),
    (720.0, "deg/s", "Hz", 2.0),
    (3.0, "rev/min", "rpm", 3.0),
    (1.0, "rad/s", "1/s", 1.0),
]
NOTATIONS = [
    (3.0, "m3/h", "L/h", 3000.0),
    (1000.0, "mg L-1", "g/L", 1.0),
    (1000.0, "mg·L⁻¹", "g/L", 1.0),
    (1.0, "g/m³", "mg/L", 1.0),
    (2.0, "m s-2", "m/s^2", 2.0),
    (20.0, "Celsius", "K", 293.15),
    (5.0, "%", "-", 0.05),
    (5.0, "dimensionless", "-", 5.0),
    (5.0, "1", "-", 5.0),
    (5.0, "au", "a.u.", 5.0),
    (5.0, "a. u.", "au", 5.0),
    (5.0, "p.u.", "pu", 5.0),
]


@pytest.mark.parametrize(("value", "unit", "wanted", "expected"), [*TURNS, *NOTATIONS])
def test_numbers_in_another_unit(value: float, unit: str, wanted: str, expected: float) -> None:
    assert converted(np.array([value]), unit, wanted, ())[0] == pytest.approx(expected, rel=1e-12)


def test_points_of_an_abbreviation_make_no_other_unit() -> None:
    assert alike("au", "a.u.")
    assert not alike("m.s", "ms")


@pytest.mark.parametrize(("unit", "wanted"), [("1/min", "rpm"), ("rpm", "1/s"), ("Hz", "1/s"), ("1/s", "Hz")])
def test_what_does_not_say_what_it_counts_is_not_converted_to_turns(unit: str, wanted: str) -> None:
    assert not alike(unit, wanted)
    with pytest.raises(Problem, match="one counts turns"):
        converted(np.ones(1), unit, wanted, ())


@pytest.mark.parametrize(
    ("name", "wanted", "found"),
    [
        ("S [mg L-1]", "g/L", "mg L-1"),
        ("S (g/m3)", "g/L", "g/m3"),
        ("Q (m3/h)", "L/h", "m3/h"),
        ("T (Celsius)", "K", "Celsius"),
        ("T (C)", "degC", "degC"),
        ("DO (%)", "-", "%"),
        ("glucose [CO2]", "g/L", ""),  # a tag
        ("valve (S2)", "g/L", ""),
        ("y (1)", "-", ""),
    ],
)
def test_a_name_is_read_in_usual_notations(name: str, wanted: str, found: str) -> None:
    assert convertible_in_name(name, wanted) == found


def told(found: str, wanted: str) -> str:
    one = AnotherUnit(
        column="c", file="f.h5", source="the file", found=found, wanted=wanted, said=None, who="the model has"
    )
    with pytest.raises(ValueError, match="takes the numbers as they are") as error:
        one.told()
    return str(error.value)


def test_advice_can_be_followed() -> None:
    """What is to be written is text to YAML, and what converts does."""
    assert 'unit: "1" takes' in told("%", "1")
    assert 'unit: "%"} converts' in told("%", "1")
    assert "unit: degC} converts" in told("C", "K")
    assert "converts" not in told("h", "month")
    assert "converts" not in told("1/min", "rpm")
    assert "not known" in told("g/L", "gDW/L")
