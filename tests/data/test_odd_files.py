"""Kinds of files that were once refused for a false reason, without their place, or read wrongly."""

from __future__ import annotations

import codecs
import datetime
import time
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow
import pytest
from logs import noisy, recorded, table
from pyarrow import parquet

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy(12)
TEXT = table(TIMES, VALUES)
MARK = codecs.BOM_UTF16_LE


@pytest.mark.parametrize("coding", ["utf-32", "utf-16"])
def test_wide_characters_with_a_mark_are_read(tmp_path: Path, coding: str) -> None:
    assert recorded(tmp_path, TEXT.encode(coding)).outputs["S"].values.tolist() == VALUES.tolist()
    assert recorded(tmp_path, (("\ufeff" * 2) + TEXT).encode(f"{coding}-be")).outputs["S"].lines[-1] == 13


@pytest.mark.parametrize(
    ("content", "csv", "message"),
    [
        (TEXT.encode("utf-16")[:-1], {}, r"log\.csv:13: not text in utf-16-le: 0a is no character of it"),
        (TEXT.encode("utf-16") + b"\x00\xd8\x31\x00", {}, r"log\.csv:14: not text in utf-16-le: 00 d8 is"),
        (TEXT.encode() + b"99,1\x81\n", {"encoding": "cp1252"}, r"log\.csv:14: not text in cp1252: 81 is no"),
        (MARK + "t,glucose\r1,2\r".encode("utf-16-le") + b"\x00\xdc", {}, r"log\.csv:3: not text in utf-16-le"),
    ],
)
def test_bytes_that_are_no_text_have_their_line(
    tmp_path: Path, content: bytes, csv: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        recorded(tmp_path, content, {"csv": csv})


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [("a.parquet", b"PAR1", "a Parquet table"), ("a.h5", b"\x89HD", "an HDF5 file"), ("a.nc", b"", "a netCDF file")],
)
def test_a_file_that_is_cut_off_is_told_by_its_name(tmp_path: Path, name: str, content: bytes, kind: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError, match=f"{name}: this is not {kind}, as its name says: was it cut off"):
        read(Data.model_validate({"time": "t", "outputs": {"S": "glucose"}}), tmp_path, files=[tmp_path / name])


def rows(before: str = "", behind: str = "", separator: str = ",") -> str:
    return "".join(
        f"{before}{t!r}{separator}{v!r}{behind}\n" for t, v in zip(TIMES.tolist(), VALUES.tolist(), strict=True)
    )


@pytest.mark.parametrize("name", ["c", "a_column_with_a_long_name"])
def test_a_wide_table_is_read(tmp_path: Path, name: str) -> None:
    """The names alone are longer than what was looked at, and than a block with the rows."""
    count = 30_000
    content = f"t,glucose,{','.join([name] * count)}\n" + rows(behind=",1" + ",12345" * (count - 1))
    assert recorded(tmp_path, content).outputs["S"].values.tolist() == VALUES.tolist()


