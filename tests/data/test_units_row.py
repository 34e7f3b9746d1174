"""The row below the header: of units where it looks like one, else of data, of which nothing is lost without a word."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from logs import recorded

from hgorun.errors import ConfigError

DATES = ("16.01.2024 05:14:44", "16.01.2024 05:14:49", "16.01.2024 05:14:54")
PATTERN = {"time": {"column": "t", "format": "%d.%m.%Y %H:%M:%S"}}


def log(*values: str, stamps: tuple[str, ...] = DATES) -> str:
    """A table of stamps and values."""
    return "t;glucose\n" + "".join(f"{stamp};{value}\n" for stamp, value in zip(stamps, values, strict=True))


@pytest.mark.parametrize(
    ("values", "csv", "right"),
    [
        (("2'798.7", "1'146.2", "998.5"), {"thousands": "'"}, [2798.7, 1146.2, 998.5]),
        (("1.234,5", "1.235,5", "998,5"), {"thousands": ".", "decimal": ","}, [1234.5, 1235.5, 998.5]),
        (("12 345", "2", "3"), {"thousands": " "}, [12345, 2, 3]),
    ],
)
def test_the_first_row_has_signs_between_thousands(
    tmp_path: Path, values: tuple[str, ...], csv: dict[str, str], right: list[float]
) -> None:
    signal = recorded(tmp_path, log(*values), {**PATTERN, "csv": csv}).outputs["S"]
    assert signal.values.tolist() == right
    assert signal.taken.tolist() == [0, 5, 10]
    assert signal.lines.tolist() == [2, 3, 4]


def test_numeric_stamps_have_signs_between_thousands(tmp_path: Path) -> None:
    content = log("1'000,5", "0,5", "0,7", stamps=("1'000,5", "1'001,5", "1'002,5"))
    signal = recorded(tmp_path, content, {"csv": {"thousands": "'"}}).outputs["S"]
    assert signal.taken.tolist() == [1000.5, 1001.5, 1002.5]
    assert signal.values.tolist() == [1000.5, 0.5, 0.7]


@pytest.mark.parametrize("value", ["<0,1", "OFF", "inf", "\u22120,4", "3,5 bar", "1,234.5", "mg/L", "A"])
def test_a_first_value_that_is_no_number_is_refused_as_any_other(tmp_path: Path, value: str) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv:2: glucose: expected a number") as first:
        recorded(tmp_path, log(value, "0,5", "0,7"), PATTERN)
    with pytest.raises(ConfigError, match=r"log\.csv:3: glucose: expected a number") as later:
        recorded(tmp_path, log("0,5", value, "0,7"), PATTERN)
    assert first.value.message == later.value.message


@pytest.mark.parametrize("value", ["NaN", "", "#N/A"])
def test_a_first_value_that_is_missing_is_told_and_the_times_begin_there(tmp_path: Path, value: str) -> None:
    recording = recorded(tmp_path, log(value, "1,5", "2,5"), PATTERN)
    assert recording.outputs["S"].taken.tolist() == [5, 10]
    assert [(note.kind, note.line, note.count) for note in recording.notes] == [("missing", 2, 1)]


def test_a_row_whose_time_of_arrival_can_be_read_is_one_of_data(tmp_path: Path) -> None:
    known = {"outputs": {"S": {"column": "glucose", "available": "known"}}}
    content = "t;known;glucose\nx;05:14:44;OFF\n05:14:49;05:14:50;2\n"
    with pytest.raises(ConfigError, match=r"log\.csv:2: glucose: expected a number, found 'OFF'"):
        recorded(tmp_path, content, {"time": {"column": "t", "format": "%H:%M:%S"}, **known})


@pytest.mark.parametrize("stamp", ["s", "[s]", "", "-", "(UTC)", "UTC", "dd.mm.yyyy hh:mm:ss", "HH:MM"])
@pytest.mark.parametrize("unit", ["g/L", "[g/L]", "(g/l)"])
def test_a_row_of_units_is_one(tmp_path: Path, stamp: str, unit: str) -> None:
    content = f"t;glucose;state\n{stamp};{unit};RUN\n" + "".join(f"{date};1,5;x\n" for date in DATES)
    recording = recorded(tmp_path, content, PATTERN, units={"S": "g/L"})
    assert recording.outputs["S"].lines.tolist() == [3, 4, 5]
    assert recording.notes == ()


@pytest.mark.parametrize(("unit", "of_model"), [("1/min", "1/min"), ("", ""), ("(FNU)", "")])
def test_what_the_row_of_units_says_beside_other_stamps(tmp_path: Path, unit: str, of_model: str) -> None:
    content = f"t;glucose;flow\nTS;{unit};m3/h\n" + "".join(f"{date};1,5;2\n" for date in DATES)
    recording = recorded(tmp_path, content, PATTERN, units={"S": of_model})
    assert recording.outputs["S"].lines.tolist() == [3, 4, 5]


@pytest.mark.parametrize("told", [{}, {"units_row": True}])
def test_what_does_not_look_like_units_is_refused_unless_it_is_told(tmp_path: Path, told: dict[str, Any]) -> None:
    for value, wrong in (("OFF", "glucose: expected a number, found 'OFF'"), ("", "t: expected a date .*'start'")):
        content = f"t;glucose\nstart;{value}\n" + "".join(f"{date};1,5\n" for date in DATES)
        if told:
            assert recorded(tmp_path, content, {**PATTERN, "csv": told}).outputs["S"].lines.tolist() == [3, 4, 5]
            continue
        hint = (
            r"; if this line belongs to the header, as one of units does: csv: {units_row: true}; csv goes below data"
        )
        with pytest.raises(ConfigError, match=rf"log\.csv:2: {wrong}.*{hint}"):
            recorded(tmp_path, content, PATTERN)


@pytest.mark.parametrize("value", ["OFF", "1,5", "mg/L"])
def test_a_stamp_that_begins_with_a_word_is_read_in_its_format(tmp_path: Path, value: str) -> None:
    content = log(value, "1,5", "2", stamps=("Jan 16 2024", "Jan 17 2024", "Feb 1 2024"))
    block = {"time": {"column": "t", "format": "%b %d %Y"}}
    if value == "1,5":
        assert recorded(tmp_path, content, block).outputs["S"].taken.tolist() == [0, 86400, 16 * 86400]
        return
    with pytest.raises(ConfigError, match=r"log\.csv:2: glucose: expected a number") as caught:
        recorded(tmp_path, content, block)
    assert "header" not in caught.value.message
