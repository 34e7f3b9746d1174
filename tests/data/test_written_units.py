"""Units as people write them: degrees of temperature, gauge and absolute pressures, volumes at normal conditions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import noisy, recorded, table

from hgorun.data.units.loose_units import remark_on_name
from hgorun.data.units.named_units import said_in_name
from hgorun.data.units.unit_per_time import unlike_rate
from hgorun.data.units.units import alike, converted, is_unit, not_known
from hgorun.data.units.written_units import is_misread, with_temperatures, without_reference
from hgorun.errors import Problem

PLAIN = table(*noisy())
CELSIUS = [
    "deg C",
    "°C",
    "ºC",
    "˚C",
    "℃",
    "oC",
    "deg. C",
    "deg.C",
    "degrees C",
    "degree C",
    "degrees_C",
    "degrees_Celsius",
    "degree_Celsius",
    "degrees Celsius",
    "° C",
    "º C",
    "Deg C",
    "DEGC",
    "deg c",
    "deg_C",
    "deg-C",
    "Celsius",
    "celsius",
    "centigrade",
    "Â°C",
    "gr C",
    "grd C",
    "Grad C",
    "Grad Celsius",
]
FAHRENHEIT = ["deg F", "°F", "ºF", "℉", "oF", "deg. F", "degrees F", "degrees_Fahrenheit", "fahrenheit"]
KELVIN = ["deg K", "degK", "°K", "oK", "degrees K", "degrees Kelvin", "Kelvin", "K"]


@pytest.mark.parametrize("unit", CELSIUS)
def test_degrees_celsius_are_these_however_they_are_written(unit: str) -> None:
    assert converted(np.array([20.0]), unit, "K", ())[0] == pytest.approx(293.15, rel=1e-14)
    assert alike(unit, "degC")
    assert (not_known(unit), is_unit(unit)) == ("", True)


@pytest.mark.parametrize("unit", FAHRENHEIT)
def test_degrees_fahrenheit_are_these_however_they_are_written(unit: str) -> None:
    assert converted(np.array([68.0]), unit, "degC", ())[0] == pytest.approx(20.0, rel=1e-12)


@pytest.mark.parametrize("unit", KELVIN)
def test_degrees_kelvin_are_kelvin(unit: str) -> None:
    assert converted(np.array([20.0]), unit, "K", ()).tolist() == [20.0]
    assert converted(np.array([293.15]), unit, "degC", ())[0] == pytest.approx(20.0, rel=1e-12)


def test_degrees_rankine_are_no_product_with_a_constant() -> None:
    assert converted(np.array([491.67]), "deg R", "degC", ())[0] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [
        ("W/(m2 deg K)", "W/(m^2 K)", 1.0),
        ("mV/deg C", "V/K", 1e-3),
        ("deg C/min", "K/s", 1 / 60),
        ("J/(kg ºC)", "J/(g K)", 1e-3),
    ],
)
def test_so_they_are_inside_of_other_units(unit: str, wanted: str, factor: float) -> None:
    assert converted(np.ones(1), unit, wanted, ())[0] == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("unit", ["N*m/(deg*K)", "N m/(rad K)", "deg/s", "°/s", "deg", "degree", "F/m", "C/s", "g K"])
def test_angles_charges_and_products_that_are_meant_stay(unit: str) -> None:
    assert with_temperatures(unit) == unit
    assert not is_misread(unit)
    assert is_unit(unit)


@pytest.mark.parametrize(
    ("unit", "meant"), [("K deg", "K"), ("deg*K", "K"), ("deg*C", "degC"), ("mdeg C", "degC"), ("degC deg", "degC")]
)
def test_an_angle_times_a_temperature_is_not_what_was_meant(unit: str, meant: str) -> None:
    assert not is_unit(unit)
    assert "is not a known unit" in not_known(unit)
    with pytest.raises(Problem, match=f"is not a known unit. Did you mean `{meant}`"):
        converted(np.ones(1), unit, "K", ())


REFERRED = [
    *(
        ("bar", one)
        for one in [
            "barg",
            "bara",
            "bar(g)",
            "bar (a)",
            "bar abs",
            "bar abs.",
            "bar_a",
            "bar g",
            "bar a",
            "bar rel",
            "barü",
            "bar gauge",
            "bar(d)",
        ]
    ),
    ("mbar", "mbar(a)"),
    ("kPa", "kPag"),
    ("MPa", "MPa rel"),
    ("psi", "psig"),
    ("psi", "psia"),
    ("psi", "psid"),
    ("at", "atü"),
    ("kgf/cm2", "kg/cm2g"),
    ("kgf/cm2", "kg/cm2(g)"),
    ("mmHg", "mmHga"),
    ("m3", "Nm3"),
    ("m3/h", "Nm3/h"),
    ("m³/h", "Nm³/h"),
    ("m^3/h", "Nm^3/h"),
    ("m3 h-1", "Nm3 h-1"),
    ("m3/h", "Sm3/h"),
    ("m3/h", "m3(n)/h"),
    ("m3/h", "m3/h (N)"),
    ("m³", "m³ i.N."),
    ("m3/h", "mn3/h"),
    ("m^3/h", "m_n^3/h"),
    ("L/min", "NL/min"),
    ("l/min", "ln/min"),
    ("ml/min", "mln/min"),
    ("L/min", "sL/min"),
    ("L/min", "std L/min"),
    ("L/min", "slpm"),
    ("ft^3/min", "SCFM"),
    ("mL/min", "sccm"),
]
PLAIN_UNITS = (
    "bar|Pa|mPa*s|Pa s|bar*g|mmHg|mmH2O|at|atm|kg/cm2|Nm|N m|Nm/rad|nL|nm3|m3/h|L/min|m3 s|m3 s-1|L s-1|S/m|mS/cm|s|m"
)


@pytest.mark.parametrize(("unit", "written"), REFERRED)
def test_what_is_told_of_a_pressure_or_a_volume_is_no_factor(unit: str, written: str) -> None:
    assert without_reference(written) == unit
    assert not is_unit(written)
    assert "is not a known unit" in not_known(written)


@pytest.mark.parametrize("unit", PLAIN_UNITS.split("|"))
def test_units_that_tell_nothing_of_it(unit: str) -> None:
    assert without_reference(unit) is None


@pytest.mark.parametrize(
    ("name", "wanted", "said"),
    [
        ("p [mbar(a)]", "bar", "mbar(a)"),
        ("p (mbar(a))", "bar", "mbar(a)"),
        ("p in mbar abs", "bar", "mbar abs"),
        ("p in mbar(a)", "bar", "mbar(a)"),
        ("p in bar (g)", "bar", "bar (g)"),
        ("p [barg]", "bar", "barg"),
        ("p (bara)", "bar", "bara"),
        ("p [KPAG]", "kPa", "KPAG"),
        ("p [mbar]", "barg", "mbar"),
        ("q [m3(n)/h]", "m^3/s", "m3(n)/h"),
        ("q [Nm^3/h]", "m^3/h", "Nm^3/h"),
        ("T in deg C", "K", "deg C"),
        ("T [oC]", "K", "oC"),
        ("T [K deg]", "K", "K deg"),
        ("h [mm below top]", "m", "mm below top"),
        ("h [m above sea]", "m", ""),
        ("T in tank 3", "K", ""),
        ("p [raw]", "bar", ""),
        ("p (top)", "bar", ""),
        ("h [-]", "m", ""),
    ],
)
def test_the_name_of_a_column_says_so(name: str, wanted: str, said: str) -> None:
    assert said_in_name(name, wanted, stated=False) == said


def test_who_states_a_unit_is_not_told_of_remarks() -> None:
    assert said_in_name("h [mm below top]", "m", stated=True) == ""
    assert said_in_name("p [mbar(a)]", "bar", stated=True) == "mbar(a)"


@pytest.mark.parametrize(
    ("name", "wanted", "said"),
    [
        ("T_degC", "K", "degC"),
        ("T_deg_C", "K", "deg_C"),
        ("T / °C", "K", "°C"),
        ("T °C", "K", "°C"),
        ("T, deg C", "K", "deg C"),
        ("level_mm", "m", "mm"),
        ("level mm", "m", "mm"),
        ("p_mbara", "bar", "mbara"),
        ("p mbar(a)", "bar", "mbar(a)"),
        ("p_barg", "bar", "barg"),
        ("p_barg", "barg", ""),
        ("p_barg", "m", ""),
        ("q_Nm3/h", "m^3/s", "Nm3/h"),
        ("T_K", "K", ""),
        ("level_mm", "mm", ""),
        ("T_min", "h", ""),
        ("level_m", "mm", ""),
        ("mm", "m", ""),
        ("level_mm (m)", "m", ""),
    ],
)
def test_a_unit_without_brackets_is_told(name: str, wanted: str, said: str) -> None:
    told = f"column {name!r}: its name may say {said}, the model has {wanted}: taken as they are" if said else ""
    assert remark_on_name(name, wanted) == told


@pytest.mark.parametrize(
    ("header", "told"),
    [
        ("t,p [barg]", "column 'p [barg]': its name says barg, which is not a known unit, the model has bar: taken"),
        ("t,p\ns,bar(a)", "column 'p': the file says bar(a), which is not a known unit, the model has bar: taken"),
        ("t,p\n[s],[barg]", "column 'p': the file says barg, which is not a known unit, the model has bar: taken"),
        ("t,p_mbar", "column 'p_mbar': its name may say mbar, the model has bar: taken as they are"),
    ],
)
def test_numbers_that_are_taken_as_they_are_have_a_word(tmp_path: Path, header: str, told: str) -> None:
    column = header.split("\n")[0].removeprefix("t,")
    log = PLAIN.replace("t,glucose", header)
    (note,) = recorded(tmp_path, log, {"outputs": {"S": column}}, units={"S": "bar"}).notes
    assert told in note.message


@pytest.mark.parametrize("header", ["t,p [mbar(a)]", "t,p\ns,mbar(a)", "t,p\ns,(mbara)"])
def test_a_pressure_of_another_size_is_refused(tmp_path: Path, header: str) -> None:
    column = header.split("\n")[0].removeprefix("t,")
    with pytest.raises(Problem, match=r"says mbar(\(a\)|a) in .* is not among the units .* Did you mean `mbar`"):
        recorded(tmp_path, PLAIN.replace("t,glucose", header), {"outputs": {"S": column}}, units={"S": "bar"})


@pytest.mark.parametrize("unit", ["deg C", "ºC", "℃"])
def test_what_is_advised_of_degrees_converts_them(tmp_path: Path, unit: str) -> None:
    column = f"T [{unit}]"
    log = f"t,{column}\n0,20\n1,21\n"
    with pytest.raises(Problem, match=r"unit: .*} converts, unit: K takes the numbers"):
        recorded(tmp_path, log, {"outputs": {"S": column}}, units={"S": "K"})
    found = recorded(tmp_path, log, {"outputs": {"S": {"column": column, "unit": unit}}}, units={"S": "K"})
    np.testing.assert_allclose(found.outputs["S"].values, [293.15, 294.15], rtol=1e-14)
    assert not found.notes


@pytest.mark.parametrize(("unit", "rate"), [("deg C", "K/s"), ("º C", "deg. C/s"), ("K", "deg K/s")])
def test_rates_of_temperatures_are_those_of_their_differences(unit: str, rate: str) -> None:
    assert unlike_rate(unit, "s", rate) == ""
    assert unlike_rate(unit, "min", rate).endswith(f"is 0.0166667 {rate}")


def test_a_unit_of_another_kind_in_a_name_is_told(tmp_path: Path) -> None:
    log = PLAIN.replace("glucose", "level [V]")
    (note,) = recorded(tmp_path, log, {"outputs": {"S": "level [V]"}}, units={"S": "m"}).notes
    assert note.message == "column 'level [V]': its name says V, the model has m, of another kind: taken as they are"
