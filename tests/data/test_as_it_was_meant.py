"""What a log may mean otherwise than it says: dates turned round, days passed, inputs that stop, formats given once."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import recorded

from hgorun.config.data import Data
from hgorun.config.overrides import set_path
from hgorun.config.yaml_source import parse
from hgorun.data.reading import read
from hgorun.data.units.denominators import per_unit_of
from hgorun.errors import ConfigError, HgorunError, Problem

DAYS = ("05.01", "11.01", "03.02", "09.02", "02.03")  # day, then month: in order so, and not the other way round
PER_DAY = 86_400.0


def dated(stamps: tuple[str, ...], *more: str) -> str:
    """Rows with a column of stamps, further columns, and values."""
    rows = (f"{stamp},{''.join(text + ',' for text in more)}{k + k % 2}\n" for k, stamp in enumerate(stamps))
    return f"t,{''.join(f'm{k},' for k in range(len(more)))}glucose\n" + "".join(rows)


@pytest.mark.parametrize(
    ("stamps", "form", "right"),
    [
        (tuple(f"{day}.2024" for day in DAYS), "%m.%d.%Y", 'time: {column: t, format: "%d.%m.%Y"}'),
        (tuple(f"2024-{day.replace('.', '-')} 10:00" for day in DAYS), "%Y-%m-%d %H:%M", 'format: "%Y-%d-%m %H:%M"}'),
        (tuple(f"2024-{day.replace('.', '-')}" for day in DAYS), None, 'time: {column: t, format: "%Y-%d-%m"}'),
    ],
)
def test_day_and_month_exchanged_are_refused_with_the_right_pattern(
    tmp_path: Path, stamps: tuple[str, ...], form: str | None, right: str
) -> None:
    time = {"column": "t"} | ({"format": form} if form else {})
    backwards = r"dates run backwards .*line 4, column 't'.*in order"
    with pytest.raises(Problem, match=backwards + ".*; if they are right .*backwards: sort") as caught:
        recorded(tmp_path, dated(stamps), {"time": time})
    assert right in str(caught.value)
    assert caught.value.path == ("data", "time")
    told = recorded(tmp_path, dated(stamps), {"time": time, "faults": {"backwards": "sort"}})
    assert np.all(np.diff(told.outputs["S"].taken) > 0)
    (note,) = [one.message for one in told.notes if one.kind == "clock"]
    assert re.search(backwards, note)
    assert right in note
    as_meant = form.translate(str.maketrans("dm", "md")) if form else "%Y-%d-%m"
    found = recorded(tmp_path, dated(stamps), {"time": {"column": "t", "format": as_meant}}).outputs["S"].taken
    assert found.tolist() == [0, 6 * PER_DAY, 29 * PER_DAY, 35 * PER_DAY, 57 * PER_DAY]  # of the calendar of 2024


def test_dates_that_are_in_order_neither_way_are_only_refused_as_running_backwards(tmp_path: Path) -> None:
    stamps = tuple(f"{day}.2024" for day in (*DAYS, "05.01"))
    for form in ("%d.%m.%Y", "%m.%d.%Y"):
        with pytest.raises(ConfigError, match="lies before one above it"):
            recorded(tmp_path, dated(stamps), {"time": {"column": "t", "format": form}})


def test_days_beyond_the_twelfth_leave_one_reading(tmp_path: Path) -> None:
    stamps = ("05.01.2024", "13.01.2024", "11.01.2024", "12.01.2024")
    with pytest.raises(ConfigError, match="is later than stamps below it"):
        recorded(tmp_path, dated(stamps), {"time": {"column": "t", "format": "%d.%m.%Y"}})


CLOCK = ("22:30", "23:59", "00:10", "00:10", "12:00", "23:00", "01:00")
MINUTES = [0, 89, 100, 100, 810, 1470, 1590]


def test_midnight_is_counted_when_that_is_asked_for(tmp_path: Path) -> None:
    time: dict[str, Any] = {"column": "t", "format": "%H:%M"}
    midnight = r"midnight .*line 4.*no date: time: .*, next_day: true} counts days"
    with pytest.raises(Problem, match=midnight + "; if they are right as they stand, .*backwards: sort"):
        recorded(tmp_path, dated(CLOCK), {"time": time})
    faults = {"backwards": "sort", "repeated": "keep"}
    told = recorded(tmp_path, dated(CLOCK), {"time": time, "faults": faults}, time_unit="min")
    assert told.outputs["S"].taken.tolist() == [0, 0, 50, 710, 1340, 1370, 1429]
    assert any(re.search(midnight, note.message) for note in told.notes)
    asked = {"time": time | {"next_day": True}, "faults": {"repeated": "keep"}}
    found = recorded(tmp_path, dated(CLOCK), asked, time_unit="min")
    assert found.outputs["S"].taken.tolist() == MINUTES
    assert not any("one day" in note.message for note in found.notes)
    assert [(note.line, note.message) for note in found.notes if "next_day" in note.message] == [
        (
            6,
            "column 't': next_day counts the times that pass midnight: the gap of 11 h 50 min before this line, the "
            "longest, may be of a day or more, whose days are lost; such logs need dates",
        )
    ]


@pytest.mark.parametrize(
    ("stamps", "line"),
    [
        (("23:57", "23:58", "00:00", "00:01"), None),  # as far apart as ever
        (("23:57", "23:58", "00:02", "00:03", "00:04"), 4),
        (("20:00", "21:00", "22:00", "23:00", "00:00"), None),
        (("20:00", "21:01", "22:00", "23:00", "00:00"), 3),  # 25 h 1 min of 1 h 1 min cannot be told
        (("23:00", "23:01"), None),
        (("12:00", "03:00", "03:01"), 3),  # 15 h or more, in which midnight passes
        (("00:00", "22:00", "22:30"), 3),
    ],
)
def test_a_gap_that_may_be_of_days_is_told(tmp_path: Path, stamps: tuple[str, ...], line: int | None) -> None:
    time = {"column": "t", "format": "%H:%M", "next_day": True}
    found = recorded(tmp_path, dated(stamps), {"time": time, "faults": {"backwards": "sort"}})
    assert [note.line for note in found.notes if "next_day" in note.message] == [line] * (line is not None)


def test_days_are_counted_beside_missing_stamps_and_of_what_was_known(tmp_path: Path) -> None:
    text = "t,ta,glucose\n23:50,23:55,1\n00:10,00:15,2\n01:00,,3\n23:00,00:30,4\n00:20,00:40,5\n"
    outputs = {"S": {"column": "glucose", "available": "ta"}}
    time = {"column": "t", "format": "%H:%M", "next_day": True}
    found = recorded(tmp_path, text, {"time": time, "outputs": outputs}, time_unit="min").outputs["S"]
    assert found.taken.tolist() == [0, 20, 1390, 1470]
    assert found.available.tolist() == [5, 25, 1480, 1490]


def test_clocks_that_jitter_about_midnight_add_no_days(tmp_path: Path) -> None:
    stamps = ("23:59:50", "00:00:01", "23:59:59", "00:00:02", "00:00:10")
    time = {"column": "t", "format": "%H:%M:%S", "next_day": True}
    with pytest.raises(ConfigError, match=r"log.csv:4: .*lies before one above it"):
        recorded(tmp_path, dated(stamps), {"time": time})
    found = recorded(tmp_path, dated(stamps), {"time": time, "faults": {"backwards": "sort"}}).outputs["S"]
    assert found.taken.tolist() == [0, 9, 11, 12, 20]


def test_what_is_known_shortly_before_it_was_taken_is_not_of_the_next_day(tmp_path: Path) -> None:
    time = {"column": "t", "format": "%H:%M:%S", "next_day": True}
    outputs = {"S": {"column": "glucose", "available": "ta"}}
    for taken, known in (("23:00:21", "23:00:20"), ("00:00:01", "23:59:59")):
        with pytest.raises(ConfigError, match="before it was taken"):
            recorded(tmp_path, f"t,ta,glucose\n{taken},{known},1\n", {"time": time, "outputs": outputs})
    found = recorded(tmp_path, "t,ta,glucose\n20:00:00,10:00:00,1\n", {"time": time, "outputs": outputs})
    assert found.outputs["S"].available.tolist() == [14 * 3600]


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (("08:00,06:00", "09:00,07:30", "10:00,10:30"), [4]),  # the last 24.5 h later, counted as half an hour
        (("08:00,06:00", "09:00,", "10:00,10:30", "11:00,11:30"), [4]),
        (("08:00,08:30", "09:00,09:30", "10:00,10:30"), []),  # a day later, all of them: nothing shows it
        (("08:00,22:00", "09:00,15:00", "20:00,21:00"), []),  # out of order by less than half a day
        (("08:00,06:00", "09:00,07:00", "20:00,08:00"), []),  # shorter, and in order
    ],
)
def test_what_may_be_known_a_day_later_is_named(tmp_path: Path, lines: tuple[str, ...], told: list[int]) -> None:
    time = {"column": "t", "format": "%H:%M", "next_day": True}
    outputs = {"S": {"column": "glucose", "available": "ta"}}
    text = "t,ta,glucose\n" + "".join(f"{line},{k}\n" for k, line in enumerate(lines))
    found = recorded(tmp_path, text, {"time": time, "outputs": outputs, "faults": {"missing": "drop"}})
    notes = [note for note in found.notes if "known a day later" in note.message]
    assert [note.line for note in notes] == told
    assert all("30 min 0 s after it was taken" in note.message for note in notes)


@pytest.mark.parametrize(
    ("first", "others", "begins"),
    [
        (("23:50", "23:55", "00:05"), ("00:01", "00:04"), 11),
        (("23:50", "23:55", "00:05"), ("23:51", "00:04"), 1),
        (("00:10", "00:20", "00:30"), ("23:59", "00:15"), -11),
        (("08:00", "20:00", "07:00"), ("22:00", "06:00"), 840),
        (("08:00", "20:00", "07:00"), ("06:00", "06:30"), -120),
    ],
)
def test_days_of_other_files_count_from_the_first_output(
    tmp_path: Path, first: tuple[str, ...], others: tuple[str, ...], begins: int
) -> None:
    time = {"column": "t", "format": "%H:%M", "next_day": True}
    (tmp_path / "u.csv").write_text("t,u\n" + "".join(f"{stamp},{k + k % 2}\n" for k, stamp in enumerate(others)))
    changes = {"time": time, "inputs": {"u": {"column": "u", "file": "u.csv"}}}
    found = recorded(tmp_path, dated(first), changes, time_unit="min")
    assert found.inputs["u"].times[0] - found.outputs["S"].taken[0] == begins


def test_days_go_on_from_part_to_part(tmp_path: Path) -> None:
    time = {"column": "t", "format": "%H:%M", "next_day": True}
    parts = (("22:30", "23:30", "00:30"), ("01:00", "23:50"), ("00:10", "00:20"))
    files = [tmp_path / f"part{k}.csv" for k in range(len(parts))]
    for file, stamps in zip(files, parts, strict=True):
        file.write_text(dated(stamps))
    block = Data.model_validate({"time": time, "outputs": {"S": "glucose"}})
    found = read(block, tmp_path, files=files, time_unit="min").outputs["S"].taken
    assert found.tolist() == [0, 60, 120, 150, 1520, 1540, 1550]


def test_next_day_is_refused_where_there_are_dates() -> None:
    for form in ({"format": "%d.%m.%Y %H:%M"}, {"format": "iso"}, {}):
        with pytest.raises(ValueError, match="next_day is for patterns that have no date"):
            Data.model_validate({"time": {"column": "t", "next_day": True} | form, "outputs": {"S": "x"}})


@pytest.mark.parametrize(
    ("time", "taken", "known", "delay"),
    [
        ({"format": "%d.%m.%Y %H:%M"}, "05.01.2024 10:00", "05.01.2024 10:30", 1800.0),
        ({"unit": "min"}, "10", "40", 1800.0),
        ({"format": "unix", "unit": "ms"}, "1700000000000", "1700000001500", 1.5),
        ({"format": "%d.%m.%Y %H:%M"}, "05.01.2024 10:00", "2024-01-05T10:30", 1800.0),  # as its column shows
    ],
)
def test_what_is_known_later_is_written_as_the_time_beside_it(
    tmp_path: Path, time: dict[str, str], taken: str, known: str, delay: float
) -> None:
    text = f"t,ta,glucose\n{taken},{known},1\n"
    outputs = {"S": {"column": "glucose", "available": "ta"}}
    found = recorded(tmp_path, text, {"time": {"column": "t"} | time, "outputs": outputs}).outputs["S"]
    assert (found.available - found.taken).tolist() == pytest.approx([delay])
    own = {"S": {"column": "glucose", "available": {"column": "ta", "unit": "h"}}}
    if time == {"unit": "min"}:  # what is said counts
        assert (
            recorded(tmp_path, text, {"time": {"column": "t"} | time, "outputs": own}).outputs["S"].available == 144e3
        )


def logged(places: list[int]) -> str:
    """A row a second for a minute, an input in some of them."""
    held = (f"{k},{20 + k % 3},{1 + k % 2 if k in places else ''}\n" for k in range(61))
    return "t,glucose,u\n" + "".join(held)


@pytest.mark.parametrize(
    ("places", "line", "said"),
    [
        (
            [*range(20), *range(45, 61)],
            47,
            "jump by more than 20 usual steps, at most by 26 s; an input's last value is held",
        ),
        ([*range(30, 61)], 32, "its values begin at 30 s, the outputs at 0 s: the first value is taken until then"),
        ([*range(30)], 31, "its values end at 29 s, the outputs at 60 s: the last value is held until then"),
        ([*range(20), *range(38, 61)], 0, ""),
        ([0, 30], 0, ""),  # written when it changes
        ([50], 52, "its values begin at 50 s, the outputs at 0 s: the first value is taken until then"),
    ],
)
def test_an_input_that_goes_on_without_values_is_told(tmp_path: Path, places: list[int], line: int, said: str) -> None:
    notes = [n for n in recorded(tmp_path, logged(places), {"inputs": {"u": "u"}}).notes if n.kind == "gaps"]
    if not said:
        assert notes == []
        return
    (note,) = notes
    assert (note.signal, note.line, said in str(note)) == ("inputs.u", line, True), note


def test_gaps_of_an_input_are_refused_when_told_so(tmp_path: Path) -> None:
    """At the input itself: what all are told is of outputs, since inputs may be written when they change."""
    inputs: dict[str, Any] = {"u": {"column": "u", "faults": {"gaps": "refuse"}}}
    told = {"inputs": {"u": "u"}, "faults": {"gaps": "refuse"}}
    notes = recorded(tmp_path, logged([*range(20), *range(45, 61)]), told).notes
    assert [n.signal for n in notes if n.kind == "gaps"] == ["inputs.u"]
    with pytest.raises(ConfigError, match=r"log.csv:47: inputs.u: .*faults: {gaps: report}"):
        recorded(tmp_path, logged([*range(20), *range(45, 61)]), {"inputs": inputs})


@pytest.mark.parametrize(
    ("laboratory", "said"),
    [
        ("time;E\n0;1.5\n1;3,8\n", 'comma: csv: {decimal: ","}; csv goes below data.reference.E'),
        ("time,E\n0,1.5\n1,n.d.\n", 'a missing value: csv: {missing: ["n.d."]}; csv goes below data.reference.E'),
    ],
)
def test_how_a_file_is_written_is_advised_with_its_place(tmp_path: Path, laboratory: str, said: str) -> None:
    (tmp_path / "lab.csv").write_text(laboratory)
    reference = {"E": {"file": "lab.csv", "column": "E", "time": "time"}}
    with pytest.raises(HgorunError) as caught:
        recorded(tmp_path, "t,glucose\n0,1\n", {"reference": reference})
    assert said in str(caught.value)


def test_of_the_log_itself_the_key_is_that_of_all_signals(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"for signs between thousands: csv: {thousands: .*; csv goes below data$"):
        recorded(tmp_path, "t;glucose\n0;1.5\n1;1'000.5\n")
    (tmp_path / "log.csv").write_bytes(b"t,glucose\n0,1\n1,\xb5\n")
    with pytest.raises(ConfigError, match=r"csv: {encoding: cp1252}, or latin-1; csv goes below data$"):
        read(Data.model_validate({"file": "log.csv", "time": "t", "outputs": {"S": "glucose"}}), tmp_path)


@pytest.mark.parametrize(
    ("unit", "time", "found"),
    [
        ("g/(L h)", "s", "g/(L s)"),
        ("g/(L*h)", "min", "g/(L*min)"),
        ("mol/(m^2 d)", "h", "mol/(m^2 h)"),
        ("g/(L h)", "h", ""),
        ("g h/(L g)", "s", ""),  # times a time
        ("g/(L·h)", "s", "g/(L·s)"),
    ],
)
def test_a_rate_in_brackets_is_one(unit: str, time: str, found: str) -> None:
    assert per_unit_of(unit, time) == found


@pytest.mark.parametrize("name", ["r [g/(L h)]", "r (g/(L h))"])
def test_a_rate_in_brackets_is_converted_or_told(tmp_path: Path, name: str) -> None:
    text = f"t,{name}\n0,7200\n1,3600\n"
    outputs = {"S": {"column": name}}
    (note,) = recorded(tmp_path, text, {"outputs": outputs}, time_unit="s").notes
    assert ("its name says g/(L h)" in note.message, "g/(L s)" in note.message) == (True, True)
    said = {"S": {"column": name, "unit": "g/(L h)"}}
    found = recorded(tmp_path, text, {"outputs": said}, time_unit="s", units={"S": "g/(L s)"}).outputs["S"].values
    assert np.allclose(found, [2.0, 1.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("1.5 g/L", "found '1.5 g/L'; a cell holds the number alone, and g/L is the unit of its column"),
        ("5%", "found '5%'; a cell holds the number alone, and % is the unit of its column"),
        ("21,5°C", "the number alone, and °C is the unit of its column"),
    ],
)
def test_a_unit_in_a_cell_is_told_as_one(tmp_path: Path, cell: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, f"t;glucose\n0;1.25\n1;{cell}\n")
    assert said in str(caught.value)


@pytest.mark.parametrize("cell", ["1e+", "2.5E-", "1e"])
def test_an_exponent_without_digits_is_no_unit(tmp_path: Path, cell: str) -> None:
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, f"t;glucose\n0;1.25\n1;{cell}\n")
    assert str(caught.value).endswith(f"expected a number, found '{cell}'")


def test_numbers_where_a_pattern_of_dates_is_given(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="found '0'; leave out format where stamps are numbers"):
        recorded(tmp_path, "t,glucose\n0,1\n", {"time": {"column": "t", "format": "%d.%m.%Y"}})


def test_a_folder_in_the_place_of_a_log(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="this is a folder; name the file of the log in it"):
        read(Data.model_validate({"time": "t", "outputs": {"S": "glucose"}}), tmp_path, files=[tmp_path])


def test_a_key_of_a_column_that_is_only_a_name(tmp_path: Path) -> None:
    source = parse("data: {outputs: {S: glucose}}\n", "a.yaml")
    with pytest.raises(
        ConfigError, match=r"a column: `--set 'data.outputs.S=\{column: \"glucose\", unit: \"kg\"\}'` says"
    ):
        set_path(source, "data.outputs.S.unit=kg")
