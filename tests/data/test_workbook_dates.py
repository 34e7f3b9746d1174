"""Days as workbooks count them, from both of their days 0, against the calendar of Python."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import noisy, recorded

from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy(30)
START = datetime(2024, 2, 28, 23, 59, 50)
DATES = [START + timedelta(seconds=t) for t in TIMES.tolist()]
FAR = [date + timedelta(days=64_000) for date in DATES]
DAY_0 = {"excel": datetime(1899, 12, 30), "excel1904": datetime(1904, 1, 1)}
LABORATORY = {"file": "lab.csv", "column": "e", "time": {"column": "d", "format": "excel"}}


def days(dates: list[datetime], form: str) -> list[str]:
    return [repr((date - DAY_0[form]) / timedelta(days=1)) for date in dates]


def log(stamps: list[str]) -> str:
    return "t;glucose\n" + "".join(f"{stamp};{v}\n" for stamp, v in zip(stamps, VALUES, strict=True))


def of(form: str, **more: str) -> dict[str, Any]:
    return {"time": {"column": "t", "format": form, **more}}


@pytest.mark.parametrize("form", list(DAY_0))
def test_each_counts_from_its_own_day(tmp_path: Path, form: str) -> None:
    recording = recorded(tmp_path, log(days(DATES, form)), of(form))
    assert recording.origin.epoch is not None
    assert abs(recording.origin.epoch - np.datetime64(DATES[0], "ns")) < np.timedelta64(2, "us")
    np.testing.assert_allclose(recording.outputs["S"].taken, TIMES - TIMES[0], atol=2e-6)
    assert recording.notes == ()


def test_days_that_sheets_show() -> None:
    """Microsoft's own example: 5 July 1998 is 35981 in one system and 34519 in the other."""
    date = datetime(1998, 7, 5)
    assert [float(*days([date], form)) for form in DAY_0] == [35981, 34519]


def test_an_origin_counts_from_the_same_day(tmp_path: Path) -> None:
    changes = of("excel1904") | {"origin": float(*days([datetime(2024, 2, 28)], "excel1904"))}
    recording = recorded(tmp_path, log(days(DATES, "excel1904")), changes)
    np.testing.assert_allclose(recording.outputs["S"].taken - (86400 - 10), TIMES, atol=2e-6)


@pytest.mark.parametrize("true", list(DAY_0))
def test_a_wrong_day_0_beside_another_clock_is_refused(tmp_path: Path, true: str) -> None:
    """A laboratory's sheet counts from the other day than the configuration says: four years and a day apart."""
    told = next(form for form in DAY_0 if form != true)
    samples = [START + timedelta(seconds=5), START + timedelta(seconds=15)]
    content = log([date.isoformat() for date in DATES])
    rows = zip(days(samples, true), [2, 3], strict=True)
    (tmp_path / "lab.csv").write_text("d,e\n" + "".join(f"{d},{e}\n" for d, e in rows))
    column = {"file": "lab.csv", "column": "e", "time": {"column": "d", "format": told}}
    changes: dict[str, Any] = {"outputs": {"S": "glucose", "E": column}}
    with pytest.raises(ConfigError, match=rf"lab\.csv:2: d: .* with format: {true} they would begin on 2024-02-2[89]"):
        recorded(tmp_path, content, changes)
    column["time"] = {"column": "d", "format": true}
    found = recorded(tmp_path, content, changes).outputs["E"].taken
    np.testing.assert_allclose(found, [5 - TIMES[0], 15 - TIMES[0]], atol=2e-6)


def test_samples_of_another_year_are_not_moved(tmp_path: Path) -> None:
    """The laboratory comes long after the log: no day 0 brings them together, and nothing is claimed."""
    later = [date + timedelta(days=400) for date in DATES[:2]]
    rows = zip(days(later, "excel"), [2, 3], strict=True)
    (tmp_path / "lab.csv").write_text("d,e\n" + "".join(f"{d},{e}\n" for d, e in rows))
    content = log([date.isoformat() for date in DATES])
    assert recorded(tmp_path, content, {"outputs": {"S": "glucose", "E": LABORATORY}}).outputs["E"].taken[0] > 3e7