def test_many_lines_above_the_header(tmp_path: Path) -> None:
    content = ("# " + "x" * 20_000 + "\n") * 60 + TEXT
    assert recorded(tmp_path, content).outputs["S"].lines.tolist() == list(range(62, 74))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("t,glucose," + "c" * (5 << 18) + "\n1,2,3\n", r"log\.csv:1: a line of more than 1 MiB"),
        (TEXT + '99,"1\n' + "1,2\n" * 40_000, r"log\.csv:14: a quote that is not closed"),
        (TEXT + '99,"1' + "x" * 140_000 + "\n", r"log\.csv:14: a quote that is not closed"),
        (TEXT + ";" * 140_000 + "\n", r"log\.csv:14: a cell of more than 131,072 characters: this is no table of num"),
        (TEXT + '"0",' + "(" * 140_000 + "\n", r"log\.csv:14: a cell of more than .* separated by ','$"),
        (TEXT + "2024-05-31T12:00:00+99:99,1\n", r"log\.csv:14: t: expected a number"),
        ("t,glucose,note\n0,1,\n1,2\n2,3,\n3,4,x\n", r"log\.csv:3: 2 cells, where the header has 3$"),
        (TEXT + "99\n", r"log\.csv:14: 1 cell, where the header has 2$"),
        (TEXT + "t, glucose\n" + TEXT, r"log\.csv:14: this line repeats the header: cut it out, with what belongs"),
        (TEXT + "t,glucose,\n", r"log\.csv:14: this line repeats the header: .*, cut the file in two$"),
        (
            TEXT.replace("glucose", "glucose,note"),
            r":2: 2 cells, .* 3; where no row has a cell of .*, 'note', out of the",
        ),
        (
            "t,glucose,note\n0,1,\n1,2\n",
            r":3: 2 cells, .*; a row without a value of the last column, 'note', ends with ','",
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        recorded(tmp_path, content)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (TEXT + "," * 1_000_000 + "\n", ":14: 1000001 cells, where the header has 2"),
        ("," + TEXT.replace("\n", "," * 250_000 + "\n", 1), "has no column 't ': "),
    ],
)
def test_very_many_cells_are_refused_in_a_moment(tmp_path: Path, content: str, message: str) -> None:
    started = time.process_time()
    with pytest.raises((ConfigError, Problem)) as caught:
        recorded(tmp_path, content, {"outputs": {"S": "t "}} if "column" in message else {})
    assert time.process_time() - started < 2
    assert message.rstrip(": ") in str(caught.value)


@pytest.mark.parametrize(
    ("content", "time", "column"),
    [
        ('"t" "glucose"\n0 1.5\n1 2.5\n3 2\n', "t", "glucose"),
        ('t "glucose in g"\n0 1.5\n1 2.5\n3 2\n', "t", "glucose in g"),
        ('"a, b"  "t" "said ""so""" note\n"x y" 0 1.5 ""\n"" "1" 2.5 "a""\n"x" 3  "2" b"c"\n', "t", 'said "so"'),
        (
            '"t" "glucose"\n"2024-01-01 00:00:00" 1.5\n"2024-01-01 00:00:01"\t2.5\n"2024-01-01 00:00:03" 2\n',
            "t",
            "glucose",
        ),
    ],
)
def test_quotes_between_spaces(tmp_path: Path, content: str, time: str, column: str) -> None:
    signal = recorded(tmp_path, content, {"time": time, "outputs": {"S": column}}).outputs["S"]
    assert signal.taken.tolist() == [0, 1, 3]
    assert signal.values.tolist() == [1.5, 2.5, 2]


@pytest.mark.parametrize("zone", ["+24:00", "-05:60", "+99:99"])
@pytest.mark.parametrize("quote", ["", '"'])  # rows with quotes are read one by one
def test_what_is_no_time_zone_is_refused(tmp_path: Path, zone: str, quote: str) -> None:
    stamps = [f"{quote}2024-05-31T12:00:0{k}{'+02:00' if k < 2 else zone}{quote}" for k in range(4)]
    content = "\n".join(["t,glucose", *(f"{stamp},{k}" for k, stamp in enumerate(stamps))])
    with pytest.raises(ConfigError, match=rf"log\.csv:4: t: '\{zone}' is not a time zone"):
        recorded(tmp_path, content)


