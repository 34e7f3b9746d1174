"""Numbers without a format that are dates by their size are told with the key that reads them; large times are not."""

import re
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import ConfigError

START = datetime(2024, 3, 1, 14, 0)


def told(folder: Path, stamps: list[str], unit: str, clock: object = "t") -> list[str]:
    content = "t,glucose\n" + "".join(f"{stamp},{k % 2}\n" for k, stamp in enumerate(stamps))
    notes = recorded(folder, content, {"time": clock}, time_unit=unit).notes
    return [note.message for note in notes if note.kind == "clock"]


def days(*minutes: float, digits: int = 6) -> list[str]:
    """Dates as Excel counts them: 2024-03-01 is day 45352."""
    return [f"{(START - datetime(1899, 12, 30)) / timedelta(days=1) + m / 1440:.{digits}f}" for m in minutes]


@pytest.mark.parametrize(
    ("stamps", "unit", "right"),
    [
        (["1709301600", "1709305200"], "h", "format: unix}"),
        (["1709301600.5", "1709301601.5"], "min", "format: unix}"),
        (["1709301600000", "1709301600500"], "s", "format: unix, unit: ms}"),
        (days(0, 60, 120, 180), "h", "format: excel}"),
        (days(0, 10, 20, 40, digits=5), "s", "format: excel}"),
        (days(*np.arange(9) / 6), "min", "format: excel}"),
    ],
)
def test_dates_in_numbers_are_told_and_read_as_advised(
    tmp_path: Path, stamps: list[str], unit: str, right: str
) -> None:
    (message,) = told(tmp_path, stamps, unit)
    assert message.startswith(f"column 't': its numbers are taken in {unit} and begin at ")
    assert message.endswith(f"the date 2024-03-01: if they are dates, time: {{column: t, {right}")
    keys = dict(part.split(": ") for part in right.strip("}").split(", "))
    block = {"file": "log.csv", "time": {"column": "t", **keys}, "outputs": {"S": "glucose"}}
    found = read(Data.model_validate(block), tmp_path, time_unit=unit)
    assert found.origin.epoch is not None
    assert abs(found.origin.epoch - np.datetime64(START)) < np.timedelta64(1, "s")
    assert not found.notes


@pytest.mark.parametrize(
    ("stamps", "unit"),
    [
        (["1709301600", "1709305200"], "s"),  # as they are, but for the dates
        (["1709301600", "1709301700"], "ms"),  # a device that runs for twenty days
        ([f"{45000 + k / 10:.1f}" for k in range(50)], "s"),  # seconds of a day
        ([f"{45000 + k / 30:.4f}" for k in range(50)], "s"),  # a camera
        ([f"{45000 + k * 0.037:.3f}" for k in range(50)], "s"),
        ([f"{45000 + k / 7:.6f}" for k in range(50)], "h"),
        ([f"{45000 + k}" for k in range(50)], "h"),  # hours that an engine has run
        (days(0, 60, 120, 180), "d"),
        ([f"{float(day) + 40_000:.6f}" for day in days(0, 60, 120, 180)], "h"),  # later than now
        (days(0, 60), "h"),
        (["1e300", "2e300", "3e300"], "h"),
    ],
)
def test_large_times_are_not_taken_for_dates(tmp_path: Path, stamps: list[str], unit: str) -> None:
    assert time.time() > START.timestamp()
    assert not told(tmp_path, stamps, unit)


def test_days_in_a_unit_that_is_stated_are_times(tmp_path: Path) -> None:
    assert not told(tmp_path, days(0, 60, 120, 180), "h", {"column": "t", "unit": "h"})


EVERY = [START + timedelta(minutes=7 * k) for k in range(8)]
TAKEN = [420.0 * k for k in range(8)]


@pytest.mark.parametrize("unit", ["s", "h"])
@pytest.mark.parametrize("pattern", ["%Y%m%d%H%M%S", "%Y%m%d%H%M%S.%f", "%y%m%d%H%M%S", "%y%m%d%H%M"])
def test_dates_written_as_digits_are_told_with_their_pattern(tmp_path: Path, pattern: str, unit: str) -> None:
    stamps = [(moment + timedelta(microseconds=500_000)).strftime(pattern) for moment in EVERY]
    said = [one for one in told(tmp_path, stamps, unit) if "rounded" not in one]
    assert said == [
        f"column 't': its numbers look like dates, and are taken as numbers: if they are dates, "
        f'time: {{column: t, format: "{pattern}"}}'
    ]
    found = recorded(tmp_path, (tmp_path / "log.csv").read_text(), {"time": {"column": "t", "format": pattern}})
    assert found.outputs["S"].taken.tolist() == TAKEN
    assert found.origin.epoch == np.datetime64(START) + np.timedelta64(500 if "%f" in pattern else 0, "ms")


@pytest.mark.parametrize(
    "stamps",
    [
        [f"{1709301600 + k}" for k in range(60)],  # 2017-09-30 16:00 by digits
        ["2403011400", "2403011360", "2403011500"],
        ["2403011400", "2403011400", "2403011500"],
        ["9903011400", "9903011401", "9903011402"],
        ["3003011400", "3003011401", "3003011402"],
        ["2403011400.5", "2403011401.5", "2403011402.5"],
        ["240301140000", "2403011401", "2403011402"],
    ],
)
def test_other_numbers_are_no_digits_of_dates(tmp_path: Path, stamps: list[str]) -> None:
    content = "t,glucose\n" + "".join(f"{stamp},{k % 2}\n" for k, stamp in enumerate(stamps))
    found = recorded(tmp_path, content, {"faults": {"backwards": "sort", "repeated": "mean", "gaps": "report"}})
    assert not any("dates" in note.message for note in found.notes if note.kind == "clock")


