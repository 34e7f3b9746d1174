"""Units with a number are known units times a factor, wherever they stand; what cannot be read is told."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from logs import noisy, recorded, table

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.units.denominators import per_unit_of
from hgorun.data.units.factored_units import asked, joined, parted
from hgorun.data.units.loose_units import remark_on_name
from hgorun.data.units.named_units import said_in_name
from hgorun.data.units.unit_per_time import factors_of, unlike_rate
from hgorun.data.units.units import alike, alike_times, converted, is_time, is_unit, not_known, seconds
from hgorun.errors import ConfigError, Problem

# what one is in the unit of the model, by hand
CONVERTED = [
    ("g/100mL", "g/L", 10.0),
    ("g/100 mL", "g/L", 10.0),
    ("g/(100 mL)", "g/L", 10.0),
    ("g per 100 mL", "g/L", 10.0),
    ("kg/10L", "g/L", 100.0),
    ("mg/100g", "g/kg", 0.01),
    ("mmol/24h", "mmol/h", 1 / 24),
    ("L/100km", "L/km", 0.01),
    ("kWh/15 min", "kW", 4.0),
    ("10 g/100mL", "g/L", 100.0),
    ("g/(100 mL h)", "g/(L h)", 10.0),
    ("1e-3 m", "m", 1e-3),
    ("10^-3 m", "m", 1e-3),
    ("10**(-3) m", "m", 1e-3),
    ("10-3 m", "m", 1e-3),
    ("10⁻³ m", "m", 1e-3),
    ("2·10^-3 m", "m", 2e-3),
    ("0,1 m", "m", 0.1),
    ("10 mm", "mm", 10.0),
    ("10*mm", "mm", 10.0),
    ("10 x mm", "mm", 10.0),
    ("10N", "N", 10.0),
    ("mm/10", "mm", 0.1),
    ("1/10 K", "K", 0.1),
    ("1000 m3/h", "m^3/h", 1000.0),
    ("1 000 m3/h", "m^3/h", 1000.0),
    ("10^3 m^3/h", "L/h", 1e6),
    ("10³ m³/h", "m^3/h", 1000.0),
    ("10^6/mL", "1/L", 1e9),
    ("1000/min", "1/min", 1000.0),
    ("10 rpm", "rad/s", 20 * np.pi / 60),
    ("10 %", "-", 0.1),
    ("Mio. m3", "m^3", 1e6),
    ("thousand m3/h", "m^3/h", 1000.0),
    ("m", "10 mm", 100.0),
    ("100 mm", "10 cm", 1.0),
]
OPEN = [
    ("x10 K", "K", ["10 K", "0.1 K"]),
    ("×10 mm", "mm", ["10 mm", "0.1 mm"]),
    ("mm x10", "mm", ["10 mm", "0.1 mm"]),
    ("mm*10", "mm", ["10 mm", "0.1 mm"]),
    ("m E-3", "m", ["0.001 m", "1000 m"]),
    ("m 10^-3", "m", ["0.001 m", "1000 m"]),
    ("x10 bar(a)", "bar", ["10 bar", "0.1 bar"]),
    ("1/100 mL", "1/mL", ["1/(100 mL)"]),
    ("1/2 in", "mm", ["0.5 in"]),
    ("10 barg", "bar", ["10 bar"]),
    ("100 GPM", "m^3/h", ["100 gal/min"]),
    ("0.1 Grad", "K", ["0.1 degC"]),
    ("10 K deg", "K", ["10 K"]),
    ("0.1 promille", "-", ["0.1 permille"]),
    ("10 MBAR", "bar", ["10 Mbar", "10 mbar"]),
    ("m (x10)", "m", ["10 m", "0.1 m"]),
    ("x 10^3 t", "kg", ["1000 t", "0.001 t"]),  # the second one is a kilogram
    ("×10³ t", "kg", ["1000 t", "0.001 t"]),
    ("%*10", "-", ["10 %", "0.1 %"]),
]
UNREAD = [
    "103 m3/h",
    "1.000 m3/h",
    "1,000 m3/h",
    "1'000 m3/h",
    "0-50 m3/h",
    "0 m3/h",
    "m3/1,000h",
    "10^3 m3/h (N)x",
    "m3/(2 h 3)",
    "1e-333 m3/h",
]
LABELS = ["3 rooms", "2nd", "3rd floor", "tank 10", "x2", "10", "e-3", "1"]


@pytest.mark.parametrize(("unit", "wanted", "factor"), CONVERTED)
def test_a_number_times_a_unit_is_converted(unit: str, wanted: str, factor: float) -> None:
    assert converted(np.array([3.0]), unit, wanted, ())[0] == pytest.approx(3 * factor, rel=1e-12)
    assert (is_unit(unit), not_known(unit)) == (True, "")
    assert alike(unit, wanted) == (factor == 1)


def test_tenths_of_a_degree_are_degrees_with_their_zero() -> None:
    assert converted(np.array([205.0]), "0.1 degC", "K", ())[0] == pytest.approx(293.65, rel=1e-14)
    assert converted(np.array([293.65]), "K", "0.1 °C", ())[0] == pytest.approx(205.0, rel=1e-12)


@pytest.mark.parametrize(("unit", "wanted"), [one[:2] for one in CONVERTED if one[2] != 1 and one[0] != "m"])
def test_in_the_name_of_a_column_it_is_refused_until_a_key_says_so(tmp_path: Path, unit: str, wanted: str) -> None:
    column = f"y [{unit}]"
    log = table(*noisy()).replace("glucose", f'"{column}"')
    with pytest.raises(Problem, match=r"its name says .* unit: .*} converts, unit: .* takes the numbers as they are"):
        recorded(tmp_path, log, {"outputs": {"S": column}}, units={"S": wanted})
    found = recorded(tmp_path, log, {"outputs": {"S": {"column": column, "unit": unit}}}, units={"S": wanted})
    np.testing.assert_allclose(found.outputs["S"].values, converted(noisy()[1], unit, wanted, ()), rtol=1e-14)
    assert not found.notes


@pytest.mark.parametrize(("unit", "wanted", "meant"), OPEN)
def test_what_leaves_open_what_is_multiplied_is_asked(unit: str, wanted: str, meant: list[str]) -> None:
    assert said_in_name(f"y [{unit}]", wanted, stated=False) == unit
    with pytest.raises(Problem) as caught:
        converted(np.ones(1), unit, wanted, ())
    assert f" Did you mean {' or '.join(f'`{one}`' for one in meant)}?" in caught.value.message
    for one in meant:
        converted(np.ones(1), one, wanted, ())


@pytest.mark.parametrize("unit", UNREAD)
def test_a_number_that_cannot_be_read_is_told(tmp_path: Path, unit: str) -> None:
    column = f"y [{unit}]"
    log = table(*noisy()).replace("glucose", f'"{column}"')
    (note,) = recorded(tmp_path, log, {"outputs": {"S": column}}, units={"S": "m^3/h"}).notes
    told = f"its name says {unit}, which is not a known unit, the model has m^3/h: taken as they are"
    assert told in note.message
    with pytest.raises(Problem) as caught:
        converted(np.ones(1), unit, "m^3/h", ())
    assert "Did you mean" not in caught.value.message


def test_a_factor_alone_is_told() -> None:
    for text in ("1e-3", "10^-3", "x10", "*0.1", "/10"):
        assert said_in_name(f"y [{text}]", "-", stated=False) == said_in_name(f"y [{text}]", "K", stated=False) == text
    for text in ("10", "0.1", "x2", "0/1"):
        assert said_in_name(f"y [{text}]", "-", stated=False) == ""


@pytest.mark.parametrize("name", ["T [degC] x10", "T (degC)*10", "T [degC] / 10"])
def test_a_number_behind_the_brackets_belongs_to_the_unit(name: str) -> None:
    assert said_in_name(name, "degC", stated=False).startswith("degC ")
    assert said_in_name("T [raw] x10", "degC", stated=False) == said_in_name("T x10", "degC", stated=False) == ""


@pytest.mark.parametrize("text", LABELS)
def test_numbers_in_labels_are_none(text: str) -> None:
    assert not is_unit(text) or text == "1"
    assert said_in_name(f"y [{text}]", "m", stated=False) == ""


@pytest.mark.parametrize("name", ["T_5cm", "valve (2m)", "level 10 rooms"])
def test_a_place_behind_a_name_is_no_unit(name: str) -> None:
    assert said_in_name(name, "m", stated=False) == remark_on_name(name, "m") == ""


def test_a_place_in_round_brackets_is_no_unit_of_another_kind() -> None:
    assert remark_on_name("wind (10 m)", "m/s") == ""
    assert "its name says 10 m, the model has m/s, of another kind" in remark_on_name("wind [10 m]", "m/s")
    assert said_in_name("level in 10 mm", "m", stated=False) == "10 mm"


@pytest.mark.parametrize(
    ("row", "unit", "factor"), [("s,0.1 K", "0.1 K", 0.1), ("[s],[10 K]", "10 K", 10.0), ("s,1/10 K", "1/10 K", 0.1)]
)
def test_so_it_is_in_a_row_of_units(tmp_path: Path, row: str, unit: str, factor: float) -> None:
    log = f"t,y\n{row}\n0,5\n1,6\n"
    with pytest.raises(Problem, match=f"the file says {unit} in .* converts, unit: K takes"):
        recorded(tmp_path, log, {"outputs": {"S": "y"}}, units={"S": "K"})
    found = recorded(tmp_path, log, {"outputs": {"S": {"column": "y", "unit": unit}}}, units={"S": "K"})
    np.testing.assert_allclose(found.outputs["S"].values, [5 * factor, 6 * factor], rtol=1e-14)


def test_so_it_is_in_attributes_of_hdf5(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values, unit in (("t", [0.0, 1.0], "s"), ("y", [5.0, 6.0], "0.1 K")):
            file[name] = np.array(values)
            file[name].attrs["units"] = unit
    block: dict[str, Any] = {"file": "log.h5", "time": "t", "outputs": {"S": "y"}}
    with pytest.raises(Problem, match=r"the file says 0.1 K in .* converts, unit: K takes"):
        read(Data.model_validate(block), tmp_path, units={"S": "K"})
    stated = block | {"outputs": {"S": {"column": "y", "unit": "0.1 K"}}}
    assert read(Data.model_validate(stated), tmp_path, units={"S": "K"}).outputs["S"].values.tolist() == [0.5, 0.6]


@pytest.mark.parametrize("row", ["0 s,10 K\n1 s,11 K", "2024-01-01T00:00,10 K\n2024-01-01T00:01,11 K"])
def test_values_with_their_unit_are_no_row_of_units(tmp_path: Path, row: str) -> None:
    with pytest.raises(ConfigError, match="expected a number, found '10 K'"):
        recorded(tmp_path, f"t,y\n{row}\n", {"outputs": {"S": "y"}}, units={"S": "K"})


def test_times_that_count_several_units(tmp_path: Path) -> None:
    assert seconds("10 ms", ()) == Fraction(1, 100)
    assert is_time("0.1 s")
    assert alike_times("1000 ms", "s")
    assert not alike_times("10 ms", "ms")
    log, times = "t [10 ms],y\n1,11\n2,13\n", {"outputs": {"S": "y"}}
    with pytest.raises(Problem, match=r"its name says 10 ms .* unit: \"10 ms\"} converts, unit: s takes .* are$"):
        recorded(tmp_path, log, {**times, "time": "t [10 ms]"})
    stated: dict[str, Any] = {"time": {"column": "t [10 ms]", "unit": "10 ms"}}
    assert recorded(tmp_path, log, times | stated).outputs["S"].taken.tolist() == [0.01, 0.02]


def test_names_of_other_depths_in_parts_of_a_log_are_no_other_spelling(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("t,T_5cm,T_10cm\n5,1,2\n6,2,3\n")
    changes = {"file": ["log.csv", "b.csv"], "outputs": {"S": "T_5cm", "X": "T_10cm"}}
    found = recorded(tmp_path, "t,T_10cm\n0,5\n1,6\n", changes, units={"S": "K", "X": "K"})
    assert found.outputs["S"].values.tolist() == [1, 2]


def test_units_of_rates_and_of_other_times() -> None:
    assert unlike_rate("10 mm", "s", "10 mm/s") == unlike_rate("g/100mL", "s", "g/100mL/s") == ""
    assert unlike_rate("10 mm", "s", "mm/s") == "1 10 mm per s is 10 mm/s"
    assert factors_of("10 mm") is None
    assert per_unit_of("mmol/24h", "h") == "mmol/h"
    assert per_unit_of("g/100mL", "h") == ""


@pytest.mark.parametrize("text", ["1e99 m/1e-99s", "m/0", "1/0 m", "0 m", "1 " + 200 * "m"])
def test_numbers_that_are_too_large_or_nothing_are_not_read(text: str) -> None:
    assert parted(text) == (Fraction(1), text)


def test_a_factor_is_written_as_it_is_read() -> None:
    assert joined(Fraction(1), "m") == "m"
    for factor in (Fraction(1, 10), Fraction(10**6), Fraction(1, 24)):
        found, unit = parted(joined(factor, "h"))
        assert (float(found), unit) == (float(factor), "h")
    assert list(asked("x1 m")) == list(asked("x0 m")) == list(asked("m")) == []


SIZES = [
    ("Mm3/d", "m^3/d", ""),
    ("kt/h", "kg/h", ""),
    ("Mm", "m", ""),
    ("hm3/h", "m^3/h", ""),
    ("mBar", "bar", " Did you mean `mbar`?"),
    ("MBAR", "bar", " Did you mean `Mbar` or `mbar`?"),
    ("Mhz", "Hz", " Did you mean `MHz`?"),
    ("mgL", "g/L", " Did you mean `mg/L`?"),
    ("kp m", "N*m", " Did you mean `kgf m`?"),
    ("kpm", "N*m", " Did you mean `kgf*m`?"),
    ("permil", "1", " Did you mean `permille`?"),
    ("Grad", "K", " Did you mean `degC`?"),
    ("Grad", "rad", " Did you mean `deg`?"),
]


@pytest.mark.parametrize(("unit", "wanted", "told"), SIZES)
def test_what_is_proposed_is_no_other_size_than_what_is_written(unit: str, wanted: str, told: str) -> None:
    with pytest.raises(Problem) as caught:
        converted(np.ones(1), unit, wanted, ())
    assert told in caught.value.message
    assert ("Did you mean" in caught.value.message) == bool(told)
    assert (said_in_name(f"y [{unit}]", wanted, stated=False) == unit) == (unit != "mgL")


@pytest.mark.parametrize("sign", ["°", "º", "˚", "∘", "Â°"])
def test_a_sign_of_degrees_alone_is_one_of_angles(sign: str) -> None:
    assert converted(np.array([180.0]), sign, "rad", ())[0] == pytest.approx(np.pi, rel=1e-14)
    assert converted(np.array([180.0]), f"{sign}/s", "rad/s", ())[0] == pytest.approx(np.pi, rel=1e-14)
    assert said_in_name(f"phi [{sign}]", "rad", stated=False) == sign
