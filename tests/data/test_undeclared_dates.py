"""Numbers without a format that are dates by their size are told with the key that reads them; large times are not."""

import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.config.data import Data
from hgorun.data.reading import read

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
