"""What is said of an odd log names the right place, and is right when it is followed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pytest
from logs import noisy, recorded, table
from pyarrow import parquet

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy()


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_a_mark_in_either_order(tmp_path: Path, encoding: str) -> None:
    content = table(TIMES, VALUES).replace("glucose", "größe").encode(encoding)
    with pytest.raises(ConfigError, match=r"encoding: utf-16"):
        recorded(tmp_path, content, {"outputs": {"S": "größe"}})
    told = {"outputs": {"S": "größe"}, "csv": {"encoding": "utf-16"}}
    assert recorded(tmp_path, content, told).outputs["S"].values.tolist() == VALUES.tolist()


def test_a_comma_that_may_be_either_is_named_with_its_line_and_both_remedies_read_it(tmp_path: Path) -> None:
    content = "t;glucose\n0;999\n1;1,234\n2;1,235\n3;1,230\n"
    with pytest.raises(ConfigError, match=r":3: '1,234' may be .*csv: {thousands: \",\"} or {decimal: \",\"}"):
        recorded(tmp_path, content)
    told = recorded(tmp_path, content, {"csv": {"thousands": ","}}).outputs["S"].values
    assert told.tolist() == [999, 1234, 1235, 1230]
    told = recorded(tmp_path, content, {"csv": {"decimal": ","}, "faults": {"slips": "report"}}).outputs["S"].values
    assert told.tolist() == [999, 1.234, 1.235, 1.23]
    with pytest.raises(ConfigError, match=r"decimals have a point here; .*{decimal: \",\"}; for .*{thousands: \",\"}"):
        recorded(tmp_path, content, {"csv": {"decimal": "."}})


def test_one_column_with_the_other_sign_gets_a_csv_of_its_own(tmp_path: Path) -> None:
    """The sign of all of the file, which is advised elsewhere, is wrong for the others."""
    content = "t;T;glucose\n0;20.5;1,25\n1;21.25;1,5\n2;20.75;1,75\n3;21.0;2,25\n"
    both = {"reference": {"T": "T"}}
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, content, both | {"csv": {"decimal": "."}})
    right = """'1,25'; this column has decimal commas, and 'T' has points: csv with decimal: "," below its signal """
    assert right in caught.value.message
    with pytest.raises(
        ConfigError, match=r"'20\.5'; this column has decimal points, and 'glucose' has commas: csv with"
    ):
        recorded(tmp_path, content, both | {"csv": {"decimal": ","}})
    found = recorded(tmp_path, content, both | {"outputs": {"S": {"column": "glucose", "csv": {"decimal": ","}}}})
    assert found.outputs["S"].values.tolist() == [1.25, 1.5, 1.75, 2.25]
    assert found.reference["T"].values.tolist() == [20.5, 21.25, 20.75, 21.0]
    with pytest.raises(ConfigError, match=r"'glucose' has commas: write one sign into all of the file"):
        recorded(tmp_path, content, {"time": "T", "csv": {"decimal": ","}})
    with pytest.raises(ConfigError, match=r"found 'bad'; if it means"):
        recorded(tmp_path, content.replace("1,25", "bad"), both | {"csv": {"decimal": "."}})


@pytest.mark.parametrize("text", ["1.#QNAN", "1.#IND", "-1.#IND00"])
def test_no_number_as_c_wrote_it_is_missing_once_it_is_told(tmp_path: Path, text: str) -> None:
    content = f"t,glucose\n0,7\n1,8\n2,{text}\n3,9.5\n"
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, content)
    assert f'csv: {{missing: ["{text}"]}}' in caught.value.message
    recording = recorded(tmp_path, content, {"csv": {"missing": [text]}})
    assert recording.outputs["S"].taken.tolist() == [0, 1, 3]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\u22120.5", "'\u2212' is no sign of a number (U+2212): write -0.5"),
        ("\uff11\uff0e\uff15", "'\uff11' is no sign of a number (U+FF11): write 1.5"),
        ("1\u0662", "'\u0662' is no sign of a number (U+0662): write 12"),
        ("1.5.2", "expected a number, found '1.5.2'"),
        ("1e", "expected a number, found '1e'"),
        ("2\u00b2", "expected a number, found '2\u00b2'"),
    ],
)
def test_a_cell_that_is_almost_a_number(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, f"t,glucose\n0,1\n1,{text}\n")
    assert caught.value.line == 3
    assert caught.value.message.endswith(said)


@pytest.mark.parametrize(
    ("header", "units"),
    [("# t,glucose\n# s,g/L\n", "g/L"), ("# t,glucose\n\n", ""), ("# t,glucose\n\n# s,(g/L)\n", "g/L")],
)
def test_a_header_in_comments_with_units_or_an_empty_line_below(tmp_path: Path, header: str, units: str) -> None:
    content = header + table(TIMES, VALUES).partition("\n")[2]
    recording = recorded(tmp_path, content)
    assert recording.outputs["S"].values.tolist() == VALUES.tolist()
    assert recording.outputs["S"].unit == units
    if units:
        with pytest.raises(Problem, match="the file says g/L"):
            recorded(tmp_path, content, units={"S": "mol/L"})


@pytest.mark.parametrize("header", ["# of a logger,b\n# t,glucose\n", "# m,s\n# t,glucose\n", "# 1,2\n# t,glucose\n"])
def test_the_last_comment_is_the_header_unless_it_states_units(tmp_path: Path, header: str) -> None:
    content = header + table(TIMES, VALUES).partition("\n")[2]
    assert recorded(tmp_path, content).outputs["S"].values.tolist() == VALUES.tolist()


@pytest.mark.parametrize(
    ("header", "unit"),
    [("# t,h\n# s,m\n", "m"), ("# s,m\n# t,h\n", ""), ("# made today\n# t , h\n# s,m\n", "m"), ("# t,h\n", "")],
)
def test_names_in_a_comment_may_be_units_too(tmp_path: Path, header: str, unit: str) -> None:
    """t is a tonne and h an hour; which line has the names is told by the column of time stamps."""
    output = recorded(tmp_path, f"{header}0,1\n1,3\n", {"time": "t", "outputs": {"S": "h"}}).outputs["S"]
    assert (output.values.tolist(), output.unit) == ([1, 3], unit)


@pytest.mark.parametrize("comment", ["# s,g/L", "#[s],[g/L]", "# a remark\n# s,g/L"])
def test_a_comment_below_the_header_may_state_units(tmp_path: Path, comment: str) -> None:
    content = table(TIMES, VALUES).replace("glucose\n", f"glucose\n{comment}\n")
    recording = recorded(tmp_path, content, units={"S": "g/L"})
    assert recording.outputs["S"].values.tolist() == VALUES.tolist()
    with pytest.raises(Problem, match="the file says g/L"):
        recorded(tmp_path, content, units={"S": "mol/L"})


@pytest.mark.parametrize("comment", ["# s,no unit", "# s", "# s,g/L,m", "# , ", "# 1,2"])
def test_another_comment_below_the_header_states_none(tmp_path: Path, comment: str) -> None:
    content = table(TIMES, VALUES).replace("glucose\n", f"glucose\n{comment}\n")
    assert recorded(tmp_path, content, units={"S": "mol/L"}).outputs["S"].values.tolist() == VALUES.tolist()


def test_columns_called_as_units_below_a_title(tmp_path: Path) -> None:
    content = "# made today\n# s,m\n0,1\n1,3\n"
    recording = recorded(tmp_path, content, {"time": "s", "outputs": {"S": "m"}})
    assert recording.outputs["S"].values.tolist() == [1, 3]


def test_integers_beyond_what_a_double_holds_are_not_called_equal(tmp_path: Path) -> None:
    stamps = [1714564800000000001, 1714564800000000003, 1714564800000000900]
    content = "t,glucose\n" + "".join(f"{stamp},{k % 2}\n" for k, stamp in enumerate(stamps))
    said = r":3: .* has come before, on line 2, or is the same only as it is rounded, to multiples of 256 here: "
    with pytest.raises(ConfigError, match=said):
        recorded(tmp_path, content, {"time": {"column": "t", "format": "unix", "unit": "ns"}})
    parquet.write_table(pyarrow.table({"t": [2**53, 2**53 + 1], "glucose": [1.0, 2.0]}), tmp_path / "log.parquet")
    with pytest.raises(ConfigError, match=r"has come before, on line 2;"):
        recorded(tmp_path, "t,glucose\n7,1\n7,2\n")
    block = Data.model_validate({"file": "log.parquet", "time": "t", "outputs": {"S": "glucose"}})
    with pytest.raises(ConfigError, match=r":2: .* has come before, on line 1, or is the same only as it is rounded"):
        read(block, tmp_path)


def test_of_two_rows_with_one_stamp_the_later_one_has_come_again(tmp_path: Path) -> None:
    known = {"outputs": {"S": {"column": "glucose", "available": "known"}}}
    with pytest.raises(ConfigError, match=r"log\.csv:4: .*time stamp 1 s has come before, on line 3;"):
        recorded(tmp_path, "t,known,glucose\n0,0,1\n1,5,2\n1,3,4\n3,3,5\n", known)
    (tmp_path / "more.csv").write_text("t,glucose\n1,5\n2,7\n")
    with pytest.raises(ConfigError, match=r"more\.csv:2: .*time stamp 1 s has come before, on line 3 of .*log\.csv;"):
        recorded(tmp_path, "t,glucose\n0,3\n1,4\n", {"file": ["log.csv", "more.csv"]})


@pytest.mark.parametrize(
    ("known", "taken", "said"),
    [
        ("1.9999999", "2", "known at 1.9999999 s, before it was taken at 2 s"),
        ("1e9", "1000000000.0000001", "known at 1000000000 s, before it was taken at 1000000000.0000001 s"),
    ],
)
def test_two_times_that_differ_little_are_told_apart(tmp_path: Path, known: str, taken: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        recorded(
            tmp_path,
            f"t,known,glucose\n{taken},{known},3\n",
            {"outputs": {"S": {"column": "glucose", "available": "known"}}},
        )
    assert said in caught.value.message


def test_a_file_without_columns_has_none(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["d"] = np.zeros(3, dtype=[("t", "f8"), ("glucose", "f8")])
    block = Data.model_validate({"file": "log.h5", "time": "d/t", "outputs": {"S": "d/glucose"}})
    with pytest.raises(Problem, match=r"has no column 'd/glucose'.* in records of d, .* each of t, glucose .*has none"):
        read(block, tmp_path)


@pytest.mark.parametrize(
    ("stamps", "pattern", "right"),
    [
        ([20240101000000, 20240101000001, 20240101000100], "%Y%m%d%H%M%S", [0, 1, 60]),
        ([20240131, 20240201, 20240203], "%Y%m%d", [0, 86400, 259200]),
        ([202401312300, 202402010000, 202402010030], "%Y%m%d%H%M", [0, 3600, 5400]),
    ],
)
@pytest.mark.parametrize("file", ["log.csv", "log.parquet"])
def test_dates_in_digits_alone_are_told_and_read_as_advised(
    tmp_path: Path, file: str, stamps: list[int], pattern: str, right: list[float]
) -> None:
    parquet.write_table(pyarrow.table({"t": stamps, "glucose": [1.0, 2, 1]}), tmp_path / "log.parquet")
    (tmp_path / "log.csv").write_text("t,glucose\n" + "".join(f"{t},{k % 2}\n" for k, t in enumerate(stamps)))
    block = {"file": file, "time": "t", "outputs": {"S": "glucose"}}
    recording = read(Data.model_validate(block), tmp_path)
    assert recording.outputs["S"].taken.tolist() == stamps
    (told,) = [note.message for note in recording.notes if note.kind == "clock"]
    assert told.endswith(
        f'look like dates, and are taken as numbers: if they are dates, time: {{column: t, format: "{pattern}"}}'
    )
    dated = read(Data.model_validate({**block, "time": {"column": "t", "format": pattern}}), tmp_path)
    assert dated.outputs["S"].taken.tolist() == right
    assert not dated.notes


@pytest.mark.parametrize(
    "stamps",
    [
        ["20240101", "20240102"],
        ["20240130", "20240131", "20240132"],
        ["20240101.5", "20240102.5", "20240103.5"],
        ["1709078400", "1709078401", "1709078402"],
        ["0", "20240101", "20240102"],
        ["1e300", "2e300", "3e300"],
    ],
)
def test_counters_are_not_taken_for_dates(tmp_path: Path, stamps: list[str]) -> None:
    content = "t,glucose\n" + "".join(f"{stamp},{k % 2}\n" for k, stamp in enumerate(stamps))
    assert not recorded(tmp_path, content).notes
    counted = "t,glucose\n20240101,1\n20240102,2\n20240103,1\n"
    assert not recorded(tmp_path, counted, {"time": {"column": "t", "unit": "ms"}}).notes


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ("iso", "log.parquet:1: t: expected dates"),
        ("%H:%M", "log.parquet:1: t: expected a date of the form %H:%M, found '0.1'; leave out format where stamps"),
    ],
)
def test_numbers_in_place_of_dates_of_a_form(tmp_path: Path, form: str, said: str) -> None:
    parquet.write_table(pyarrow.table({"t": [0.1, None, 2.0], "glucose": [1.0, 2, 1]}), tmp_path / "log.parquet")
    block = {"file": "log.parquet", "time": {"column": "t", "format": form}, "outputs": {"S": "glucose"}}
    with pytest.raises(ConfigError) as caught:
        read(Data.model_validate(block), tmp_path)
    assert said in str(caught.value)
