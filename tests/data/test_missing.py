"""What stands for a missing value: words, numbers as a file writes them, in every kind of file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow
import pytest
import yaml
from logs import noisy, recorded, table
from pyarrow import parquet

from hgorun.config.data import MISSING, Csv, Data
from hgorun.data.reading import read
from hgorun.errors import ConfigError, Problem

PAGE = (Path(__file__).parents[2] / "docs" / "recordings.md").read_text(encoding="utf-8")
TIMES, VALUES = noisy(12)


@pytest.mark.parametrize(
    ("csv", "sentinel", "cells", "values"),
    [
        ({"thousands": ","}, "-9,999", ['"-9,999"', "-9999", '"-9,999.0"', "-9.999"], [-9.999]),
        ({"thousands": "."}, "-9.999,0", ["-9.999,0", "-9999", "-9.999", '"-9,999"'], [-9.999]),
        ({"thousands": "'"}, "-9'999", ["-9'999.00", "-9999.0", "9", "-9.999"], [9, -9.999]),
        ({"decimal": ","}, "-9.999", ["-9,999", "1", "2", "-9999"], [1, 2, -9999]),  # as YAML writes a number
        ({"decimal": ","}, -999.9, ["-999,9", "-999,90", "2", "-9999"], [2, -9999]),
        ({}, "-9,999", ['"-9,999"', "-9.999", "2", "3"], [-9.999, 2, 3]),  # a text: no number with decimal points
    ],
)
def test_a_sentinel_is_read_as_the_numbers_of_the_file(
    tmp_path: Path, csv: dict[str, Any], sentinel: str | float, cells: list[str], values: list[float]
) -> None:
    rows = [f"{k};{cell}" for k, cell in enumerate(cells)]
    told = {"csv": {"separator": ";", "missing": sentinel, **csv}}
    recording = recorded(tmp_path, "\n".join(["t;glucose", *rows]), told)
    assert recording.outputs["S"].values.tolist() == values


@pytest.mark.parametrize(
    ("separator", "row", "values"),
    [
        ("\t", "\t4\t#N/A\t3.5", [3.5]),
        ("\t", "\t4\t#12\t3.5", [3.5]),
        (",", "#N/A,4,1,3.5", [3.5]),
        (" ", "#N/A 4 1 3.5", [3.5]),
        (",", "  # 4,1,3.5", []),
        (",", "\t#12", []),
        ("\t", "# NA\t4\t1\t3.5", []),
    ],
)
def test_a_row_that_begins_with_no_value_is_no_comment(
    tmp_path: Path, separator: str, row: str, values: list[float]
) -> None:
    above = [["note", "t", "x", "glucose"], *(["a", str(k), "1", f"{k + 0.25}"] for k in range(4))]
    recording = recorded(tmp_path, "\n".join([*map(separator.join, above), row, ""]))
    assert recording.outputs["S"].values.tolist() == [0.25, 1.25, 2.25, 3.25, *values]


def written(path: Path, columns: dict[str, Any]) -> None:
    if path.suffix == ".parquet":
        parquet.write_table(pyarrow.table(columns), path)
        return
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name] = values


def found(path: Path, **changes: Any) -> Any:
    block = {"file": path.name, "time": "t", "outputs": {"S": "glucose"}} | changes
    return read(Data.model_validate(block), path.parent).outputs["S"]


@pytest.mark.parametrize("name", ["log.parquet", "log.h5"])
@pytest.mark.parametrize(
    ("values", "csv"),
    [
        (np.array([1.5, -9999.0, 2.5]), {"missing": ["-9999"]}),
        (np.array([1.5, -999.9, 2.5], dtype="f4"), {"missing": [-999.9]}),
        (["1.5", "-9999.0", "2.5"], {"missing": ["-9999"]}),
        (["1.5", "I/O Timeout", "2.5"], {"missing": ["i/o timeout"]}),
        (["1,5", "-9.999,0", "2,5"], {"missing": ["-9.999,0"], "thousands": ".", "decimal": ","}),
        (["1,5", "<NA>", "2,5"], {"decimal": ","}),
    ],
)
def test_the_keys_hold_in_files_of_arrays(tmp_path: Path, name: str, values: Any, csv: dict[str, Any]) -> None:
    written(tmp_path / name, {"t": [0.0, 1.0, 3.0], "glucose": values})
    signal = found(tmp_path / name, csv=csv)
    assert (signal.taken.tolist(), signal.values.tolist()) == ([0, 3], [1.5, 2.5])


@pytest.mark.measured("log.parquet")
@pytest.mark.costly
@pytest.mark.parametrize("name", ["log.parquet", "log.h5"])
def test_truth_is_no_number_but_tells_quality(tmp_path: Path, name: str) -> None:
    truth = np.array([True, False, True])
    written(tmp_path / name, {"t": [0.0, 1.0, 3.0], "glucose": [1.0, 2.0, 3.0], "on": truth})
    message = rf"{re.escape(name)}:1: on: expected a number, found '[Tt]rue'; write 1 for true and 0 for false"
    for changes in ({"outputs": {"S": "on"}}, {"time": "on"}):
        with pytest.raises(ConfigError, match=message):
            found(tmp_path / name, **changes)
    for good in (1, "true", "True"):
        column = {"column": "glucose", "quality": {"column": "on", "good": [good]}}
        assert found(tmp_path / name, outputs={"S": column}).values.tolist() == [1, 3]


WORDS = ["n.a.", "no data", "OFF", "Bad", "---", "I/O Timeout", "ERR", "#DIV/0!", "[-11059] No Good Data", "?", "inf"]


@pytest.mark.parametrize("word", [*WORDS, 'a "b"', "back\\slash", "Übersteuert"])
def test_what_the_message_says_to_write_makes_a_word_a_missing_value(tmp_path: Path, word: str) -> None:
    quoted = '"' + word.replace('"', '""') + '"'
    content = table(TIMES, VALUES) + f"{TIMES[-1] + 1},{quoted}\n"
    with pytest.raises(
        ConfigError, match=r"log\.csv:14: glucose: expected a number, found .*missing value: csv: "
    ) as error:
        recorded(tmp_path, content)
    told = yaml.safe_load(str(error.value).partition("missing value: ")[2].partition("; csv goes below data")[0])
    assert told == {"csv": {"missing": [word]}}
    assert recorded(tmp_path, content, told).outputs["S"].values.tolist() == VALUES.tolist()


@pytest.mark.parametrize(
    "cell", ["1.2.3", "5 %", "0x1f", "12 bar", "word " * 20, "1e", "−5.5", "(12.5)", "$12", "5 +", "½"]
)
def test_what_begins_as_a_number_or_is_long_is_not_called_missing(tmp_path: Path, cell: str) -> None:
    with pytest.raises(ConfigError, match="expected a number, found") as error:
        recorded(tmp_path, table(TIMES, VALUES) + f"99,{cell}\n")
    assert "missing" not in str(error.value)


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("<0.1", "a limit is no measured value"),
        ("> 100", "a limit is no measured value"),
        ("≥5,5", "a limit is no measured value"),
        ("<= 1", "a limit is no measured value"),
        ("12.3 *", "a mark such as * has a column of its own, for quality"),
        ("12.3!", "a mark such as ! has a column of its own, for quality"),
    ],
)
def test_a_limit_or_a_mark_beside_a_number_has_a_way_out(tmp_path: Path, cell: str, said: str) -> None:
    content = table(TIMES, VALUES) + f'99,"{cell}"\n'
    with pytest.raises(ConfigError, match="expected a number, found") as error:
        recorded(tmp_path, content)
    assert said in str(error.value)
    told = yaml.safe_load("csv: " + str(error.value).partition("csv: ")[2].partition(" leaves it out")[0])
    assert told == {"csv": {"missing": [cell]}}
    assert recorded(tmp_path, content, told).outputs["S"].values.tolist() == VALUES.tolist()


def test_the_words_of_the_page_are_those_of_the_program(tmp_path: Path) -> None:
    (row,) = re.findall(r"^\| `missing` \| texts and numbers.*$", PAGE, re.MULTILINE)
    words = re.findall(r"`([^`]+)`", row.partition("beside empty cells")[2].partition(";")[0])
    assert sorted(word.lower() for word in words) == sorted(word for word in MISSING if word)
    assert all(word in str(Csv.model_fields["missing"].description) for word in MISSING)
    rows = [f"{k},{word}" for k, word in enumerate(["1", *words, *map(str.upper, MISSING), "2"])]
    recording = recorded(tmp_path, "\n".join(["t,glucose", *rows]))
    assert recording.outputs["S"].values.tolist() == [1, 2]


def test_marks_of_the_byte_order_are_passed_over_or_shown(tmp_path: Path) -> None:
    mark = "\ufeff"
    assert recorded(tmp_path, mark * 3 + table(TIMES, VALUES)).outputs["S"].values.tolist() == VALUES.tolist()
    with pytest.raises(Problem, match=r"no column 't'\. .*It has: \\ufefft, glucose"):
        recorded(tmp_path, "# c\n" + mark + table(TIMES, VALUES))
    with pytest.raises(ConfigError, match=r"expected a number, found '.1'; . is a byte order mark"):
        recorded(tmp_path, table(TIMES, VALUES) + f"99,{mark}1\n")


def test_of_many_columns_it_is_said_where_the_others_stand(tmp_path: Path) -> None:
    names = [f"c{k}" for k in range(23)]
    with pytest.raises(Problem, match=r"no column 'zz'\. It has: t, c0, .*, c10 and 12 more in its header$"):
        recorded(tmp_path, ",".join(["t", *names]) + "\n1" + ",2" * 23 + "\n", {"outputs": {"S": "zz"}})
