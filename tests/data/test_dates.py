"""Many dates at once are those that are read one by one."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from hgorun.config.data import Csv
from hgorun.data.cells import Cells, Numbers, Stamps
from hgorun.data.csv.csv_table import CsvFile
from hgorun.data.times.date_texts import iso_stamp
from hgorun.data.times.dates import NAT, iso_stamps
from hgorun.errors import ConfigError

FORMS = [
    "2024-05-31",
    "2024-05-31T13:45",
    "2024-05-31 13:45:10",
    "2024-05-31T13:45:10.2",
    "2024-05-31T13:45:10,123456789",
    "2024-05-31T13:45:10.125Z",
    "2024-05-31T13:45:10+02:00",
    "2024-05-31T13:45-11:30",
    "2024-05-31 13:45:10+02",
    "2024-05-31 13:45:10.25-05",
    "2024-05-31T13:45+14",
    "1700-02-28T00:00:00",
    "2000-02-29T23:59:59.999999999",
    "2024-02-28T24:00",
    "2024-12-31T24:00:00.0Z",
]
WRONG = [
    "2024-02-30",
    "2023-02-29",
    "2024-13-01",
    "2024-00-10",
    "2024-05-31T24:01",
    "2024-05-31T24:00:01",
    "2024-05-31T24:00:00.1",
    "2016-12-31T23:59:60",
    "2024-05-31T13:60",
    "2024-05-31T13:45:60",
    "31.05.2024",
    "2024-05-31x13:45",
    "2024-05-31T13:45:1",
    "2024-05-31T13:45:10.",
    "2024/05/31",
    "today",
    "20a4-05-31",
    "2024-05-31T13:45:10+0a:00",
    "2024-05-31T13:45:10+0a",
    "2024-05-31T13:45:10+24",
    "2024-05-31-13",
    "2024-05-31+02",
    "1000-01-01",
    "9999-01-01",
    "2024-05-31T13:45:10.1234567891234567",
]


def at_once(cells: list[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    lengths = np.array([len(cell) for cell in cells])
    text = np.frombuffer("".join(cells).encode(), dtype=np.uint8)
    return iso_stamps(text, np.cumsum(lengths) - lengths, lengths)


@pytest.mark.parametrize("form", FORMS)
def test_each_form(form: str) -> None:
    stamps, known, zoned = at_once([form])
    assert (int(stamps[0]), bool(zoned[0])) == iso_stamp(form)
    assert known.all()


@pytest.mark.parametrize("text", [f for f in FORMS if "T24" not in f and ",1" not in f])
def test_each_form_as_numpy_and_python_read_it(text: str) -> None:
    plain, zone = (text[:-3], text[-3:]) if text[-3] in "+-" and len(text) > 10 else (text, "")
    moment = datetime.fromisoformat(plain[:26] + (f"{zone}:00" if zone else ""))
    offset = moment.utcoffset() or timedelta()
    stamp, zoned = iso_stamp(text)
    assert zoned is (moment.tzinfo is not None)
    expected = np.datetime64(moment.replace(tzinfo=None) - offset, "us")
    assert np.datetime64(stamp, "ns").astype("datetime64[us]") == expected


@pytest.mark.parametrize("wrong", ["2024-05-31-13", "2024-05-31+02", "2024-05-31 13"])
def test_two_digits_behind_a_date_alone_are_no_zone(wrong: str) -> None:
    with pytest.raises(ValueError, match="expected a date such as"):
        iso_stamp(wrong)


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_no_date_is_not_known(wrong: str) -> None:
    assert at_once([wrong, wrong])[1].tolist() == [False, False]


def test_dates_of_all_lengths_beside_each_other() -> None:
    random = np.random.default_rng(0)
    nanoseconds = random.integers(-(2**62), 2**62, 2000)
    cells = []
    for k, stamp in enumerate(nanoseconds.astype("datetime64[ns]")):
        unit = ["D", "m", "s", "ms", "us", "ns"][k % 6]
        cells.append("" if k % 50 == 7 else str(stamp.astype(f"datetime64[{unit}]")))
    stamps, known, _ = at_once(cells)
    assert known.all()
    assert stamps.tolist() == [iso_stamp(cell)[0] if cell else NAT for cell in cells]


@pytest.mark.parametrize("odd", ["", ",1", "2024-01-01T00:00:00 ,1", "nan,1", "# remark", '"2024-01-01",1'])
def test_rows_between_plain_ones(tmp_path: Path, odd: str) -> None:
    start = np.datetime64("2024-01-01T00:00:00", "ms")
    rows = [f"{stamp},{k}" for k, stamp in enumerate(start + 250 * np.arange(3000))]
    for place in (0, 5, 6, 7, 1000, 2999) if odd else ():
        rows[place] = odd
    (tmp_path / "log.csv").write_text("\n".join(["t,a", "2023-12-31T23:59:59,0", *rows]))
    wanted: list[Cells] = [Stamps("t"), Numbers("a")]
    table = CsvFile(tmp_path / "log.csv", Csv(), {}).table(wanted, 1e9)
    plain = [(line, row.split(",")) for line, row in enumerate(rows, start=3) if row and not row.startswith("#")]
    expected = [NAT if t in ("", "nan") else iso_stamp(t.strip(' "'))[0] for _, (t, _) in plain]
    assert table.columns[wanted[0]].tolist()[1:] == expected
    assert table.columns[wanted[1]].tolist()[1:] == [float(a) for _, (_, a) in plain]
    assert table.lines.tolist()[1:] == [line for line, _ in plain]


@pytest.mark.parametrize(
    ("stamp", "message"), [("2024-02-30T00:00:00.000", "day"), ("2024-01-02T00:00:00.000Z", "zone")]
)
def test_a_date_that_is_wrong_has_its_line(tmp_path: Path, stamp: str, message: str) -> None:
    start = np.datetime64("2024-01-01T00:00:00", "ms")
    rows = [f"{one},{k}" for k, one in enumerate(start + 250 * np.arange(3000))]
    rows[1500] = f"{stamp},1"
    (tmp_path / "log.csv").write_text("\n".join(["t,a", *rows]))
    with pytest.raises(ConfigError, match=rf":1502: t: .*{message}"):
        CsvFile(tmp_path / "log.csv", Csv(), {}).table([Stamps("t"), Numbers("a")], 1e9)


def test_the_first_row_is_not_plain(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text('t,a\n2024-01-01,"1"\n2024-01-02,2\n')
    wanted: list[Cells] = [Stamps("t"), Numbers("a")]
    table = CsvFile(tmp_path / "log.csv", Csv(), {}).table(wanted, 1e9)
    assert table.columns[wanted[1]].tolist() == [1, 2]


def test_midnight_ends_the_day_and_leap_seconds_are_told() -> None:
    assert iso_stamp("2024-02-28T24:00") == iso_stamp("2024-02-29T00:00")
    assert iso_stamp("2024-12-31T24:00:00Z") == iso_stamp("2025-01-01T00:00:00Z")
    with pytest.raises(ValueError, match="is a leap second, which dates here do not count: write the second before it"):
        iso_stamp("2016-12-31T23:59:60Z")


@pytest.mark.parametrize(
    ("pattern", "stamp"),
    [
        ("%d.%m.%Y %H:%M:%S", "31.12.2016 23:59:60"),
        ("%d.%m.%y %H:%M:%S.%f", "31.12.16 23:59:60.60"),
        ("%Y%m%d%H%M%S", "20161231235960"),
        ("%I:%M:%S %p %d-%b-%Y", "11:59:60 p.m. 31-Dec-2016"),
        ("%Y-%m-%dT%H:%M:%S%Z", "2016-12-31T23:59:60CET"),
    ],
)
def test_leap_seconds_of_a_pattern_are_told_too(pattern: str, stamp: str) -> None:
    read = Stamps("t", pattern).reader(".", frozenset())
    with pytest.raises(ValueError, match=re.escape(f"'{stamp}' is a leap second, which dates here do not count")):
        read(stamp)
    with pytest.raises(ValueError, match="expected a date of the form"):
        read(stamp.replace("59:60", "60:59").replace("5960", "6059"))


@pytest.mark.parametrize(
    ("date", "told"),
    [
        (
            "2024-13-01",
            'no month 13; a date of another form needs its pattern, such as time: {column: when, format: "%Y-%d-%m"}',
        ),
        ("2024-31-12T10:00", 'such as time: {column: when, format: "%Y-%d-%mT%H:%M"}'),
        ("2024-13-32", "there is no month 13"),
        ("2023-02-29", "there is no day 29 in a month of 28 days"),
        ("2024-05-31T25:00", "there is no hour 25: the last is 23"),
        ("2024-05-31T13:60", "there is no minute 60: the last is 59"),
        ("0000-05-31", "there is no year 0"),
        ("2024-03-00", "there is no day 0 in a month of 31 days"),
        ("2024-02-00T10:00Z", "there is no day 0 in a month of 29 days"),
        ("2024-00-10", "there is no month 0"),
        ("2024-00-00", "there is no month 0"),
        ("2024-02-30 10:00:00.5", "there is no day 30 in a month of 29 days"),
        ("2024-05-31T24:00:01", "there is no hour 24: the last is 23"),
        ("2024-05-31T23:59:61", "there is no second 61: the last is 59"),
    ],
)
def test_what_is_not_in_the_calendar_is_named(date: str, told: str) -> None:
    with pytest.raises(ValueError, match=re.escape(told)) as caught:
        Stamps("when").reader(".", frozenset())(date)
    assert str(caught.value).startswith(f"'{date}': there is no ")