@pytest.mark.parametrize(
    ("start", "size", "sum_", "by"),
    [
        (datetime(1904, 1, 1), 1, "n - 2082844800", "in s from 1904-01-01, as LabVIEW counts"),
        (datetime(1601, 1, 1), 10**7, "n / 10000000 - 11644473600", "in 100 ns from 1601-01-01, as Windows counts"),
        (datetime(1, 1, 1), 10**7, "n / 10000000 - 62135596800", "in 100 ns from 0001-01-01, as .NET counts"),
    ],
)
def test_what_counts_from_another_day_is_told_with_how_it_is_made_unix_time(
    tmp_path: Path, start: datetime, size: int, sum_: str, by: str
) -> None:
    numbers = [(moment - start) // timedelta(seconds=1) * size for moment in EVERY]
    (message,) = told(tmp_path, [str(number) for number in numbers], "h")
    assert message.endswith(
        f", which would be the date 2024-03-01, {by}: if they are dates, write {sum_} in place of each number n into "
        "the file, with time: {column: t, format: unix}"
    )
    unix = [str(eval(sum_, {"n": number})) for number in numbers]
    assert not told(tmp_path, unix, "h", {"column": "t", "format": "unix"})
    assert [float(one) for one in unix] == [(moment - datetime(1970, 1, 1)).total_seconds() for moment in EVERY]


def test_dates_after_today_are_not_advised_and_told_where_they_are_declared(tmp_path: Path) -> None:
    now = int(time.time())
    clock = {"column": "t", "format": "unix"}
    later = [f"{now + 86_400 * (365 + k)}" for k in range(4)]
    assert not told(tmp_path, later, "h")
    (message,) = told(tmp_path, later, "h", clock)
    assert message.startswith("column 't': the last date is ")
    assert message.endswith(", after today")
    assert not told(tmp_path, [f"{now + 3600 * k}" for k in range(4)], "h", clock)
    labview = [f"{(moment - datetime(1904, 1, 1)).total_seconds():.0f}" for moment in EVERY]
    (message,) = told(tmp_path, labview, "h", clock)
    assert message == (
        "column 't': the last date is 2090-03-02, after today; in s from 1904-01-01, as LabVIEW counts, it would be "
        "2024-03-01: write n - 2082844800 in place of each number n into the file"
    )


OTHER_DAYS = [
    (datetime(1, 1, 1), 367, "n - 693960", "in days of MATLAB (datenum)"),
    (datetime(2000, 1, 1, 12), 2_451_545, "n - 2415018.5", "in Julian days"),
]


@pytest.mark.parametrize(("day", "number", "sum_", "by"), OTHER_DAYS)
def test_days_that_no_workbook_counts_are_told_with_how_they_are_made_days_of_one(
    tmp_path: Path, day: datetime, number: int, sum_: str, by: str
) -> None:
    """MATLAB counts the first day of year 1 as 367, and noon of 2000-01-01 is the Julian day 2451545."""
    numbers = [f"{(moment - day) / timedelta(days=1) + number:.6f}" for moment in EVERY]
    how = f"write {sum_} in place of each number n into the file"
    for unit in "sh":
        (message,) = told(tmp_path, numbers, unit)
        assert message.endswith(f"2024-03-01, {by}: if they are dates, {how}, with time: {{column: t, format: excel}}")
    assert not told(tmp_path, numbers, "d")
    workbook = {"column": "t", "format": "excel"}
    with pytest.raises(ConfigError, match=rf"{re.escape(by)} it would be 2024-03-01: {re.escape(how)}"):
        told(tmp_path, numbers, "h", workbook)
    as_advised = [f"{eval(sum_, {'n': float(number)}):.6f}" for number in numbers]
    assert as_advised == days(*(7 * k for k in range(8)))


def test_ticks_that_are_declared_as_unix_time_are_told(tmp_path: Path) -> None:
    ticks = [f"{(moment - datetime(1, 1, 1)) // timedelta(microseconds=1) * 10}" for moment in EVERY]
    right = "in 100 ns from 0001-01-01, as .NET counts, it would be 2024-03-01: write n / 10000000 - 62135596800 in"
    with pytest.raises(ConfigError, match=f"found 6.38449e\\+17; {right}"):
        told(tmp_path, ticks, "s", {"column": "t", "format": "unix"})
    (message,) = told(tmp_path, ticks, "s", {"column": "t", "format": "unix", "unit": "ns"})
    assert message.startswith(f"column 't': the last date is 1990-03-26; {right}")


@pytest.mark.parametrize("start", [739_312.5, 2_460_371.25])
def test_large_times_with_steps_of_their_own_are_no_days(tmp_path: Path, start: float) -> None:
    for step in (0.05, 1 / 7, 2.0):
        assert not told(tmp_path, [f"{start + step * k:.6f}" for k in range(8)], "s")
