"""Dates of a pattern that strptime reads otherwise, or not at all."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from logs import recorded

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.times.zones import date_of
from hgorun.errors import ConfigError

START = datetime(1900, 1, 1)
DAY = datetime(2024, 5, 31)


@pytest.mark.parametrize(
    ("text", "pattern", "date"),
    [
        ("10009", "%H%M%S", START + timedelta(hours=1, seconds=9)),
        ("9", "%H%M%S", START + timedelta(seconds=9)),
        ("103000", "%H%M%S", START + timedelta(hours=10, minutes=30)),
        ("100", "%H%M", START + timedelta(hours=1)),
        ("1032024", "%d%m%Y", datetime(2024, 3, 1)),
        ("1132024", "%m%d%Y", datetime(2024, 1, 13)),
        ("20240131 10305", "%Y%m%d %H%M%S", datetime(2024, 1, 31, 1, 3, 5)),
        ("31.05.2024 100", "%d.%m.%Y %H%M", DAY + timedelta(hours=1)),
        ("10009.25", "%H%M%S.%f", START + timedelta(hours=1, seconds=9.25)),
        ("134500123", "%H%M%S%f", START + timedelta(hours=13, minutes=45, milliseconds=123)),
        ("20240531134459250", "%Y%m%d%H%M%S%f", DAY + timedelta(hours=13, minutes=44, seconds=59.25)),
    ],
)
def test_digits_side_by_side_have_lost_zeros_in_front_alone(text: str, pattern: str, date: datetime) -> None:
    assert date_of(text, pattern) == date


@pytest.mark.parametrize(
    ("text", "pattern", "run"),
    [
        ("20240131800", "%Y%m%d%H%M", "%Y%m%d%H%M"),
        ("21031100", "%y%j%H%M", "%y%j%H%M"),
        ("20240531.1344", "%Y%m%d.%H%M%S", "%H%M%S"),
        ("90000123", "%H%M%S%f", "%H%M%S%f"),
        ("1345", "%Y%m%d%H%M%S%f", "%Y%m%d%H%M%S%f"),
    ],
)
def test_digits_that_may_be_others_are_refused(tmp_path: Path, text: str, pattern: str, run: str) -> None:
    said = f"found '{text}'; digits side by side, {run}, need all of theirs, with zeros in front"
    with pytest.raises(ConfigError, match=said):
        recorded(tmp_path, f"t,glucose\n{text},1\n", {"time": {"column": "t", "format": pattern}})


@pytest.mark.parametrize(("text", "pattern"), [("246000", "%H%M%S"), ("256010500", "%H%M%S%f"), ("x10", "%H%M")])
def test_parts_are_those_of_a_clock(text: str, pattern: str) -> None:
    with pytest.raises(ValueError, match=r"^$"):
        date_of(text, pattern)


def test_whole_numbers_of_a_table_have_lost_theirs(tmp_path: Path) -> None:
    stamps = [int(f"{START + timedelta(hours=1, seconds=k):%H%M%S}") for k in range(0, 600, 10)]
    values = np.sin(np.arange(len(stamps)))
    pyarrow.parquet.write_table(pyarrow.table({"t": stamps, "glucose": values}), tmp_path / "log.parquet")
    block = {"file": "log.parquet", "time": {"column": "t", "format": "%H%M%S"}, "outputs": {"S": "glucose"}}
    taken = read(Data.model_validate(block), tmp_path).outputs["S"].taken
    assert taken.tolist() == list(range(0, 600, 10))


@pytest.mark.parametrize(
    ("text", "pattern", "date"),
    [
        ("31.05.2024 24:00", "%d.%m.%Y %H:%M", DAY + timedelta(days=1)),
        ("31.05.2024 24:00:00", "%d.%m.%Y %H:%M:%S.%f", DAY + timedelta(days=1)),
        ("31.05.2024", "%d.%m.%Y %H:%M:%S", DAY),
        ("5/31/2024", "%m/%d/%Y %I:%M:%S %p", DAY),
        ("31.05.2024 13:45:10", "%d.%m.%Y %H:%M:%S.%f", DAY + timedelta(hours=13, minutes=45, seconds=10)),
        ("5/31/2024 0:30 PM", "%m/%d/%Y %I:%M %p", DAY + timedelta(hours=12, minutes=30)),
        ("5/31/2024 0:30 AM", "%m/%d/%Y %I:%M %p", DAY + timedelta(minutes=30)),
        ("24:27:06.4", "%H:%M:%S.%f", START + timedelta(hours=24, minutes=27, seconds=6.4)),
        ("120:10:05", "%H:%M:%S", START + timedelta(hours=120, minutes=10, seconds=5)),
        ("75:10", "%M:%S", START + timedelta(minutes=75, seconds=10)),
        ("3. 5.2024  1:00", "%d.%m.%Y %H:%M", datetime(2024, 5, 3, 1)),
        (" 1: 3: 5", "%H:%M:%S", START + timedelta(hours=1, minutes=3, seconds=5)),
    ],
)
def test_what_iso_8601_has_is_read_in_patterns(text: str, pattern: str, date: datetime) -> None:
    assert date_of(text, pattern) == date


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("31.05.2024 24:01", "%d.%m.%Y %H:%M"),
        ("31.05.2024 25:00", "%d.%m.%Y %H:%M"),
        ("1:75:00", "%H:%M:%S"),
        ("99999999999:00", "%H:%M"),
        ("31.05.", "%d.%m. %H:%M"),
        ("31.05.2024", "%d.%m.%Y %H:%M %z"),
        ("13:45", "%H:%M:%S %Y-%m-%d"),
    ],
)
def test_what_is_on_no_clock_is_not(text: str, pattern: str) -> None:
    with pytest.raises(ValueError, match=r"^$"):
        date_of(text, pattern)


def test_times_beyond_a_day_are_in_order(tmp_path: Path) -> None:
    stamps = [f"{k // 3}:{20 * (k % 3):02d}:00" for k in range(90)]
    content = "t,glucose\n" + "".join(f"{stamp},{k % 7}\n" for k, stamp in enumerate(stamps))
    found = recorded(tmp_path, content, {"time": {"column": "t", "format": "%H:%M:%S"}})
    assert found.outputs["S"].taken.tolist() == [1200.0 * k for k in range(90)]
    assert [note.message for note in found.notes if "one day" in note.message] == []


def test_months_of_years_are_dates(tmp_path: Path) -> None:
    content = "t,glucose\n" + "".join(f"{datetime(2020 + k // 12, k % 12 + 1, 1):%b %Y},{k % 7}\n" for k in range(30))
    found = recorded(tmp_path, content, {"time": {"column": "t", "format": "%b %Y"}})
    assert [note.message for note in found.notes if "one day" in note.message] == []


def test_hours_beyond_a_day_may_be_minutes(tmp_path: Path) -> None:
    content = "t,glucose\n" + "".join(f"{k // 3}:{20 * (k % 3):02d},{k % 7}\n" for k in range(90))
    found = recorded(tmp_path, content, {"time": {"column": "t", "format": "%H:%M"}})
    told = "the pattern %H:%M reads hours beyond 24: for minutes and seconds the format is %M:%S"
    assert [note.message for note in found.notes if note.kind == "clock"] == [f"column 't': {told}"]
    seconds = recorded(tmp_path, content, {"time": {"column": "t", "format": "%M:%S"}})
    assert seconds.outputs["S"].taken.tolist() == [20.0 * k for k in range(90)]