@pytest.mark.parametrize(
    "date", ["31/05/2024 12:00", "31.5.24", "12:00:01", "20240531T120001", "2024-05-31 12:00:01 UTC"]
)
@pytest.mark.parametrize("form", [{}, {"format": "iso"}])
def test_dates_of_other_forms_are_told_the_key(tmp_path: Path, date: str, form: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv:2: t: .*a date of another form needs its pattern, such as time: "):
        recorded(tmp_path, f"t,glucose\n{date},1\n", {"time": {"column": "t", **form}})


def test_a_ruler_is_no_unit(tmp_path: Path) -> None:
    content = "| t | glucose |\n|---|---|\n" + rows("| ", " |", " | ")
    recording = recorded(tmp_path, content, units={"S": "g/L"})
    assert recording.outputs["S"].values.tolist() == VALUES.tolist()
    assert recording.notes == ()


def array_file(path: Path, columns: Any, column: str = "glucose") -> Any:
    if not isinstance(columns, pyarrow.Table):
        columns = pyarrow.table(columns)
    parquet.write_table(columns, path / "log.parquet")
    block = {"file": "log.parquet", "time": "t", "outputs": {"S": column}}
    return read(Data.model_validate(block), path).outputs["S"]


@pytest.mark.parametrize("kind", [pyarrow.decimal128(12, 2), pyarrow.decimal128(38, 9), pyarrow.decimal256(60, 30)])
def test_decimals_of_parquet_are_read_to_the_last_bit(
    tmp_path: Path, kind: pyarrow.DataType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hgorun.data.arrays.parquet._AT_ONCE", 100)
    texts = ["3.30", "0.07", *(f"{value:.2f}" for value in np.random.default_rng(0).uniform(1, 9, 998))]
    values = pyarrow.array([*map(Decimal, texts), None], kind)
    signal = array_file(tmp_path, {"t": [float(k) for k in range(1001)], "glucose": values})
    assert signal.values.tolist() == [float(text) for text in texts]


FAR = pyarrow.array([0, 10**15, 0], pyarrow.timestamp("ms"))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            {"t": [0.0, 1, 2], "glucose": [[1.0], [2.0], [3.0]]},
            r"glucose: a column of list<.*, found in place of numbers",
        ),
        (
            {"t": [0.0, 1, 2], "glucose": [{"v": 1}, {"v": 2}, {"v": 3}]},
            r"glucose: a column of struct<v: int64>, found",
        ),
        ({"t": [0.0, 1, 2], "glucose": [b"\xff", b"1", b"2"]}, r"glucose: a column of binary, found in place"),
        ({"t": FAR, "glucose": [1.0, 2, 3]}, r":2: t: expected a date between 1678 and 2262"),
        (
            pyarrow.table([[0.0, 1], [1.0, 2], [3.0, 4]], names=["t", "glucose", "glucose"]),
            "2 columns called 'glucose'",
        ),
    ],
)
def test_columns_of_parquet_that_are_no_numbers_are_not_called_damaged(
    tmp_path: Path, columns: Any, message: str
) -> None:
    with pytest.raises(ConfigError, match=rf"log\.parquet:? ?{message}") as error:
        array_file(tmp_path, columns)
    assert "damaged" not in str(error.value)


@pytest.mark.costly
def test_other_columns_of_parquet_may_be_anything(tmp_path: Path) -> None:
    zone = pyarrow.array([0, 7000, 9000], pyarrow.timestamp("ms", "Mars/Base"))
    signal = array_file(tmp_path, {"t": zone, "glucose": [1.0, 2, 3], "far": FAR, "list": [[1], [], [2]]})
    assert signal.taken.tolist() == [0, 7, 9]
    noon = datetime.datetime(2024, 5, 31, 12, tzinfo=datetime.UTC)
    signal = array_file(tmp_path, {"t": [noon, noon + datetime.timedelta(seconds=4)], "glucose": [1.0, 2]})
    assert signal.taken.tolist() == [0, 4]


