"""Intervals of time in the column of time stamps, whose end is no time zone."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.errors import ConfigError

STEP = timedelta(minutes=15)
TWO = "an interval has two times: write the one that the value is of, its start or its end, into the file"


def log(stamps: list[str]) -> str:
    return "t;glucose\n" + "".join(f"{stamp};{k % 3}\n" for k, stamp in enumerate(stamps))


def intervals(form: str, between: str = "-", count: int = 20, step: timedelta = STEP, end: str = "%H:%M") -> list[str]:
    starts = [datetime(2024, 5, 31) + k * step for k in range(count)]
    return [f"{start:{form}}{between}{start + step:{end}}" for start in starts]


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M", "%Y-%m-%d %H:%M:%S", "%Y-%m-%dT%H:%M"])
@pytest.mark.parametrize("between", ["-", " -"])
@pytest.mark.parametrize("count", [2, 20, 49])
def test_the_end_of_an_interval_is_no_zone(tmp_path: Path, form: str, between: str, count: int) -> None:
    with pytest.raises(ConfigError, match=rf"log\.csv:2: t: .*is another one in most rows; {TWO}"):
        recorded(tmp_path, log(intervals(form, between, min(count, 48))))


def test_an_end_that_is_an_hour_is_none(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=TWO):
        recorded(tmp_path, log(intervals("%Y-%m-%d %H:%M", step=timedelta(hours=1), count=8, end="%H")))


def test_two_hours_are_no_hour_and_minutes(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=TWO) as found:
        recorded(tmp_path, log([f"2024-05-31T{k:02}-{k + 1:02}" for k in range(8)]))
    assert "%" not in str(found.value)


def test_an_end_in_the_afternoon_is_none(tmp_path: Path) -> None:
    said = rf"log\.csv:50: t: '-12:15' is not a time zone: those are -12:00 to \+14:00, in steps of 15 min; {TWO}"
    with pytest.raises(ConfigError, match=said):
        recorded(tmp_path, log(intervals("%Y-%m-%d %H:%M", count=60)))


@pytest.mark.parametrize("zone", ["-00:10", "+14:15", "+05:40", "-13:00", "+15"])
@pytest.mark.parametrize("form", [None, "%Y-%m-%d %H:%M%z"])
def test_no_clock_has_such_a_zone(tmp_path: Path, zone: str, form: str | None) -> None:
    clock = {"time": {"column": "t", "format": form}} if form else {}
    zone += ":00" if form and len(zone) == 3 else ""
    with pytest.raises(ConfigError, match="is not a time zone"):
        recorded(tmp_path, log([f"2024-05-31 10:00{zone}", f"2024-05-31 10:01{zone}"]), clock)


def test_a_pattern_with_a_zone_reads_no_interval(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=rf"log\.csv:2: t: '00:00-00:15': .*{TWO}"):
        recorded(tmp_path, log(intervals("%H:%M")), {"time": {"column": "t", "format": "%H:%M%z"}})


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M", "%d.%m.%Y %H:%M", "%H:%M", "%H:%M:%S"])
@pytest.mark.parametrize("between", [" - ", "-", "/", "..", "\u2013", " to ", " bis "])
def test_no_pattern_is_proposed_for_an_interval(tmp_path: Path, form: str, between: str) -> None:
    with pytest.raises(ConfigError, match=TWO) as found:
        recorded(tmp_path, log(intervals(form, between)))
    assert "%" not in str(found.value)


@pytest.mark.parametrize("end", ["2024-05-31T10:15:00Z", "PT15M"])
def test_intervals_of_iso_8601_are_named(tmp_path: Path, end: str) -> None:
    with pytest.raises(ConfigError, match=TWO):
        recorded(tmp_path, log([f"2024-05-31T10:00:00Z/{end}"]))


@pytest.mark.parametrize(
    ("stamps", "times"),
    [
        (["2024-05-31 00:15-05:00", "2024-05-31 00:30-05:00", "2024-05-31 00:45-05:00"], [0, 900, 1800]),
        (["2024-05-31 02:00-05:00", "2024-05-31 01:15-06:00", "2024-05-31 02:30-05:00"], [0, 900, 1800]),
        (["2024-11-03 01:30-04:00", "2024-11-03 01:10-05:00", "2024-11-03 01:30-05:00"], [0, 2400, 3600]),
        (["2024-05-31 05:45+05:45", "2024-05-31 05:00-03:30"], [0, 8.5 * 3600]),
    ],
)
def test_zones_are_read(tmp_path: Path, stamps: list[str], times: list[float]) -> None:
    assert np.array_equal(recorded(tmp_path, log(stamps)).outputs["S"].taken, times)


def test_a_zone_behind_minutes_is_proposed_as_one(tmp_path: Path) -> None:
    stamps = ["31.05.2024 00:15-05:00", "31.05.2024 00:30-05:00", "31.05.2024 00:45-05:00"]
    with pytest.raises(ConfigError, match=r'format: "%d\.%m\.%Y %H:%M%z"'):
        recorded(tmp_path, log(stamps))
