"""Stamps of every form as times, against the calendar of Python."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import noisy, recorded

from hgorun.config.data import Clock
from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy(30)
START = datetime(2024, 2, 28, 23, 59, 50)
DATES = [START + timedelta(seconds=t) for t in TIMES.tolist()]


def log(stamps: list[str]) -> str:
    return "t;glucose\n" + "".join(f"{stamp};{v}\n" for stamp, v in zip(stamps, VALUES[: len(stamps)], strict=True))


FORMS: list[tuple[Any, list[str]]] = [
    (None, [date.isoformat() for date in DATES]),
    ("iso", [date.isoformat(" ") for date in DATES]),
    ("iso", [date.isoformat(timespec="milliseconds").replace(".", ",") for date in DATES]),
    ("iso", [date.replace(tzinfo=UTC).isoformat() for date in DATES]),
    ("iso", [date.isoformat(timespec="milliseconds") + "Z" for date in DATES]),
    ("iso", [(date + timedelta(hours=2)).replace(tzinfo=timezone(timedelta(hours=2))).isoformat() for date in DATES]),
    ("unix", [repr(date.replace(tzinfo=UTC).timestamp()) for date in DATES]),
    ("unix", [str(round(date.replace(tzinfo=UTC).timestamp() * 1000)) for date in DATES]),
    ("excel", [repr((date - datetime(1899, 12, 30)) / timedelta(days=1)) for date in DATES]),
    ("%d.%m.%Y %H:%M:%S.%f", [date.strftime("%d.%m.%Y %H:%M:%S.%f") for date in DATES]),
    ("%d/%m/%y %H:%M:%S.%f%z", [date.strftime("%d/%m/%y %H:%M:%S.%f+0000") for date in DATES]),
]


@pytest.mark.parametrize(("form", "stamps"), FORMS)
@pytest.mark.parametrize(("unit", "seconds"), [("s", 1), ("min", 60), ("h", 3600)])
def test_dates_count_from_the_first_one(
    tmp_path: Path, form: Any, stamps: list[str], unit: str, seconds: float
) -> None:
    clock: dict[str, Any] = {"column": "t"} | ({"format": form} if form else {})
    if "." not in stamps[0] and form == "unix":
        clock["unit"] = "ms"
    recording = recorded(tmp_path, log(stamps), {"time": clock}, time_unit=unit)
    # a day of Excel and a second since 1970 have digits down to a microsecond
    np.testing.assert_allclose(recording.outputs["S"].taken * seconds, TIMES - TIMES[0], atol=2e-6)
    assert recording.origin.epoch is not None
    assert abs(recording.origin.epoch - np.datetime64(DATES[0], "ns")) < np.timedelta64(2, "us")
    zoned = form == "unix" or stamps[0].endswith(("Z", "00:00", "02:00", "0000"))
    assert recording.origin.zone == ("UTC" if zoned else "")


@pytest.mark.parametrize(("form", "stamps"), [FORMS[0], FORMS[6], FORMS[8]])
def test_or_from_the_origin_that_is_stated(tmp_path: Path, form: Any, stamps: list[str]) -> None:
    clock: dict[str, Any] = {"column": "t"} | ({"format": form} if form else {})
    said: Any = {None: "2024-02-28", "unix": 1709078400, "excel": 45350}[form]
    recording = recorded(tmp_path, log(stamps), {"time": clock, "origin": said})
    np.testing.assert_allclose(recording.outputs["S"].taken - (86400 - 10), TIMES, atol=2e-6)
    assert recording.origin.epoch == np.datetime64("2024-02-28", "ns")


def test_numbers_stay_on_their_own_clock(tmp_path: Path) -> None:
    recording = recorded(tmp_path, log([repr(t) for t in TIMES.tolist()]), {"time": {"column": "t", "unit": "min"}})
    np.testing.assert_array_equal(recording.outputs["S"].taken, TIMES * 60)
    assert recording.origin.epoch is None


@pytest.mark.parametrize(
    ("stamp", "form", "message"),
    [
        ("2024-02-30T00:00", "iso", r":4: t: .*2024-02-30.*day"),
        ("30.02.2024", "iso", r":4: t: expected a date such as"),
        ("12.5", "%H:%M", r":2: t: expected a date of the form %H:%M"),
        ("2024-03-01T00:00Z", "iso", r":4: t: dates with and without a time zone"),
        ("1e300", "unix", r":4: t: expected a date between 1678 and 2262"),
        ("9999-01-01", "iso", r":4: t: expected a date between 1678 and 2262"),
        ("", "iso", r":4: outputs.S: a value without time stamp"),
    ],
)
def test_stamps_that_are_none(tmp_path: Path, stamp: str, form: str, message: str) -> None:
    stamps = [repr(t) for t in TIMES.tolist()] if form == "unix" else [date.isoformat() for date in DATES]
    stamps[2] = stamp
    with pytest.raises(ConfigError, match=message):
        recorded(tmp_path, log(stamps), {"time": {"column": "t", "format": form}})


@pytest.mark.parametrize(
    ("origin", "message"), [("yesterday", "expected a date such as"), (5, "expected a date such as")]
)
def test_origins_that_are_none(tmp_path: Path, origin: Any, message: str) -> None:
    with pytest.raises(Problem, match=message):
        recorded(tmp_path, log([date.isoformat() for date in DATES]), {"origin": origin})


@pytest.mark.parametrize(
    ("form", "ends", "origin", "message"),
    [
        (None, "Z", "2024-02-28", "stamps have a time zone, and the origin has none: 2024-02-28T00:00Z is one in UTC"),
        (None, "+02:00", "2024-02-28 12:30", "and the origin has none: 2024-02-28 12:30Z is one in UTC"),
        (None, "", "2024-02-28T00:00+02:00", "origin has a time zone, and the stamps have none: write it without"),
        ("unix", "", "2024-02-28", "stamps have a time zone, and the origin has none"),
        ("excel", "", "2024-02-28T00:00Z", "origin has a time zone, and the stamps have none"),
    ],
)
def test_an_origin_has_a_time_zone_where_the_stamps_have_one(
    tmp_path: Path, form: Any, ends: str, origin: str, message: str
) -> None:
    of_form = {"unix": ["1709164790", "1709164791"], "excel": ["45350.5", "45350.75"]}
    stamps = of_form[form] if form else [date.isoformat() + ends for date in DATES]
    clock = {"column": "t"} | ({"format": form} if form else {})
    with pytest.raises(Problem, match=re.escape(message)) as caught:
        recorded(tmp_path, log(stamps), {"time": clock, "origin": origin})
    assert caught.value.path == ("data", "origin")


@pytest.mark.parametrize(
    ("dates", "block", "message"),
    [
        (["1700-01-01", "2024-03-01"], {}, ":3: t: 2024-03-01 is more than 292 years away from 1700-01-01 in this"),
        (["2024-03-01", "1700-01-01"], {}, ":3: t: 1700-01-01 is more than 292 years away from 2024-03-01 in this"),
        (["1970-01-01", "1680-01-01", "2260-01-01"], {}, ":4: t: 2260-01-01 is more than 292 years away from 1680"),
        (["2024-03-01", "2024-03-02"], {"origin": "1700-01-01"}, ":2: t: 2024-03-01 .* from the origin, 1700-01-01"),
    ],
)
def test_dates_that_are_too_far_apart(tmp_path: Path, dates: list[str], block: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        recorded(tmp_path, log(dates), block)


@pytest.mark.parametrize(
    ("unit", "clock", "times"),
    [
        ("month", None, [1.0, 2.0, 4.0]),
        ("year", "year", [1.0, 2.0, 4.0]),
        ("-", None, [1.0, 2.0, 4.0]),
        ("steps", None, [1.0, 2.0, 4.0]),
        ("week", "d", [1 / 7, 2 / 7, 4 / 7]),
        ("d", "weeks", [7.0, 14.0, 28.0]),
    ],
)
def test_numbers_are_in_any_unit_of_a_run(tmp_path: Path, unit: str, clock: str | None, times: list[float]) -> None:
    block = {"time": {"column": "t"} | ({"unit": clock} if clock else {})}
    found = recorded(tmp_path, log(["1", "2", "4"]), block, time_unit=unit)
    np.testing.assert_allclose(found.outputs["S"].taken, times, rtol=1e-15)
    assert not found.notes


def test_dates_in_weeks_and_what_has_no_fixed_length(tmp_path: Path) -> None:
    dates = log(["2024-01-01", "2024-01-15"])
    assert recorded(tmp_path, dates, time_unit="week").outputs["S"].taken.tolist() == [0.0, 2.0]
    for unit in ("month", "years", "sample", "-"):
        with pytest.raises(Problem, match="has no fixed length: dates and other times") as caught:
            recorded(tmp_path, dates, time_unit=unit)
        assert caught.value.path == ("time", "unit")


def test_clocks_that_cannot_be_compared(tmp_path: Path) -> None:
    tmp_path.joinpath("lab.csv").write_text("t,e\n1,2\n2,3\n")
    other = {"outputs": {"S": "glucose", "E": {"file": "lab.csv", "column": "e"}}}
    with pytest.raises(Problem, match="numbers here and dates elsewhere"):
        recorded(tmp_path, log([date.isoformat() for date in DATES]), other)
    tmp_path.joinpath("lab.csv").write_text("t,e\n2024-03-01T00:00Z,2\n2024-03-01T01:00Z,3\n")
    with pytest.raises(Problem, match=r"lab.csv, line 2, has one, t in .*log.csv, line 2, has none"):
        recorded(tmp_path, log([date.isoformat() for date in DATES]), other)


def test_numbers_beside_dates_count_from_the_stated_origin(tmp_path: Path) -> None:
    """A device counts its own seconds; another one writes dates."""
    tmp_path.joinpath("pump.csv").write_text("s,q\n0,2\n90,3\n")
    pump = {"file": "pump.csv", "column": "q", "time": {"column": "s", "unit": "s"}}
    block = {"origin": "2024-01-01T00:00", "inputs": {"F": pump}}
    content = log([f"2024-01-01T00:{k + 1:02d}:00" for k in range(len(DATES))])
    found = recorded(tmp_path, content, block)
    per = {"s": 1.0, "min": 60.0, "h": 3600.0}[found.origin.unit]
    assert found.inputs["F"].times.tolist() == [0.0, 90 / per]
    assert found.outputs["S"].taken[:2].tolist() == [60 / per, 120 / per]


def test_a_unit_of_the_file_for_its_time_is_told(tmp_path: Path) -> None:
    content = log([repr(t) for t in TIMES.tolist()]).replace("glucose\n", "glucose\nh;g/L\n")
    with pytest.raises(Problem, match=r"the file says h in .*, the run counts in s") as caught:
        recorded(tmp_path, content)
    assert caught.value.path == ("data", "time")
    (note,) = recorded(tmp_path, content, {"time": {"column": "t", "unit": "s"}}).notes
    assert note.kind == "clock"
    assert "the file says h, the configuration unit: s, which is taken" in str(note)
    assert recorded(tmp_path, content, {"time": {"column": "t", "unit": "h"}}).outputs["S"].taken[3] == TIMES[3] * 3600


def test_signals_of_one_file_share_their_clock(tmp_path: Path) -> None:
    content = "t,glucose,ethanol\n" + "".join(f"{d.isoformat()},{v},{-v}\n" for d, v in zip(DATES, VALUES, strict=True))
    outputs = recorded(tmp_path, content, {"outputs": {"S": "glucose", "E": "ethanol"}}).outputs
    assert outputs["S"].taken is outputs["E"].taken
    assert outputs["S"].lines is outputs["E"].lines


@pytest.mark.parametrize("empty", [1, 300])
def test_dates_of_a_column_that_begins_with_empty_cells(tmp_path: Path, empty: int) -> None:
    """When a sample was known is often not said of the first ones."""
    moments = [START + timedelta(seconds=k) for k in range(empty + 20)]
    rows = [
        f"{at.isoformat()},{k % 7}.5,{'' if k < empty else (at + timedelta(seconds=0.5)).isoformat()}"
        for k, at in enumerate(moments)
    ]
    content = "t,glucose,known\n" + "\n".join(rows) + "\n"
    changes = {"outputs": {"S": {"column": "glucose", "available": "known"}}}
    signal = recorded(tmp_path, content, changes).outputs["S"]
    assert signal.taken.size == 20
    np.testing.assert_allclose(signal.available - signal.taken, 0.5, atol=1e-9)


def test_the_step_of_an_even_log_is_free_of_the_rounding_of_its_times(tmp_path: Path) -> None:
    """Every two seconds, in minutes: the step is 1/30, and not what is left of a difference of two times."""
    stamps = [(START + timedelta(seconds=2 * k)).isoformat() for k in range(700)]
    content = "t,glucose\n" + "".join(f"{stamp},{k % 5}.25\n" for k, stamp in enumerate(stamps))
    recording = recorded(tmp_path, content, time_unit="min")
    assert recording.median_gap == pytest.approx(1 / 30, rel=2e-16)
    assert recorded(tmp_path, "t,glucose\n0,1\n1,2\n3,1\n4,3\n", {}).median_gap == 1


def test_a_repeated_date_is_shown_as_it_stands_in_the_file(tmp_path: Path) -> None:
    dates = [f"2024-03-01T00:0{k}:30" for k in (0, 1, 2, 2, 3)]
    text = "t;glucose\n" + "".join(f"{date};{k}\n" for k, date in enumerate(dates))
    with pytest.raises(ConfigError, match=r":5: .* stamp 120 s \(2024-03-01T00:02:30\) has come before, on line 4"):
        recorded(tmp_path, text)


@pytest.mark.parametrize(
    ("form", "stamp", "told"),
    [
        ("%H:%M:%S", "22:59:{}", 1),
        ("%m %H:%M:%S", "05 22:59:{}", 1),
        ("%a %W %Y %H:%M:%S", "Mon 22 2024 22:59:{}", 0),
    ],
)
def test_times_without_a_date_are_told(tmp_path: Path, form: str, stamp: str, told: int) -> None:
    recording = recorded(
        tmp_path, log([stamp.format(f"{k:02d}") for k in range(30)]), {"time": {"column": "t", "format": form}}
    )
    assert recording.outputs["S"].taken.tolist() == list(range(30))
    remarks = [note.message for note in recording.notes if "has no date" in note.message]
    assert remarks == [f"column 't': the pattern {form} has no date: all times are taken to be of one day"] * told


@pytest.mark.parametrize("form", ["%a %H:%M", "%H:%M %A", "%w %H"])
def test_days_of_the_week_without_a_date_are_refused(tmp_path: Path, form: str) -> None:
    """They would be read and forgotten: Tuesday's 1 o'clock as Monday's."""
    with pytest.raises(ValueError, match="has days of the week but no date, so that days would be lost"):
        recorded(tmp_path, log(["Mon 22:59", "Tue 23:01"] * 15), {"time": {"column": "t", "format": form}})