def test_a_name_that_is_no_text_is_passed_over(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["glucose"] = TIMES, VALUES
        file.create_dataset(b"\xff\xfe", data=VALUES)
    block = {"file": "log.h5", "time": "t", "outputs": {"S": "glucose"}}
    assert read(Data.model_validate(block), tmp_path).outputs["S"].values.tolist() == VALUES.tolist()


@pytest.mark.costly
def test_labels_that_are_there_twice_name_no_column(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = TIMES
        file["x"] = np.stack([VALUES, -VALUES], axis=1)
        file["x"].attrs["labels"] = ["a", "a"]
    block = {"file": "log.h5", "time": "t", "outputs": {"S": "x/a"}}
    with pytest.raises(Problem, match=r"has no column 'x/a'\..* It has: t, x/0, x/1"):
        read(Data.model_validate(block), tmp_path)
    signal = read(Data.model_validate(block | {"outputs": {"S": "x/1"}}), tmp_path).outputs["S"]
    assert signal.values.tolist() == (-VALUES).tolist()


def test_what_hdf5_has_under_a_name_is_said_where_it_is_no_column(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = TIMES
        file["g/cube"] = np.zeros((2, 2, 2))
        file["one"] = 5.0
        file["nothing"] = h5py.Empty("f8")
        file["pairs"] = np.zeros(3, dtype=[("a", "f8"), ("b", "i4")])
        file["bits"] = np.zeros(3, dtype="V4")
        file["soft"] = h5py.SoftLink("/t")
        file["away"] = h5py.ExternalLink("/nowhere.h5", "/t")
        file["loop"] = h5py.SoftLink("/loop")
        file.create_dataset("elsewhere", (2,), "f8", external=[("nowhere.bin", 0, 16)])
        file["two"] = np.zeros((3, 2))
    said = {
        "g/cube": "g/cube is there, but has 3 dimensions, and a column has one",
        "one": "one is there, but is a single value",
        "nothing": "nothing is there, but is empty",
        "pairs": "pairs is there, but holds records, which are not taken apart: write each of a, b as a",
        "pairs/a": "pairs/a is there, but in records of pairs, which are not taken apart: write each of a, b as a",
        "bits": "bits is there, but holds neither numbers nor texts",
        "soft": "soft is there, but is a link, which is not followed",
        "away": "away is there, but is a link, which is not followed",
        "loop": "loop is there, but is a link, which is not followed",
        "elsewhere": "elsewhere is there, but has its values in other files",
        "two": "Did you mean `two/",
        "soft/x": "It has: ",
        "g": "It has: ",
        "no//such": "It has: ",
        "t/x": "It has: ",
    }
    for column, message in said.items():
        block = {"file": "log.h5", "time": "t", "outputs": {"S": column}}
        with pytest.raises(Problem) as error:
            read(Data.model_validate(block), tmp_path)
        assert message in str(error.value)
        assert ("is there" in message) == ("is there" in str(error.value))


def test_a_column_called_as_parquet_begins_is_one_of_a_text(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("PAR1,t,y\n7,0,1.5\n8,1,2.5\n")
    block = {"file": "log.csv", "time": "t", "outputs": {"S": "PAR1"}}
    np.testing.assert_array_equal(read(Data.model_validate(block), tmp_path).outputs["S"].values, [7.0, 8.0])


@pytest.mark.parametrize(("quote", "rows"), [("b", 3), ("", 3)])
def test_a_quote_too_many_is_told_where_it_opens(tmp_path: Path, quote: str, rows: int) -> None:
    content = f't,glucose,note\n0,1,a\n1,2,"{quote}\n2,3,c\n3,5,d\n4,6,e"\n5,8,f\n6,7,"g\n7,8,h"\n'
    found = recorded(tmp_path, content)
    assert found.outputs["S"].taken.tolist() == [0, 1, 5, 6]
    (note,) = found.notes
    assert (note.line, note.kind) == (3, "format")
    assert note.message.startswith(
        f"a quote that opens here closes on line 6: {rows} lines that look like rows in it, and 1"
    )


def test_a_remark_of_several_lines_is_no_fault(tmp_path: Path) -> None:
    content = 't,glucose,note\n0,1,"two\nlines, of text"\n1,2,"a, b\nc"\n2,4,\n'
    found = recorded(tmp_path, content)
    assert (found.outputs["S"].values.tolist(), found.notes) == ([1, 2, 4], ())
