"""What a message says to write of a date is accepted as it stands, at the key where it is wanted."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from pathlib import Path

import pytest
import yaml

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import HgorunError

BEGIN = datetime(2026, 3, 14, 10, 1, 30)
EARLY = datetime(2026, 3, 1, 10, 1, 30)  # day and month may be exchanged
FORMS = [
    "%d.%m.%Y %H:%M:%S",
    "%m/%d/%Y %H:%M",
    "%d-%m-%Y %H:%M:%S",
    "%Y/%m/%dT%H:%M",
    "%Y%m%dT%H%M%S",
    "%Y-%d-%m %H:%M",
    "%m/%d/%Y %I:%M:%S %p",
    "%m/%d/%Y %I:%M %p",
]


def stamped(start: datetime, form: str, minutes: int = 0) -> list[str]:
    return [(start + timedelta(minutes=k + minutes)).strftime(form) for k in range(9)]


def message_of(folder: Path, columns: dict[str, list[str]], data: dict[str, object]) -> str:
    """What is said of a log with these columns, empty where it is read."""
    file = folder / "log.csv"
    rows = [",".join(row) for row in zip(*columns.values(), strict=True)]
    file.write_text("\n".join([",".join(f'"{name}"' for name in columns), *rows, ""]))
    try:
        read(Data.model_validate({"file": "log.csv", **data}), folder)
    except HgorunError as error:
        return str(error)
    return ""


def block(key: str, clock: object) -> dict[str, object]:
    """The block of a log in which a column of dates is that of a key."""
    if key == "available":
        return {"time": "t", "outputs": {"y": {"column": "y", "available": clock}}}
    return {"time": clock, "outputs": {"y": "y"}}


@pytest.mark.parametrize("key", ["time", "available"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("column", ["known", "date: known"])
def test_the_key_that_is_said_reads_the_log(tmp_path: Path, key: str, form: str, column: str) -> None:
    values = [f"{k % 4}.5" for k in range(9)]
    other = stamped(BEGIN, "%Y-%m-%dT%H:%M:%S", 0 if key == "available" else 60)
    columns = {"t": other, "y": values, column: stamped(BEGIN, form, 5)}
    told = message_of(tmp_path, columns, block(key, column))
    said = re.search(rf"needs its pattern, such as ({key}: {{.*}})$", told)
    assert said, told
    written = yaml.safe_load(said[1])
    assert written[key]["column"] == column
    assert message_of(tmp_path, columns, block(key, written[key])) == ""


def test_where_day_and_month_may_be_either_both_are_said(tmp_path: Path) -> None:
    columns = {"t": stamped(EARLY, "%m/%d/%Y %H:%M"), "y": [f"{k % 4}.5" for k in range(9)]}
    told = message_of(tmp_path, columns, {"time": "t", "outputs": {"y": "y"}})
    assert told.endswith(
        'needs its pattern, time: {column: t, format: "%d/%m/%Y %H:%M"} where the day is first, '
        'time: {column: t, format: "%m/%d/%Y %H:%M"} where the month is'
    )


@pytest.mark.parametrize(
    ("stamps", "right"),
    [
        (["2024-1-1 0:00:00", "2024-1-1 12:00:00", "2024-1-2 0:00:00", "2024-1-3 0:00:00"], "%Y-%m-%d %H:%M:%S"),
        (["2024-01-01  00:00:00", "2024-01-01  12:00:00", "2024-01-02  00:00:00"], "%Y-%m-%d %H:%M:%S"),
        (["2024-1-1", "2024-1-2", "2024-1-3"], "%Y-%m-%d"),
        (["2024-1-31T8:00", "2024-2-1T8:00"], "%Y-%m-%dT%H:%M"),
        (["2024-31-1 8:00", "2024-1-2 8:00"], "%Y-%d-%m %H:%M"),
    ],
)
def test_behind_a_year_stands_the_month_unless_that_cannot_be(tmp_path: Path, stamps: list[str], right: str) -> None:
    columns = {"t": stamps, "y": [f"{k}.5" for k in range(len(stamps))]}
    for clock in ("t", {"column": "t", "format": "iso"}):
        told = message_of(tmp_path, columns, {"time": clock, "outputs": {"y": "y"}})
        assert told.endswith(f'such as time: {{column: t, format: "{right}"}}')
    clock = {"column": "t", "format": right}
    block = Data.model_validate({"file": "log.csv", "time": clock, "outputs": {"y": "y"}})
    moments = [datetime.strptime(stamp, right) for stamp in stamps]
    assert read(block, tmp_path).outputs["y"].taken.tolist() == [(m - moments[0]).total_seconds() for m in moments]


def test_a_date_that_is_no_time_stamp_is_told_where_it_belongs(tmp_path: Path) -> None:
    columns = {"t": [str(k) for k in range(9)], "y": stamped(BEGIN, "%Y-%m-%dT%H:%M:%S")}
    told = message_of(tmp_path, columns, {"time": "t", "outputs": {"y": "y"}})
    assert told.endswith("dates are read as time stamps, with time: {column: y, format: iso}")


def test_a_file_of_one_signal_is_told_where_its_own_pattern_stands(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_text("t;X\n28.03.2026 23:30;0,84\n29.03.2026 01:00;1,17\n")
    columns = {"t": stamped(BEGIN, "%d.%m.%Y %H:%M:%S"), "y": [f"{k % 4}.5" for k in range(9)]}
    reference: dict[str, object] = {"file": "lab.csv", "column": "X"}
    said = {
        "time": {"column": "t", "format": "%d.%m.%Y %H:%M:%S"},
        "outputs": {"y": "y"},
        "reference": {"X": reference},
    }
    told = message_of(tmp_path, columns, said)
    found = re.search(
        r"expected a date of the form %d.%m.%Y %H:%M:%S, found '28.03.2026 23:30'; a date of another form needs its "
        r"pattern, such as (time: {.*}); data\.reference\.X may have such a time of its own$",
        told,
    )
    assert found, told
    reference |= yaml.safe_load(found[1])
    assert message_of(tmp_path, columns, said) == ""


def test_of_a_file_that_no_key_names_the_block_is_told_that_does(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_text("t;y\n28.03.2026 23:30;0,84\n")
    said = {"time": {"column": "t", "format": "iso"}, "outputs": {"y": {"column": "y", "file": "lab.csv"}}}
    told = r'; data\.reference: {y: {file: "lab\.csv", \.\.\.}} may have such a time of its own$'
    with pytest.raises(HgorunError, match=told):
        read(Data.model_validate(said), tmp_path, reference='data.reference: {y: {file: "lab.csv"')


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("2026-03-14 10:01:30", "; this one is read with time: {column: t, format: iso}"),
        (
            "14.03.2026 10:01",
            '; a date of another form needs its pattern, such as time: {column: t, format: "%d.%m.%Y %H:%M"}',
        ),
        ("12.5", "; leave out format where stamps are numbers"),
        ("31.02.2026 10:01:30", ""),
    ],
)
def test_a_date_that_the_pattern_does_not_read(tmp_path: Path, text: str, told: str) -> None:
    clock = {"column": "t", "format": "%d.%m.%Y %H:%M:%S"}
    columns = {"t": [*stamped(BEGIN, "%d.%m.%Y %H:%M:%S"), text], "y": [f"{k % 4}.5" for k in range(10)]}
    message = message_of(tmp_path, columns, {"time": clock, "outputs": {"y": "y"}})
    assert message.endswith(f":11: t: expected a date of the form %d.%m.%Y %H:%M:%S, found {text!r}{told}")
