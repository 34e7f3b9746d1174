"""Times as numbers, whose digits are hours and minutes: they are told with the pattern that reads them."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.data.recording import Recording
from hgorun.errors import ConfigError

START = datetime(2024, 1, 30, 11, 44)
K = np.arange(40)


def log(folder: Path, stamps: list[str], form: str | None = None) -> Recording:
    content = "t;glucose\n" + "".join(f"{stamp};{k % 7}\n" for k, stamp in enumerate(stamps))
    return recorded(folder, content, {"time": {"column": "t", "format": form}} if form else {})


def dates(form: str, seconds: float, cut: int | None = None) -> list[str]:
    return [f"{START + timedelta(seconds=k * seconds):{form}}"[:cut] for k in K.tolist()]


def told(found: Recording) -> list[str]:
    return [note.message for note in found.notes if note.kind == "clock" and "one day" not in note.message]


@pytest.mark.parametrize(
    ("stamps", "step", "form"),
    [
        (dates("%H%M", 900), 900, "%H%M"),
        (dates("%H%M", 60), 60, "%H%M"),
        ([str(int(one)) for one in dates("%M%S", 10)], 10, "%M%S"),
        (dates("%H%M%S", 10), 10, "%H%M%S"),
        (dates("%H%M%S.%f", 10, -4), 10, "%H%M%S"),
        (dates("%H%M%S.%f", 2.5, -4), 2.5, "%H%M%S.%f"),
        (dates("%H.%M", 900), 900, "%H.%M"),
        (dates("%M.%S", 20), 20, "%M.%S"),
        (dates("%Y%j", 86400), 86400, "%Y%j"),
        (dates("%y%j%H%M%S", 20), 20, "%y%j%H%M%S"),
        (dates("%y%j%H%M", 600), 600, "%y%j%H%M"),
        (dates("%Y%m%d%H%M%S%f", 0.375, -3), 0.375, "%Y%m%d%H%M%S%f"),
    ],
)
def test_times_in_digits_are_told_and_read_as_advised(
    tmp_path: Path, stamps: list[str], step: float, form: str
) -> None:
    (message,) = [one for one in told(log(tmp_path, stamps)) if "look like" in one]
    assert f'format: "{form}' in message
    if form == "%H%M%S" and "." in stamps[0]:
        form += ".%f"
    assert np.allclose(log(tmp_path, stamps, form).outputs["S"].taken, K * step, rtol=0, atol=1e-9)


def test_two_that_follow_each_other_show_it(tmp_path: Path) -> None:
    right = (
        'time: {column: t, format: "%H%M"} if they are hours and minutes, '
        'time: {column: t, format: "%M%S"} if they are minutes and seconds'
    )
    stamps = "numbers look like times, since 1159 is followed by 1214, and are taken as numbers"
    assert told(log(tmp_path, dates("%H%M", 900))) == [f"column 't': its {stamps}: {right}"]


@pytest.mark.parametrize(
    "stamps",
    [
        K + 1240,
        10 * K + 1250,
        50 * K + 1000,
        41 * K + 18,
        100 * K,
        K % 60 + 100.0,
        0.25 * K + 11,
        0.05 * K + 12,
        np.maximum(K - 0.5, 0),
        np.r_[0, 0.2, 0.5, 1.5 + np.arange(6)],
        np.cumsum(np.random.default_rng(0).integers(1, 20, 40)),
        1000 * K + 2_000_100,
        60 * K + 7200,
        np.arange(4) * 20 + 150,
        1_250 * K + 45_443_948_000,
        1_000_003 * K + 45_443_948_032,
    ],
    ids=str,
)
def test_numbers_that_count_are_not_told(tmp_path: Path, stamps: np.ndarray) -> None:
    increasing = np.maximum.accumulate(stamps + np.where(np.diff(stamps, prepend=0) < 0, 100, 0))
    assert not [
        one
        for one in told(log(tmp_path, [f"{one:.10g}" if one < 1e9 else f"{one:.0f}" for one in np.unique(increasing)]))
        if "look like" in one
    ]


@pytest.mark.parametrize("step", [1.0, 60.0, 900.0])
def test_millionths_of_days_are_told(tmp_path: Path, step: float) -> None:
    first = (START - datetime(1899, 12, 30)).total_seconds()
    stamps = [f"{(first + k * step) / 0.0864:.0f}" for k in K.tolist()]
    (message,) = [one for one in told(log(tmp_path, stamps)) if "look like" in one]
    assert "millionths of days from 1899-12-30 on, as WinCC counts, and would begin on 2024-01-30" in message
    read = log(tmp_path, [f"{int(one) / 1e6:.6f}" for one in stamps], "excel")
    assert np.allclose(read.outputs["S"].taken, K * step, rtol=0, atol=0.1)


@pytest.mark.parametrize(("stamp", "form"), [("13.5", "%H.%M"), ("9.05.7", "%H.%M.%S")])
def test_a_number_that_has_lost_its_last_zero_is_no_time(tmp_path: Path, stamp: str, form: str) -> None:
    with pytest.raises(
        ConfigError, match=r"behind a point %[MS] has two digits: a number has lost the zeros at its end"
    ):
        log(tmp_path, [stamp], form)
