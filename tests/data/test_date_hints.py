"""What a message says to write of a date is accepted as it stands, at the key where it is wanted."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from pathlib import Path

import pytest
import yaml

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import HgorunError, Problem

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


MOMENTS = [datetime(2024, 1, 31, 13, 45, 10) + timedelta(hours=7 * k, minutes=11 * k) for k in range(4)]
OTHER_FORMS = [
    ("%d.%m.%y %H:%M", "plain"),
    ("%m/%d/%y %H:%M", "plain"),
    ("%y%m%d %H%M%S", "plain"),
    ("%d-%b-%Y %H:%M:%S", "plain"),
    ("%d-%b-%y %H:%M:%S", "plain"),
    ("%d. %B %Y %H:%M:%S", "plain"),
    ("%b %d, %Y %H:%M:%S", "plain"),
    ("%a %b %d %H:%M:%S %Y", "plain"),
    ("%a, %d %b %Y %H:%M:%S +0000", "%a, %d %b %Y %H:%M:%S %z"),
    ("%d/%b/%Y:%H:%M:%S +0000", "%d/%b/%Y:%H:%M:%S %z"),
    ("%m/%d/%Y %I:%M%p", "plain"),
    ("%Y%m%dT%H%M%SZ", "%Y%m%dT%H%M%S%Z"),
    ("%Y-%m-%dt%H:%M:%Sz", "%Y-%m-%dt%H:%M:%S%Z"),
    ("%Y%m%dT%H%M%S+0100", "%Y%m%dT%H%M%S%z"),
    ("%Y-%m-%d %H:%M:%S UTC", "%Y-%m-%d %H:%M:%S %Z"),
    ("%Y-%m-%d %H:%M:%S CET", "%Y-%m-%d %H:%M:%S %Z"),
    ("%Y/%m/%d %H:%M UTC+01:00", "%Y/%m/%d %H:%M UTC%z"),
    ("%Y%m%d %H:%M:%S", "plain"),
    ("%Y%m%d_%H%M%S", "plain"),
    ("%Y%m%d,%H%M%S", "plain"),
    ("%Y-%m-%d_%H-%M-%S", "plain"),
    ("%Y-%jT%H:%M:%S", "plain"),
    ("%G-W%V-%uT%H:%M:%S", "plain"),
    ("%Y年%m月%d日 %H:%M:%S", "plain"),
    ("'%Y-%m-%d %H:%M:%S'", "plain"),
    ("%H:%M:%S %d.%m.%Y", "plain"),
    ("%d.%m.%Y %H.%M.%S", "plain"),
    ("%d.%m.%Y, %H:%M:%S", "plain"),
    ("%d.%m.%Y %H:%M:%S:250", "%d.%m.%Y %H:%M:%S:%f"),
    ("%d.%m.%Y %H:%M:%S.0000001", "%d.%m.%Y %H:%M:%S.%f"),
    ("%m-%d-%Y %H:%M", "plain"),
    ("%Y-%m-%dT%H:%M:%S:%f", "plain"),
]


def advised(folder: Path, stamps: list[str]) -> str:
    """The pattern that is said of stamps in quotes that nothing is known of."""
    rows = "".join(f'"{stamp}",{k}.5\n' for k, stamp in enumerate(stamps))
    (folder / "log.csv").write_text(f"t,y\n{rows}")
    with pytest.raises(HgorunError) as caught:
        read(Data.model_validate({"file": "log.csv", "time": "t", "outputs": {"y": "y"}}), folder)
    said = re.search(r"such as time: ({.*})$", str(caught.value))
    assert said, str(caught.value)
    return str(yaml.safe_load(said[1])["format"])


@pytest.mark.parametrize(("form", "pattern"), OTHER_FORMS)
def test_the_pattern_that_is_said_reads_stamps_of_many_programs(tmp_path: Path, form: str, pattern: str) -> None:
    found = advised(tmp_path, [moment.strftime(form) for moment in MOMENTS])
    assert found == (form if pattern == "plain" else pattern)
    clock = {"column": "t", "format": found}
    times = read(Data.model_validate({"file": "log.csv", "time": clock, "outputs": {"y": "y"}}), tmp_path).outputs["y"]
    seconds = [(moment - MOMENTS[0]).total_seconds() for moment in MOMENTS]
    assert times.taken.tolist() == [second if "%S" in form else second // 60 * 60 for second in seconds]


@pytest.mark.parametrize("half", ["a.m.", "A. M.", "am"])
def test_halves_of_the_day_may_have_points(tmp_path: Path, half: str) -> None:
    other = half.translate(str.maketrans("aA", "pP"))
    stamps = [f"1/31/2024 11:59:59 {half}", f"1/31/2024 12:00:01 {other}", f"1/31/2024 1:45:10 {other}"]
    clock = {"column": "t", "format": advised(tmp_path, stamps)}
    found = read(Data.model_validate({"file": "log.csv", "time": clock, "outputs": {"y": "y"}}), tmp_path)
    assert found.outputs["y"].taken.tolist() == [0, 2, 6311]


def test_digits_beyond_microseconds_are_read(tmp_path: Path) -> None:
    stamps = [f"31.01.2024 13:45:10.{end}" for end in ("000000100", "000000123", "0000003", "25")]
    clock = {"column": "t", "format": advised(tmp_path, stamps)}
    found = read(Data.model_validate({"file": "log.csv", "time": clock, "outputs": {"y": "y"}}), tmp_path)
    assert found.outputs["y"].taken.tolist() == [0, 23 / 1e9, 200 / 1e9, 249999900 / 1e9]


@pytest.mark.parametrize(
    ("stamp", "forms"),
    [
        ("03-02-2024T01:05:07", ["%d-%m-%YT%H:%M:%S", "%m-%d-%YT%H:%M:%S"]),
        ("03/02/2024T01:05", ["%d/%m/%YT%H:%M", "%m/%d/%YT%H:%M"]),
        ("02/03/24 01:05", ["%d/%m/%y %H:%M", "%m/%d/%y %H:%M", "%y/%m/%d %H:%M"]),
        ("24-01-31", ["%d-%m-%y", "%y-%m-%d"]),
    ],
)
def test_all_that_may_be_meant_is_said(tmp_path: Path, stamp: str, forms: list[str]) -> None:
    told = message_of(tmp_path, {"t": [stamp], "y": ["1"]}, {"time": "t", "outputs": {"y": "y"}})
    assert re.findall(r'format: "([^"]*)"} where the (\w+)( first| is)', told) == [
        (form, {"d": "day", "m": "month", "y": "year"}[form[1]], " is") for form in forms
    ]
    assert told.count(" is first, ") == 1


NO_DATE = "; it is no date and time in any order of day, month and year"
MISTYPED = "; the others are dates in order, and this one alone is wrong: correct it in the file"


@pytest.mark.parametrize(
    ("stamp", "told"),
    [
        (
            "2024-01-31 13:45:10 EST",
            "; '2024-01-31 13:45:10' in it is %Y-%m-%d %H:%M:%S, and no pattern is known for ' EST': what is the same "
            "in all stands as it is; of a zone write the offset, such as -05:00, and %z",
        ),
        (
            "3 01:05:07",
            "; '01:05:07' in it is %H:%M:%S, and no pattern is known for '3 ': what is the same in all stands as it is",
        ),
        ("Jan 31 13:45:10", "; it has no year: write dates with it, or the time since the start, into the file"),
        (
            "4. März 2026 10:00",
            "; names of months are English, and 'März' is none: write the month as a number into the file",
        ),
        (
            "Mittwoch 4. Mai 2026",
            "; names of months are English, and 'Mai' is none: write the month as a number into the file",
        ),
        (
            "4 de marzo de 2026",
            "; names of months are English, and 'marzo' is none: write the month as a number into the file",
        ),
        (
            "13:45 foo bar and more of it than half",
            '; a date of another form needs its pattern: time: {column: t, format: "%d.%m.%Y %H:%M:%S"} reads '
            "31.05.2024 13:45:10",
        ),
        ("31.31.2024 13:45", NO_DATE),
        ("31.12.2024 25:61:00", NO_DATE),
        ("31.12.2024 25:00:00", NO_DATE),
        ("10 20 30", ""),
        ("Total 12:30", "; a line that is no sample, such as a total, is removed, or begins with #"),
        ("1:2:3:4:5:6:7:8:9:10:11:12:13:14:15:16:17 x", ""),
    ],
)
def test_of_other_texts_the_parts_are_said_that_are_known(tmp_path: Path, stamp: str, told: str) -> None:
    message = message_of(tmp_path, {"t": [stamp], "y": ["1"]}, {"time": "t", "outputs": {"y": "y"}})
    assert message.endswith(f":2: t: expected a number, found '{stamp}'{told}")


@pytest.mark.parametrize(
    ("stamps", "told"),
    [
        (["01/02/2024", "01/12/2024", "", "01/13/2024"], 'such as time: {column: t, format: "%m/%d/%Y"}'),
        (["03/02/24", "04/02/24", "13/02/24", "32.5"], "is first, .* where the year is"),
        (["03/02/24", "04/02/24", "13/02/99"], 'such as time: {column: t, format: "%d/%m/%y"}'),
        (["01/02/2024", "Total", "01/13/2024"], "is first, .* where the month is"),
        (["31.01.2024 23:59:59", "01/02/2024"], "%d.%m.%Y %H:%M:%S, and '01/02/2024' is not: a column has one form"),
    ],
)
def test_what_stands_below_shows_what_is_meant(tmp_path: Path, stamps: list[str], told: str) -> None:
    block: dict[str, object] = {"time": "t", "outputs": {"y": "y"}}
    columns = {"t": stamps, "y": [str(k) for k in range(len(stamps))]}
    assert re.search(f"{re.escape(told) if 'such' in told else told}$", message_of(tmp_path, columns, block))


def test_a_quote_that_is_left_open_below_leaves_what_is_said_of_a_date(tmp_path: Path) -> None:
    block: dict[str, object] = {"time": "t", "outputs": {"y": "y"}}
    told = message_of(tmp_path, {"t": ["31.01.2024", '"01.02.2024'], "y": ["1", "2"]}, block)
    assert told.endswith('such as time: {column: t, format: "%d.%m.%Y"}')


def test_a_pattern_that_is_said_reads_what_stands_above(tmp_path: Path) -> None:
    clock = {"column": "t", "format": "%d/%m/%Y"}
    block: dict[str, object] = {"time": clock, "outputs": {"y": "y"}}
    told = message_of(tmp_path, {"t": ["01/02/2024", "01/13/2024"], "y": ["1", "2"]}, block)
    assert told.endswith('such as time: {column: t, format: "%m/%d/%Y"}')
    told = message_of(tmp_path, {"t": ["13/02/2024", "01/13/2024"], "y": ["1", "2"]}, block)
    assert told.endswith("; this one is of the form %m/%d/%Y, and '13/02/2024' is not: a column has one form")


@pytest.mark.parametrize(
    ("form", "stamps", "told"),
    [
        ("iso", ["2024-03-01T10:00", "2024-03-02T10:00", "31.02.2024 25:61:00"], NO_DATE),
        ("iso", ["31.02.2024 25:61:00", "2024-03-01T10:00"], NO_DATE),
        ("iso", ["13:45 foo bar and more of it than half", "2024-03-01T10:00"], "than half'"),
        ("", ["0.5", "1.5", "31.02.2024 25:61:00"], NO_DATE),
        (
            "",
            ["0.5", "1.5", "29.02.2024 13:45"],
            "; this one is of the form %d.%m.%Y %H:%M, and '0.5' is not: a column has one form",
        ),
        ("%d.%m.%y", ["02.10.16", "03.10.16", "02.16.13", "04.10.16"], f"found '02.16.13'{MISTYPED}"),
        ("%d.%m.%Y", ["05.02.2024", "06.02.2024", "05.03.2024", "03.31.2024"], MISTYPED),
        ("%d.%m.%Y", ["05.02.2024", "06.02.2024", "03.31.2024"], "found '03.31.2024'"),
        ("%d.%m.%Y %H:%M:%S", ["31.12.2016 16:31:00", "31.12.2016 24:00:01"], NO_DATE),
        ("%Y%m%d%H%M%S", ["20160504223253", "20160509223263"], "found '20160509223263'"),  # 22:32:53 as a year
        ("%Y%m%d%H%M%S", ["20161231235959", "20161231236060"], "found '20161231236060'"),
    ],
)
def test_no_pattern_is_said_that_does_not_read_the_others_as_well(
    tmp_path: Path, form: str, stamps: list[str], told: str
) -> None:
    clock = {"column": "t", "format": form} if form else "t"
    columns = {"t": [f'"{stamp}"' for stamp in stamps], "y": [f"{k}.5" for k in range(len(stamps))]}
    assert message_of(tmp_path, columns, {"time": clock, "outputs": {"y": "y"}}).endswith(told)


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


@pytest.mark.parametrize(("names", "missing"), [("t;x [g/L]", "y"), ("Zeit;y", "t")])
def test_of_a_file_that_no_key_names_no_key_of_the_log_is_to_be_changed(
    tmp_path: Path, names: str, missing: str
) -> None:
    (tmp_path / "lab.csv").write_text(f"{names}\n0;1.5\n1;2\n")
    said = {"time": "t", "outputs": {"y": {"column": "y", "file": "lab.csv"}}}
    with pytest.raises(Problem, match=f"has no column '{missing}'") as caught:
        read(Data.model_validate(said), tmp_path, reference='data.reference: {y: {file: "lab.csv"')
    assert caught.value.path == ("data", "reference")
    advised = 'data.reference: {y: {file: "lab.csv", column: COLUMN, time: COLUMN}}'
    assert caught.value.message.endswith(f"; {advised} reads a file with other names than the log")
    with pytest.raises(Problem) as caught:
        read(Data.model_validate(said), tmp_path)
    assert (caught.value.path[1], "COLUMN" in caught.value.message) != ("reference", True)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("2026-03-14 10:01:30", "; this one is read with time: {column: t, format: iso}"),
        (
            "14.03.2026 10:01",
            "; this one is of the form %d.%m.%Y %H:%M, and '14.03.2026 10:01:30' is not: a column has one form",
        ),
        ("12.5", ""),
        (
            "14.03.202610:01:30",
            "; this one is of the form %d.%m.%Y%H:%M:%S, and '14.03.2026 10:01:30' is not: a column has one form",
        ),
        ("31.02.2026 10:01:30", NO_DATE),
    ],
)
def test_a_date_that_the_pattern_does_not_read(tmp_path: Path, text: str, told: str) -> None:
    clock = {"column": "t", "format": "%d.%m.%Y %H:%M:%S"}
    columns = {"t": [*stamped(BEGIN, "%d.%m.%Y %H:%M:%S"), text], "y": [f"{k % 4}.5" for k in range(10)]}
    message = message_of(tmp_path, columns, {"time": clock, "outputs": {"y": "y"}})
    assert message.endswith(f":11: t: expected a date of the form %d.%m.%Y %H:%M:%S, found {text!r}{told}")