@pytest.mark.parametrize(
    ("stamp", "changes", "message"),
    [
        ("-3", of("excel"), r":4: t: expected a day of a workbook, 0 or more, before 2262, found -3"),
        ("1709164800", of("excel"), r":4: t: expected a day of .*; with format: unix, unit: s it would be 2024-02-29"),
        ("1709164800000", of("unix"), r":4: t: expected a date .*; with unit: ms it would be 2024-02-29"),
        ("28486080", of("unix", unit="d"), r":4: t: expected a date .*; with unit: min it would be 2024-02-29"),
        ("1e300", of("excel1904"), r":4: t: expected a day of a workbook, 0 or more, before 2262, found 1e\+300$"),
    ],
)
def test_numbers_that_are_no_dates(tmp_path: Path, stamp: str, changes: dict[str, Any], message: str) -> None:
    stamps = days(DATES, "excel")
    stamps[2] = stamp
    with pytest.raises(ConfigError, match=message):
        recorded(tmp_path, log(stamps), changes)


def unix(unit: float) -> list[str]:
    return [repr(date.replace(tzinfo=UTC).timestamp() / unit) for date in DATES]


@pytest.mark.parametrize(
    ("stamps", "changes", "told"),
    [
        (days(FAR, "excel"), of("excel"), "after today"),
        (
            days(FAR, "excel"),
            of("excel1904"),
            f"{(FAR[-1] + timedelta(days=1462)).date()}, after today; with format: excel it would be {FAR[-1].date()}",
        ),
        ([repr(0.5 + t / 86400) for t in TIMES.tolist()], of("excel"), "the first date is 1899-12-30"),
        (unix(1), of("unix", unit="ms"), "the first date is 1970-01-20; with unit: s it would be 2024-02-28"),
        (unix(60), of("unix"), "the first date is 1970-11-26; with unit: min it would be 2024-02-28"),
        (unix(3600), of("unix"), "the first date is 1970-01-06; with unit: h it would be 2024-02-28"),
        (unix(86400), of("unix"), "the first date is 1970-01-01; with unit: d it would be 2024-02-28"),
        (days(DATES, "excel"), of("unix"), "the first date is 1970-01-01; with format: excel it would be 2024-02-28"),
    ],
)
def test_dates_that_cannot_be_meant_are_told(
    tmp_path: Path, stamps: list[str], changes: dict[str, Any], told: str
) -> None:
    changes["faults"] = {"repeated": "keep"}
    note = recorded(tmp_path, log(stamps), changes).notes[0]
    assert note.kind == "clock"
    assert told in str(note)


@pytest.mark.parametrize(
    ("stamps", "changes"), [(unix(1), of("unix")), (unix(0.001), of("unix", unit="ms")), (["5", "6"] * 15, of("unix"))]
)
def test_dates_that_can_be_meant_are_not(tmp_path: Path, stamps: list[str], changes: dict[str, Any]) -> None:
    """Among them those of a device whose clock begins with it, in 1970."""
    changes["faults"] = {"repeated": "keep", "backwards": "sort"}
    assert not [note for note in recorded(tmp_path, log(stamps), changes).notes if note.kind == "clock"]


def test_a_format_that_is_not_known_names_both(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="iso, unix, excel, excel1904 or a pattern"):
        recorded(tmp_path, log(days(DATES, "excel")), of("excel2000"))


def test_numbers_beside_days_need_an_origin(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_text("d,e\n1,2\n2,3\n")
    laboratory = {"file": "lab.csv", "column": "e", "time": "d"}
    with pytest.raises(Problem, match="numbers here and dates elsewhere"):
        recorded(
            tmp_path, log(days(DATES, "excel1904")), of("excel1904") | {"outputs": {"S": "glucose", "E": laboratory}}
        )
