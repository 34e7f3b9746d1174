"""What stands in a log, read as it stands there."""

from __future__ import annotations

import codecs
import csv
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from logs import LOG, noisy, recorded, table

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy()
PLAIN = table(TIMES, VALUES)


def lines_of(text: str) -> dict[float, tuple[float, int]]:
    """An oracle: the values by their times, with their lines, of Python's reader and numbers."""
    rows = enumerate(csv.reader(io.StringIO(text)), start=1)
    return {float(t): (float(v), line) for line, (t, v) in rows if line > 1}


def semicolons(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    ("written", "shift"),
    [
        (PLAIN.encode(), 0),
        (PLAIN.replace("\n", "\r\n").encode(), 0),
        (PLAIN.replace("\n", "\r").encode(), 0),
        (PLAIN.replace("\n", "\r\n", 7).encode(), 0),
        (PLAIN.rstrip("\n").encode(), 0),
        (codecs.BOM_UTF8 + PLAIN.encode(), 0),
        (PLAIN.encode("utf-16"), 0),
        (codecs.BOM_UTF16_BE + PLAIN.encode("utf-16-be"), 0),
        (semicolons(PLAIN).encode(), 0),
        (semicolons(PLAIN).replace("\n", ";\n").replace("glucose;", "glucose").encode(), 0),
        (PLAIN.replace(",", "\t").encode(), 0),
        (PLAIN.replace(",", "|").encode(), 0),
        (PLAIN.replace(",", "   ").encode(), 0),
        (PLAIN.replace(",", " , ").encode(), 0),
        (("# made by a logger\n\n" + PLAIN).encode(), 2),
        (("# t,glucose\n" + PLAIN.partition("\n")[2]).encode(), 0),
        (PLAIN.replace("glucose\n", "glucose\ns,g/L\n").encode(), 1),
        (PLAIN.replace("t,glucose", '"t","glucose"').encode(), 0),
        ("\n".join(",".join(f'"{cell}"' for cell in row.split(",")) for row in PLAIN.split()).encode(), 0),
        (("\n".join(f"{row},ok \u00b0" for row in PLAIN.split()).replace("ok", "note", 1) + "\n").encode(), 0),
    ],
)
def test_however_it_is_written(tmp_path: Path, written: bytes, shift: int) -> None:
    signal = recorded(tmp_path, written).outputs["S"]
    found = {t: (v, line - shift) for t, v, line in zip(signal.taken, signal.values, signal.lines, strict=True)}
    assert found == lines_of(PLAIN)
    assert signal.available is signal.taken


@pytest.mark.parametrize(
    ("encoding", "told"),
    [("latin-1", "latin-1"), ("cp1252", "cp1252"), ("utf-16-le", "utf-16"), ("utf-8", "utf-8"), ("utf-16", None)],
)
def test_an_encoding_that_is_told(tmp_path: Path, encoding: str, told: str | None) -> None:
    content = PLAIN.replace("glucose", "größe").encode(encoding)
    changes = {"outputs": {"S": "größe"}, "csv": {"encoding": told} if told else {}}
    np.testing.assert_array_equal(recorded(tmp_path, content, changes).outputs["S"].values, VALUES)


@pytest.mark.parametrize(
    ("sign", "thousands", "decimal"),
    [(".", ".", ","), (",", ",", "."), (" ", " ", ","), ("\u202f", " ", ","), ("'", "'", "."), ("\u2019", "'", ".")],
)
def test_signs_between_thousands(tmp_path: Path, sign: str, thousands: str, decimal: str) -> None:
    values = np.round(VALUES * 1e5, 2)
    values[:4] = [-1234567.25, 12, 999.5, 1000]
    texts = [f"{v:,.2f}".replace(",", "~").replace(".", decimal).replace("~", sign) for v in values.tolist()]
    times = [f"{t:.3f}".replace(".", decimal) for t in TIMES.tolist()]
    content = "\n".join(["t;glucose", *map(";".join, zip(times, texts, strict=True))])
    told = {"csv": {"thousands": thousands, "decimal": decimal}, "faults": {"slips": "report"}}
    np.testing.assert_array_equal(recorded(tmp_path, content, told).outputs["S"].values, values)
    with pytest.raises(ConfigError, match=r"log\.csv:2: glucose: expected a number.*thousands"):
        recorded(tmp_path, content, {"csv": {"decimal": decimal}})