@pytest.mark.parametrize("form", ["%m/%d/%Y %H:%M:%S %p", "%d.%m.%Y %I:%M", "%H:%M %p"])
def test_a_pattern_that_leaves_the_half_of_the_day_open_is_refused(form: str) -> None:
    with pytest.raises(ValueError, match=r"leaves open which half of the day it is: hours to 12 are %I with %p"):
        Clock(column="t", format=form)


def test_the_halves_of_a_day(tmp_path: Path) -> None:
    stamps = ["02/28/2024 11:00:00 PM", "02/29/2024 12:30:00 AM", "02/29/2024 01:00:00 AM", "02/29/2024 12:00:00 PM"]
    content = "t,glucose\n" + "".join(f"{stamp},{k % 3}\n" for k, stamp in enumerate(stamps))
    signal = recorded(tmp_path, content, {"time": {"column": "t", "format": "%m/%d/%Y %I:%M:%S %p"}}).outputs["S"]
    assert signal.taken.tolist() == [0, 5400, 7200, 46800]


def test_hours_alone_are_a_zone_behind_a_time(tmp_path: Path) -> None:
    stamps = ["2024-10-27 02:58:00+02", "2024-10-27 02:59:00.5+02", "2024-10-27 02:00:00+01"]
    content = "t,glucose\n" + "".join(f"{stamp},{k % 2}\n" for k, stamp in enumerate(stamps))
    recording = recorded(tmp_path, content)
    assert recording.outputs["S"].taken.tolist() == [0, 60.5, 120]
    assert recording.origin.zone == "UTC"
    with pytest.raises(ConfigError, match=r":2: t: .*; this one is read with time: {column: t, format: iso}"):
        recorded(tmp_path, content, {"time": {"column": "t", "format": "%Y-%m-%d %H:%M:%S%z"}})
