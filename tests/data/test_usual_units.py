"""Units are those of engineering: what a library reads by accident in a word is no unit."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.data.units.named_units import convertible_in_name, foreign_in_name, of_another_kind_in_name
from hgorun.data.units.readable_units import registry
from hgorun.data.units.units import _COMMON, converted, is_unit, not_known, seconds
from hgorun.data.units.usual_units import _SYMBOLS, _WORDS, unusual
from hgorun.errors import Problem

ACCIDENTS = """
    Grad grad a OD pH mass unit units Pt PS cfm au e k c R G u at D x dot point hand chain link rod pt Temp cu fr nit
    P dd cmin kdeg Mm kt Skt
"""


@pytest.mark.parametrize("word", ACCIDENTS.split())
def test_a_word_that_is_read_by_accident_is_no_unit(word: str) -> None:
    assert not is_unit(word)
    assert f"{word!r} is not a known unit" in not_known(word)
    with pytest.raises(Problem, match="is not a known unit"):
        converted(np.ones(1), word, "s", ())


@pytest.mark.parametrize(
    ("name", "wanted"),
    [("angle [Grad]", "rad"), ("phase (a)", "h"), ("channel (D)", "C*m"), ("valve (mass)", "deg"), ("gain (k)", "J/K")],
)
def test_nor_is_it_one_in_the_name_of_a_column(name: str, wanted: str) -> None:
    assert convertible_in_name(name, wanted) == ""


@pytest.mark.parametrize(
    ("name", "wanted", "found"),
    [("y [V]", "m", "V"), ("level (bar)", "m", "bar"), ("angle (degC)", "rad", "degC"), ("y (V)", "m", ""),
     ("y [7]", "m", ""), ("y [mm]", "m", ""), ("y [raw]", "m", ""), ("angle [deg]", "rad", ""),
     ("y [V]", "turns_of_it", "")],
)  # fmt: skip
def test_a_unit_of_another_kind_is_found_in_a_name(name: str, wanted: str, found: str) -> None:
    assert of_another_kind_in_name(name, wanted) == found


@pytest.mark.parametrize(
    ("value", "unit", "wanted", "expected"),
    [
        (1.0, "mbar", "hPa", 1.0),
        (1.0, "kWh", "MJ", 3.6),
        (1.0, "mS/cm", "S/m", 0.1),
        (365.25, "t/a", "t/d", 1.0),
        (1.0, "kilograms", "g", 1000.0),
        (1.0, "inches", "mm", 25.4),
        (10.0, "cP", "mPa*s", 10.0),
        (1.0, "mM", "mol/m^3", 1.0),
        (2.0, "degrees", "deg", 2.0),
        (760.0, "Torr", "mmHg", 760.0),
        (1.0, "N m", "J", 1.0),
        (1.0, "Wh/(kg K)", "kJ/(kg K)", 3.6),
        (206264.806, "arcsec", "rad", 1.0),
        (60.0, "arcmin", "deg", 1.0),
        (1.0, "cmH2O", "Pa", 98.0665),
        (1.0, "mmH2O", "Pa", 9.80665),
        (1.0, "inH2O", "Pa", 249.089),
        (1.0, "inHg", "Pa", 3386.389),
        (1.0, "nmi", "m", 1852.0),
        (1e4, "gauss", "T", 1.0),
        (1.0, "mG", "nT", 100.0),
        (4 * np.pi, "Oe", "kA/m", 1.0),
        (1.0, "cc", "mL", 1.0),
        (1.0, "ksi", "MPa", 6.894757),
        (1e5, "dyn", "N", 1.0),
        (1e7, "erg", "J", 1.0),
        (1.0, "‰", "percent", 0.1),
        (90.0, "mins", "hrs", 1.5),
        (1.0, "ppb", "ppm", 1e-3),
        (1.0, "darcy", "m^2", 9.869233e-13),
        (1.0, "mCi", "MBq", 37.0),
        (1.0, "kip", "kN", 4.448222),
        (1.0, "ft_lb", "J", 1.355818),
        (30.0, "dBm", "W", 1.0),
        (1.0, "fmol", "mol", 1e-15),
        (1.0, "THz", "GHz", 1000.0),
        (1.0, "PJ", "TJ", 1000.0),
        (1.0, "Mvar", "kW", 1000.0),
        (1.0, "kts", "m/s", 0.514444),
    ],
)
def test_usual_units_convert(value: float, unit: str, wanted: str, expected: float) -> None:
    found = converted(np.array([value]), unit, wanted, ())[0]
    assert found == pytest.approx(expected, rel=1e-4)  # the inch of mercury is rounded


def test_bytes_are_no_bels() -> None:
    with pytest.raises(Problem, match="B cannot be converted to the model's dB: it is of another kind"):
        converted(np.ones(1), "B", "dB", ())


@pytest.mark.parametrize(
    ("name", "wanted", "found"),
    [
        ("a [grad]", "rad", "grad"),
        ("a in Grad", "rad", "Grad"),
        ("d (mils)", "m", "mils"),
        ("d [mil]", "m", "mil"),
        ("V [bbl]", "m^3", "bbl"),
        ("p [psig]", "Pa", "psig"),
        ("p [psig]", "psi", ""),
        ("q [cfm]", "m^3/s", "cfm"),
        ("M [ft-lb]", "N*m", "ft-lb"),
        ("M [in-lb]", "N*m", "in-lb"),
        ("M [Nm]", "N*m", ""),
        ("B [G]", "T", "G"),
        ("B [Gauss]", "T", "Gauss"),
        ("L [B]", "dB", "B"),
        ("n [RPM]", "rad/s", "RPM"),
        ("v [M/S]", "km/h", "M/S"),
        ("v [M/S]", "m/s", ""),
        ("n [RPM]", "rpm", ""),
        ("p [MPA]", "MPa", ""),
        ("x [left]", "m", ""),
        ("x [2]", "1", ""),
        ("x [k]", "m", ""),
        ("x [Skt]", "rad", ""),
        ("x", "rad", ""),
    ],
)
def test_a_unit_of_the_kind_that_is_not_converted_is_found(name: str, wanted: str, found: str) -> None:
    assert foreign_in_name(name, wanted) == found


def test_what_is_usual_is_known_to_the_library_and_what_is_suggested_is_usual() -> None:
    assert all(unusual(unit) is None for unit in _COMMON.split())
    for name in sorted(_SYMBOLS | _WORDS):
        registry().Unit(name)


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [
        *[("Nm", "N*m", 1), ("kNm", "N*m", 1000), ("mNm", "J", 1e-3), ("Nm/rad", "N*m/rad", 1), ("J/Nm", "1", 1)],
        *[("cNm", "N*m", 1e-2), ("dNm", "J", 0.1), ("daNm", "J", 10), ("uNm", "J", 1e-6), ("μNm/A", "N*m/A", 1e-6)],
    ],
)
def test_a_newton_metre_is_one_in_its_usual_notation(unit: str, wanted: str, factor: float) -> None:
    np.testing.assert_allclose(converted(np.array([2.0]), unit, wanted, ()), [2 * factor], rtol=1e-12)
    assert not not_known(unit)


@pytest.mark.parametrize(("unit", "short"), [("secs", "s"), ("mins", "min"), ("hrs", "h"), ("msecs", "ms")])
def test_short_plurals_are_units_of_time(unit: str, short: str) -> None:
    assert seconds(unit, ()) == seconds(short, ())
    np.testing.assert_allclose(converted(np.array([3.0]), f"1/{unit}", f"1/{short}", ()), [3.0], rtol=1e-12)


def test_german_degrees_are_offered_as_such() -> None:
    with pytest.raises(Problem, match=r"'Grad' is not a known unit\. Did you mean `deg`\?"):
        converted(np.ones(1), "Grad", "rad", ())


@pytest.mark.parametrize(("typed", "meant"), [("G/L", "g/L"), ("G/l", "g/L"), ("M/S", "m/s"), ("L/H", "L/h")])
def test_units_in_capitals_are_not_those_of_other_things(typed: str, meant: str) -> None:
    """To a library of units they are gauss per litre, molar per siemens and litre per henry."""
    assert not_known(typed) == f"{typed!r} is not a known unit. Did you mean `{meant}`?"
    with pytest.raises(Problem, match=f"is not a known unit. Did you mean `{meant}`"):
        converted(np.ones(1), typed, meant, ())
    assert not not_known(meant)
    for right in ("G/cm", "M/s", "mG/L", "S/m"):
        assert not not_known(right)


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [
        *[("cN", "N", 1e-2), ("cN*m", "N*m", 1e-2), ("dN", "N", 0.1), ("pN", "N", 1e-12), ("pW", "W", 1e-12)],
        *[("daPa", "Pa", 10), ("cbar", "Pa", 1e3), ("mdeg/s", "rad/s", np.pi / 180e3), ("nrad", "rad", 1e-9)],
        *[("μrad", "rad", 1e-6), ("krpm", "rad/s", 2000 * np.pi / 60), ("cmol/kg", "mol/kg", 1e-2)],
        *[("mBq/m3", "Bq/L", 1e-6), ("TBq", "Bq", 1e12), ("nSv/h", "Sv/h", 1e-9), ("cGy", "Gy", 1e-2)],
    ],
)
def test_prefixes_that_are_usual_with_some_units_alone(unit: str, wanted: str, factor: float) -> None:
    np.testing.assert_allclose(converted(np.array([2.0]), unit, wanted, ()), [2 * factor], rtol=1e-12)