def test_a_unit_that_is_only_written_otherwise_is_not_told(tmp_path: Path) -> None:
    content = PLAIN.replace("glucose\n", "glucose\ns,°C\n")
    assert not recorded(tmp_path, content, units={"S": "degC"}).notes
    with pytest.raises(Problem, match=r'the file says °C .*column: "glucose", unit: °C. converts'):
        recorded(tmp_path, content, units={"S": "K"})


def test_what_is_no_group_of_three_is_no_thousand(tmp_path: Path) -> None:
    content = "t;glucose\n" + "".join(f"{k};{10 + k},5\n" for k in range(9)) + "9;1.50\n"
    with pytest.raises(ConfigError, match=r"log\.csv:11: glucose: expected a number, found '1\.50'"):
        recorded(tmp_path, content, {"csv": {"thousands": "."}})
    with pytest.raises(ValueError, match="cannot both have the sign"):
        recorded(tmp_path, content, {"csv": {"thousands": ".", "decimal": "."}})


def test_every_digit_is_read(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    values = random.normal(size=500) * 10.0 ** random.integers(-300, 300, 500)
    signal = recorded(tmp_path, table(np.arange(500.0), values)).outputs["S"]
    np.testing.assert_array_equal(signal.values, values)


def test_missing_values_are_left_out_and_told(tmp_path: Path) -> None:
    rows = PLAIN.splitlines()
    for line, text in [(3, ""), (5, "NaN"), (8, "n/a"), (9, "fehlt")]:
        rows[line - 1] = rows[line - 1].split(",")[0] + "," + text
    changes = {"csv": {"missing": ["fehlt"]}}
    recording = recorded(tmp_path, "\n".join(rows), changes)
    assert set(recording.outputs["S"].lines) == set(range(2, 42)) - {3, 5, 8, 9}
    (note,) = recording.notes
    assert (note.kind, note.line, note.count) == ("missing", 3, 4)
    assert str(note) == f"{tmp_path / 'log.csv'}:3: outputs.S: 4 samples left out: the value is missing"
    with pytest.raises(ConfigError, match=r"log\.csv:3: outputs\.S: the value is missing"):
        recorded(tmp_path, "\n".join(rows), changes | {"faults": {"missing": "refuse"}})


def test_a_reference_that_observers_get_is_told(tmp_path: Path) -> None:
    both, (other, own) = {"T": "other"}, ("t,glucose,other\n0,1,2\n1,3,5\n", {"S": {"column": "glucose"}})
    assert not recorded(tmp_path, other, {"reference": both}).notes
    (note,) = recorded(tmp_path, other, {"reference": both | own}).notes
    told = "observers get this column as outputs.S: estimates are compared with what they use"
    assert str(note) == f"{tmp_path / 'log.csv'}: reference.S: {told}"


@pytest.mark.parametrize("cell", ["-9999", "-9999.0", '"-9999"', " -9999 "])
@pytest.mark.parametrize("quoted", [False, True])  # rows with quotes are read one by one
def test_a_number_that_stands_for_a_missing_value_is_left_out(cell: str, quoted: bool, tmp_path: Path) -> None:
    rows = PLAIN.splitlines()
    rows[4] = rows[4].split(",")[0] + "," + cell
    if quoted:
        rows[2] = rows[2].split(",")[0] + ',"' + rows[2].split(",")[1] + '"'
    recording = recorded(tmp_path, "\n".join(rows), {"csv": {"missing": ["-9999"]}})
    assert set(recording.outputs["S"].lines) == set(range(2, 42)) - {5}
    assert recording.outputs["S"].values.min() > -9999


def test_signals_of_one_table_have_clocks_of_their_own(tmp_path: Path) -> None:
    text = "t,glucose,ethanol\n0,1.5,\n1,1.25,\n2,1.75,0.5\n3,1.5,\n4,,0.75\n"
    recording = recorded(tmp_path, text, {"outputs": {"S": "glucose", "E": "ethanol"}})
    np.testing.assert_array_equal(recording.outputs["S"].taken, [0, 1, 2, 3])
    np.testing.assert_array_equal(recording.outputs["E"].taken, [2, 4])
    np.testing.assert_array_equal(recording.outputs["E"].lines, [4, 6])
    assert recording.span == (0, 4)
    assert recording.median_gap == 1


def test_late_samples_are_sorted_by_the_time_they_were_taken(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_text("drawn,known,e\n5,30,0.5\n1,20,0.1\n9,21,0.9\n")
    late = {"file": "lab.csv", "column": "e", "time": "drawn", "available": "known"}
    recording = recorded(tmp_path, PLAIN, {"outputs": {"S": "glucose", "E": late}})
    signal = recording.outputs["E"]
    assert signal.late
    np.testing.assert_array_equal(signal.taken, [1, 5, 9])
    np.testing.assert_array_equal(signal.available, [20, 30, 21])
    np.testing.assert_array_equal(signal.values, [0.1, 0.5, 0.9])
    np.testing.assert_array_equal(signal.lines, [3, 2, 4])
    assert recording.span[1] == max(30, TIMES[-1])


def test_parts_of_a_log_follow_each_other_and_lines_are_those_of_the_part(tmp_path: Path) -> None:
    rows = PLAIN.splitlines()
    (tmp_path / "a.csv").write_text("\n".join(rows[:20]))
    (tmp_path / "b.csv").write_text("\n".join([rows[0], *rows[20:]]))
    recording = read(Data.model_validate(LOG | {"file": ["a.csv", "b.csv"]}), tmp_path)
    np.testing.assert_array_equal(recording.outputs["S"].values, VALUES)
    assert recording.outputs["S"].lines[[0, 18, 19]].tolist() == [2, 20, 2]
    (tmp_path / "b.csv").write_text("\n".join([rows[0], rows[4], *rows[20:]]))
    with pytest.raises(ConfigError, match=r"b\.csv:2: outputs\.S: the time stamp .* lies before one above"):
        read(Data.model_validate(LOG | {"file": ["a.csv", "b.csv"]}), tmp_path)


def test_files_behind_the_command_take_the_place_of_those_in_the_block(tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_text(PLAIN)
    recording = read(Data.model_validate(LOG | {"file": "none.csv"}), tmp_path, files=[tmp_path / "mine.csv"])
    assert recording.outputs["S"].source == tmp_path / "mine.csv"


def test_inputs_may_be_ramps_and_levels(tmp_path: Path) -> None:
    text = "t,glucose,feed\n" + "".join(f"{t},{v},{0.25 * t}\n" for t, v in zip(TIMES, VALUES, strict=True))
    feed = recorded(tmp_path, text, {"inputs": {"F": {"column": "feed", "hold": "linear"}}}).inputs["F"]
    np.testing.assert_array_equal(feed.values, 0.25 * TIMES)
    assert feed.hold == "linear"


@pytest.mark.parametrize(
    ("said", "unit", "model", "expected"),
    [
        ("mg/L", "mg/L", "g/L", VALUES / 1000),
        ("kg/m^3", "kg/m^3", "g/L", VALUES),
        ("degC", "degC", "K", VALUES + 273.15),
        ("g/L", "g/L", "g/L", VALUES),
    ],
)
def test_units_are_converted(tmp_path: Path, said: str, unit: str, model: str, expected: np.ndarray) -> None:
    changes = {"outputs": {"S": {"column": "glucose", "unit": said}}}
    signal = recorded(tmp_path, PLAIN, changes, units={"S": model}).outputs["S"]
    np.testing.assert_allclose(signal.values, expected, rtol=1e-12)
    assert signal.unit == model


def test_a_unit_of_the_file_that_is_not_the_models_is_refused(tmp_path: Path) -> None:
    content = PLAIN.replace("glucose\n", "glucose\n[s],[mg/L]\n")
    with pytest.raises(Problem, match=r"the file says mg/L in .*log\.csv, the model has g/L") as caught:
        recorded(tmp_path, content, units={"S": "g/L"})
    assert caught.value.path == ("data", "outputs", "S")
    for unit, factor in [("mg/L", 0.001), ("g/L", 1)]:  # whoever says the unit is believed
        recording = recorded(
            tmp_path, content, {"outputs": {"S": {"column": "glucose", "unit": unit}}}, units={"S": "g/L"}
        )
        np.testing.assert_allclose(recording.outputs["S"].values, VALUES * factor, rtol=1e-15)
        assert [note.kind for note in recording.notes] == ["units"] * (unit == "g/L")
    (note,) = recorded(tmp_path, content.replace("mg/L", "Skt"), units={"S": "rad"}).notes
    assert "the file says Skt, which is not a known unit, the model has rad: taken as they are" in str(note)


@pytest.mark.parametrize("header", ["glucose [grad]", "glucose\n[s],[grad]"])
def test_a_unit_that_is_not_converted_is_never_taken_without_a_word(tmp_path: Path, header: str) -> None:
    """A hundred of them are a right angle; German degrees are called so, too."""
    content, column = PLAIN.replace("glucose\n", f"{header}\n"), header.split("\n")[0]
    said = (
        r"says grad in .*log\.csv, the model has rad: grad is not among the units that are converted; unit: rad takes"
    )
    with pytest.raises(Problem, match=rf"{said} the numbers as they are\. Did you mean `deg`\?"):
        recorded(tmp_path, content, {"outputs": {"S": {"column": column}}}, units={"S": "rad"})
    for unit, factor in [("deg", np.pi / 180), ("rad", 1)]:
        changes = {"outputs": {"S": {"column": column, "unit": unit}}}
        signal = recorded(tmp_path, content, changes, units={"S": "rad"}).outputs["S"]
        np.testing.assert_allclose(signal.values, VALUES * factor, rtol=1e-15)


def test_seconds_of_arc_in_a_name_are_refused_and_converted(tmp_path: Path) -> None:
    content, column = PLAIN.replace("glucose\n", "glucose [arcsec]\n"), "glucose [arcsec]"
    with pytest.raises(Problem, match=r"unit: arcsec} converts, unit: rad takes"):
        recorded(tmp_path, content, {"outputs": {"S": {"column": column}}}, units={"S": "rad"})
    changes = {"outputs": {"S": {"column": column, "unit": "arcsec"}}}
    signal = recorded(tmp_path, content, changes, units={"S": "rad"}).outputs["S"]
    np.testing.assert_allclose(signal.values, VALUES / 206264.80624709636, rtol=1e-13)


@pytest.mark.parametrize("unit", ["V", "mV"])
def test_a_unit_of_another_kind_is_refused(tmp_path: Path, unit: str) -> None:
    content = PLAIN.replace("glucose\n", f"glucose\n[s],[{unit}]\n")
    with pytest.raises(
        Problem, match=f"says {unit} .* which is of another kind, unit: g/L takes the numbers as they are"
    ):
        recorded(tmp_path, content, units={"S": "g/L"})


def test_each_part_of_a_log_has_its_unit(tmp_path: Path) -> None:
    """The second logger writes mg/L."""
    first, second = PLAIN.replace("glucose\n", "glucose\ns,g/L\n"), "t,glucose\ns,mg/L\n100,20000\n101,21000\n"
    (tmp_path / "later.csv").write_text(second)
    with pytest.raises(Problem, match=r"log\.csv says g/L and .*later\.csv mg/L, and a unit is that of all files"):
        recorded(tmp_path, first, {"file": ["log.csv", "later.csv"]}, units={"S": "g/L"})


def test_what_is_advised_can_be_written(tmp_path: Path) -> None:
    """A column whose name holds what YAML writes lists with."""
    content = PLAIN.replace("glucose", "S [%]")
    with pytest.raises(Problem) as caught:
        recorded(tmp_path, content, {"outputs": {"S": "S [%]"}}, units={"S": "kg/kg"})
    advised = re.search(r"\{column.*?\}", caught.value.message)
    assert advised is not None
    column = yaml.safe_load(advised[0])
    recording = recorded(tmp_path, content, {"outputs": {"S": column}}, units={"S": "kg/kg"})
    np.testing.assert_allclose(recording.outputs["S"].values, VALUES / 100, rtol=1e-15)


def test_empty_cells_of_several_rates_are_told_once(tmp_path: Path) -> None:
    rows = [f"{t!r},{v!r},{v / 2!r}" for t, v in zip(TIMES.tolist(), VALUES.tolist(), strict=True)]
    rows = [row.rsplit(",", 1)[0] + "," if k % 4 else row for k, row in enumerate(rows)]
    rows[10] = rows[10].split(",")[0] + ",,"
    changes = {"outputs": {"S": "glucose", "E": "ethanol"}}
    (note,) = recorded(tmp_path, "\n".join(["t,glucose,ethanol", *rows]), changes).notes
    told = "samples left out: the value is missing (1 of outputs.S, 30 of outputs.E)"
    assert str(note) == f"{tmp_path / 'log.csv'}:3: {told}"
    assert note.count == 31


@pytest.mark.parametrize(
    ("changes", "path", "message"),
    [
        (
            {"outputs": {"S": "glucos"}},
            ("data", "outputs", "S", "column"),
            "no column 'glucos'. Did you mean `glucose`",
        ),
        ({"time": "time"}, ("data", "time", "column"), "no column 'time'"),
        ({"file": "nowhere.csv"}, ("data", "file"), "no such file"),
        ({"file": []}, ("data",), "no file is given"),
        ({"file": "."}, ("data", "file"), "this is a folder"),
        ({"time": None}, ("data",), "time is missing"),
        ({"origin": "2024-01-01"}, ("data", "origin"), "have their own origin"),
        ({"time": {"column": "t", "unit": "fortnight"}}, ("data", "time", "unit"), "is not a unit of time"),
        (
            {"outputs": {"S": {"column": "glucose", "unit": "K"}}},
            ("data", "outputs", "S", "unit"),
            "cannot be converted",
        ),
        (
            {"outputs": {"S": {"column": "glucose", "unit": "wug"}}},
            ("data", "outputs", "S", "unit"),
            "not a known unit",
        ),
        (
            {"outputs": {"S": {"column": "glucose", "unit": "m**9**9**9"}}},
            ("data", "outputs", "S", "unit"),
            "cannot be",
        ),
        (
            {"outputs": {"S": {"column": "glucose", "quality": {"column": "q", "good": [0]}}}},
            ("data", "outputs", "S", "quality", "column"),
            "no column 'q'",
        ),
    ],
)
def test_keys_that_name_what_is_not_there(
    tmp_path: Path, changes: dict[str, Any], path: tuple[str, ...], message: str
) -> None:
    (tmp_path / "log.csv").write_text(PLAIN)
    block = {key: value for key, value in (LOG | changes).items() if value is not None}
    with pytest.raises(Problem) as caught:
        read(Data.model_validate(block), tmp_path, units={"S": "g/L"})
    assert caught.value.path == path
    assert message in caught.value.message


def test_what_it_takes_is_bounded(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"limit of data\.max_memory"):
        recorded(tmp_path, PLAIN, {"max_memory": 500})


def test_decimal_commas_between_commas(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="4 cells, where the header has 2; decimal commas in a file separated by"):
        recorded(tmp_path, "t,glucose\n0,0,20,1\n0,1,20,2\n")


@pytest.mark.parametrize(
    ("column", "unit", "told"),
    [
        ("S [mg/L]", "g/L", "its name says mg/L, the configuration unit: g/L, which is taken; is it mg/L?"),
        ("S [mg/L]", "mg/l", None),
        ("S [g/l]", None, None),
        ("S (A)", None, None),  # a place, and not ampere
        ("S (2)", None, None),
        ("S [raw]", None, None),
        ("[mg/L]", None, None),
        ("growth in vessel", None, None),
    ],
)
def test_a_unit_in_the_name_of_a_column_is_told_where_another_is_taken(
    tmp_path: Path, column: str, unit: str | None, told: str | None
) -> None:
    changes = {"outputs": {"S": {"column": column} | ({"unit": unit} if unit else {})}}
    notes = recorded(tmp_path, PLAIN.replace("glucose", column), changes, units={"S": "g/L"}).notes
    assert [note.kind for note in notes] == ["units"] * (told is not None)
    assert told is None or told in str(notes[0])


@pytest.mark.parametrize("column", ["S [mg/L]", "S (mg/L)", "S in mg/L"])
def test_and_refused_where_nobody_says_which_is_right(tmp_path: Path, column: str) -> None:
    told = "its name says mg/L in .*log.csv, the model has g/L: .* unit: mg/L} converts, unit: g/L takes the numbers"
    with pytest.raises(Problem, match=told):
        recorded(tmp_path, PLAIN.replace("glucose", column), {"outputs": {"S": column}}, units={"S": "g/L"})


@pytest.mark.parametrize(
    ("column", "unit", "told"),
    [
        ("Zeit [min]", "h", "column 'Zeit [min]': its name says min, the configuration unit: h, which is taken"),
        ("Zeit (minutes)", "min", None),
        ("Zeit [h]", None, None),
        ("Zeit [local]", None, None),
    ],
)
def test_so_is_one_of_the_time(tmp_path: Path, column: str, unit: str | None, told: str | None) -> None:
    changes = {"time": {"column": column} | ({"unit": unit} if unit else {})}
    notes = recorded(tmp_path, PLAIN.replace("t,", column + ",", 1), changes, time_unit="h").notes
    assert [note.kind for note in notes] == ["clock"] * (told is not None)
    assert told is None or told in str(notes[0])
    told = "its name says min in .*, the run counts in h: .* unit: h takes the numbers as they are, and time.unit: min"
    with pytest.raises(Problem, match=told):
        recorded(tmp_path, PLAIN.replace("t,", "Zeit [min],", 1), {"time": "Zeit [min]"}, time_unit="h")


def test_degrees_are_no_coulombs(tmp_path: Path) -> None:
    assert not recorded(
        tmp_path, PLAIN.replace("glucose", "T [C]"), {"outputs": {"S": "T [C]"}}, units={"S": "degC"}
    ).notes
    with pytest.raises(Problem, match=r"says degF in .*, the model has degC"):
        recorded(tmp_path, PLAIN.replace("glucose", "T [F]"), {"outputs": {"S": "T [F]"}}, units={"S": "degC"})


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("mgl", "'mgl' is not a known unit. Did you mean `mg/L`?"),
        ("mL", "mL cannot be converted to the model's g/L: it is of another kind. Did you mean `mg/L`?"),
        ("xyzzy", "'xyzzy' is not a known unit; without the key"),
    ],
)
def test_a_unit_that_does_not_fit_suggests_one_that_does(tmp_path: Path, unit: str, message: str) -> None:
    changes = {"outputs": {"S": {"column": "glucose", "unit": unit}}}
    with pytest.raises(Problem) as caught:
        recorded(tmp_path, PLAIN, changes, units={"S": "g/L"})
    assert message in caught.value.message
