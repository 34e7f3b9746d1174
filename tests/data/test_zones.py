"""Names of time zones in dates of a pattern: offsets wherever the program runs, or refused."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.errors import ConfigError

FORM = "%Y-%m-%d %H:%M:%S %Z"
TIME = {"time": {"column": "t", "format": FORM}}


@pytest.fixture(params=["UTC", "America/New_York"])
def machine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine of some zone, whose names Python reads by itself."""
    monkeypatch.setenv("TZ", request.param)
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def log(*stamps: str) -> str:
    return "t,glucose\n" + "".join(f"{stamp},{k % 3}\n" for k, stamp in enumerate(stamps))


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize(
    ("zone", "utc"),
    [("UTC", 10), ("GMT", 10), ("CET", 9), ("CEST", 8), ("MESZ", 8), ("EET", 8), ("EEST", 7), ("WEST", 9), ("utc", 10)],
)
def test_a_name_that_means_one_offset_is_read(tmp_path: Path, zone: str, utc: int) -> None:
    found = recorded(tmp_path, log(f"2024-03-01 10:00:00 {zone}", f"2024-03-01 10:01:00 {zone}"), TIME)
    assert found.origin.epoch == np.datetime64(f"2024-03-01T{utc:02d}:00")
    assert found.origin.zone == "UTC"
    assert found.outputs["S"].taken.tolist() == [0, 60]


def test_the_hour_that_comes_twice_in_autumn_is_told_apart(tmp_path: Path) -> None:
    stamps = ("2024-10-27 02:30:00 CEST", "2024-10-27 02:10:00 CET", "2024-10-27 02:30:00 CET")
    assert recorded(tmp_path, log(*stamps), TIME).outputs["S"].taken.tolist() == [0, 2400, 3600]


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("zone", ["EST", "CST", "IST", "Berlin", "GMT+1"])
def test_others_are_refused_with_what_is_right(tmp_path: Path, zone: str) -> None:
    said = (
        r"log\.csv:2: t: expected a date of the form .*%Z reads UTC, .*CET, .*write the offset, such as -05:00, and %z"
    )
    with pytest.raises(ConfigError, match=said):
        recorded(tmp_path, log(f"2024-03-01 10:00:00 {zone}"), TIME)


def test_a_name_beside_an_offset_adds_nothing(tmp_path: Path) -> None:
    clock = {"time": {"column": "t", "format": "%Y-%m-%d %H:%M %z (%Z)"}}
    found = recorded(tmp_path, log("2024-03-01 10:00 +0100 (CET)", "2024-03-01 10:01 +0100 (CET)"), clock)
    assert found.origin.epoch == np.datetime64("2024-03-01T09:00")


@pytest.mark.parametrize(
    ("stamp", "form", "utc"),
    [
        ("Fri Mar 01 2024 10:00:00 GMT+0100 (CET)", "%a %b %d %Y %H:%M:%S GMT%z (%Z)", 9),
        ("Fri Mar 01 2024 10:00:00 GMT+0100 (CET)", "%a %b %d %Y %H:%M:%S %Z%z (CET)", 9),
        ("CET log 2024-03-01 10:00 UTC", "CET log %Y-%m-%d %H:%M %Z", 10),
    ],
)
def test_a_name_in_the_pattern_itself_is_a_text(tmp_path: Path, stamp: str, form: str, utc: int) -> None:
    found = recorded(tmp_path, log(stamp), {"time": {"column": "t", "format": form}})
    assert found.origin.epoch == np.datetime64(f"2024-03-01T{utc:02d}:00")


@pytest.mark.parametrize("stamp", ["2024-03-01 10:00:00 UTC", "2024-03-01 10:00:00UTC", "13.03.2024 10:00 CET"])
def test_the_pattern_that_is_said_reads_the_name(tmp_path: Path, stamp: str) -> None:
    with pytest.raises(ConfigError, match="needs its pattern") as caught:
        recorded(tmp_path, log(stamp, stamp))
    form = str(caught.value).partition('format: "')[2].partition('"')[0]
    assert form.endswith("%Z")
    faults = {"repeated": "keep"}
    clock = {"time": {"column": "t", "format": form}, "faults": faults}
    assert recorded(tmp_path, log(stamp, stamp), clock).origin.zone == "UTC"


def test_a_part_that_is_said_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected a date of the form %c %d"):
        recorded(tmp_path, log("1 1"), {"time": {"column": "t", "format": "%c %d"}})


def test_a_row_of_units_may_name_the_zone_and_a_row_of_dates_is_none(tmp_path: Path) -> None:
    rows = log("2024-03-01 10:00:00 UTC", "2024-03-01 10:01:00 UTC")
    assert recorded(tmp_path, rows.replace("\n2024", "\nUTC,g/L\n2024", 1), TIME).outputs["S"].unit == "g/L"
    assert recorded(tmp_path, rows, TIME).outputs["S"].values.size == 2
