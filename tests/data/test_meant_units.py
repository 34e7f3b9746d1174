"""Abbreviations of plants: what each is asked for, the numbers by hand, and what says turns or angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import noisy, recorded, table

from hgorun.data.units.loose_units import loose_in_name, remark_on_name
from hgorun.data.units.named_units import said_in_name
from hgorun.data.units.units import alike, converted
from hgorun.errors import Problem

GALLON, FOOT, INCH, POUND, BTU = 3.785411784e-3, 0.3048, 0.0254, 0.45359237, 1055.056  # of ISO 31-4
GRAVITY = 9.80665
ASKED = [
    ("kg/cm2", "Pa", "kgf/cm2", GRAVITY * 1e4),
    ("kg/cm^2", "bar", "kgf/cm2", GRAVITY * 0.1),
    ("kg/cm²", "kPa", "kgf/cm2", GRAVITY * 10),
    ("kp/cm2", "Pa", "kgf/cm2", GRAVITY * 1e4),
    ("ata", "Pa", "kgf/cm2", GRAVITY * 1e4),
    ("mWC", "Pa", "mH2O", GRAVITY * 1e3),
    ("mWS", "mbar", "mH2O", GRAVITY * 10),
    ("mmWC", "Pa", "mmH2O", GRAVITY),
    ("in. w.c.", "Pa", "inH2O", GRAVITY * 25.4),
    ("in. Hg", "Pa", "inHg", 13595.1 * GRAVITY * INCH),
    ("psf", "Pa", "lbf/ft^2", POUND * GRAVITY / FOOT**2),
    ("psi(g)", "Pa", "psi", POUND * GRAVITY / INCH**2),
    ("PSI", "Pa", "psi", POUND * GRAVITY / INCH**2),
    ("GPM", "m^3/h", "gal/min", GALLON * 60),
    ("gpm", "L/min", "gal/min", GALLON * 1e3),
    ("MMSCFD", "m^3/d", "million_cubic_feet/d", 1e6 * FOOT**3),
    ("MSCFD", "m^3/d", "thousand_cubic_feet/d", 1e3 * FOOT**3),
    ("scfm", "m^3/min", "ft^3/min", FOOT**3),
    ("ACFM", "m^3/min", "ft^3/min", FOOT**3),
    ("Nm3/h", "L/h", "m3/h", 1e3),
    ("BPD", "m^3/d", "oil_barrel/d", 42 * GALLON),
    ("bbl", "m^3", "oil_barrel", 42 * GALLON),
    ("tph", "kg/h", "t/h", 1e3),
    ("MMBTU/h", "W", "million_Btu/h", 1e6 * BTU / 3600),
    ("MBH", "W", "thousand_Btu/h", 1e3 * BTU / 3600),
    ("PS", "W", "metric_horsepower", 75 * GRAVITY),
    ("HP", "W", "hp", 550 * FOOT * POUND * GRAVITY),
    ("MWe", "kW", "MW", 1e3),
    ("mPas", "Pa*s", "mPa s", 1e-3),
    ("mPa.s", "Pa*s", "mPa s", 1e-3),
    ("cps", "Pa*s", "cP", 1e-3),
    ("umho/cm", "S/m", "uS/cm", 1e-4),
    ("Ncm", "N*m", "N*cm", 1e-2),
    ("Nmm", "N*m", "N*mm", 1e-3),
    ("kgcm²", "kg*m^2", "kg*cm^2", 1e-4),
    ("gcm2", "kg*m^2", "g*cm^2", 1e-7),
    ("W/m2K", "W/(cm^2 K)", "W/(m2 K)", 1e-4),
    ("kJ/kgK", "J/(kg K)", "kJ/(kg K)", 1e3),
    ("%RH", "-", "percent", 0.01),
    ("Vol.-%", "-", "percent", 0.01),
    ("g", "m/s^2", "g_0", GRAVITY),
    ("U/min", "rad/s", "rpm", 2 * np.pi / 60),
    ("r/min", "rad/s", "rpm", 2 * np.pi / 60),
]
READ = [
    ("kgf/cm2", "Pa", GRAVITY * 1e4),
    ("mH2O", "Pa", GRAVITY * 1e3),
    ("inHg", "Pa", 13595.1 * GRAVITY * INCH),
    ("mmHg", "Pa", 13595.1 * GRAVITY * 1e-3),
    ("cSt", "m^2/s", 1e-6),
    ("cP", "Pa*s", 1e-3),
    ("uS/cm", "S/m", 1e-4),
    ("ppm", "-", 1e-6),
    ("rpm", "rad/s", 2 * np.pi / 60),
    ("turn/min", "rad/s", 2 * np.pi / 60),
    ("rad/min", "rad/s", 1 / 60),
]


@pytest.mark.parametrize(("unit", "wanted", "meant", "factor"), ASKED)
def test_what_an_abbreviation_may_mean_is_asked_and_converts(unit: str, wanted: str, meant: str, factor: float) -> None:
    with pytest.raises(Problem) as caught:
        converted(np.ones(1), unit, wanted, ())
    assert f" Did you mean `{meant}`?" in caught.value.message
    assert converted(np.ones(1), meant, wanted, ())[0] == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize(("unit", "wanted", "factor"), READ)
def test_usual_units_of_plants(unit: str, wanted: str, factor: float) -> None:
    assert converted(np.ones(1), unit, wanted, ())[0] == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize(("unit", "wanted"), [(unit, wanted) for unit, wanted, *_ in ASKED if unit != "Nm3/h"])
def test_so_is_one_in_the_name_of_a_column(unit: str, wanted: str) -> None:
    assert said_in_name(f"y [{unit}]", wanted, stated=False) == unit


def test_one_of_the_same_size_needs_no_word() -> None:
    for name, wanted in (("n [U/min]", "rpm"), ("p [kg/cm2]", "kgf/cm2"), ("v [ccm]", "mL")):
        assert said_in_name(name, wanted, stated=False) == ""
        assert remark_on_name(name, wanted) == ""


def test_without_brackets_it_is_a_remark() -> None:
    assert loose_in_name("flow_GPM", "m^3/h") == "GPM"
    assert "may say GPM" in remark_on_name("flow_GPM", "m^3/h")
    assert loose_in_name("level at", "Pa") == ""


PER_TIME = [("1/min", "rad/s"), ("min-1", "rad/s"), ("1/min", "deg/s"), ("1/s", "deg/s"), ("rad/s", "1/min")]


@pytest.mark.parametrize(("unit", "wanted"), PER_TIME)
def test_what_does_not_say_what_it_counts_is_no_angle_of_another_size(unit: str, wanted: str) -> None:
    with pytest.raises(Problem, match="one counts turns or angles, and the other does not say what it counts"):
        converted(np.ones(1), unit, wanted, ())
    assert not alike(unit, wanted)


def test_of_the_same_size_it_is_one_notation() -> None:
    for unit, wanted in (("1/s", "rad/s"), ("rad/min", "1/min")):
        assert alike(unit, wanted)
    assert converted(np.ones(1), "1/min", "1/s", ())[0] == pytest.approx(1 / 60)
    assert converted(np.ones(1), "deg/s^2", "rad/s^2", ())[0] == pytest.approx(np.pi / 180)


def test_a_log_of_speeds_per_minute_is_refused_until_it_says_what_it_counts(tmp_path: Path) -> None:
    times, values = noisy()
    log = table(times, values).replace("glucose", "n [1/min]")
    column = {"column": "n [1/min]"}
    for said in ({}, {"unit": "1/min"}):
        with pytest.raises(Problem, match=r"`turn/min` counts turns, `rad/min` radians"):
            recorded(tmp_path, log, {"outputs": {"S": column | said}}, units={"S": "rad/s"})
    found = recorded(tmp_path, log, {"outputs": {"S": column | {"unit": "turn/min"}}}, units={"S": "rad/s"})
    assert found.outputs["S"].values == pytest.approx(values * 2 * np.pi / 60)
