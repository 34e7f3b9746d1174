"""What is done about faults: as told, with a note, or refused with the key that would allow it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import LOG, noisy, recorded, table

from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.log import log_of

TIMES, VALUES = noisy(60)


def changed(**changes: Any) -> str:
    """The log with other times or values at some places."""
    times, values = TIMES.copy(), VALUES.copy()
    for name, array in (("times", times), ("values", values)):
        for place, value in changes.get(name, {}).items():
            array[place] = value
    return table(times, values)


SWAPPED = changed(times={10: TIMES[11], 11: TIMES[10]})
AGAIN = changed(times={11: TIMES[10], 12: TIMES[10]})
KNOTS = np.arange(0, 60, 6)
FILLED = table(TIMES, np.interp(TIMES, TIMES[KNOTS], VALUES[KNOTS]))
STUCK = changed(values={k: 20.5 for k in range(20, 45)})
LONG_TIMES, LONG_VALUES = noisy(100)
LONG_VALUES[5:26] = LONG_VALUES[60:82] = 20.5
STUCK_TWICE = table(LONG_TIMES, LONG_VALUES)
AT_REST = table(LONG_TIMES, np.where(LONG_VALUES == 20.5, 0.0, LONG_VALUES))
COUNTER = table(LONG_TIMES, np.cumsum(np.where(np.arange(100) // 40 == 1, 0, 0.5 + LONG_VALUES % 5)).round(2))
CONSTANT = table(LONG_TIMES, np.full(100, 20.5))
SLIPPED = changed(values={k: VALUES[k] * 1000 for k in range(30, 60)})
GAP = table(np.where(np.arange(60) < 40, TIMES, TIMES + 1000), VALUES)
WILD = changed(values={7: 900.0, 9: -5})
HOLED = changed(values={7: np.nan})
PLAUSIBLE = {"outputs": {"S": {"column": "glucose", "plausible": [0, 100]}}}


@pytest.mark.parametrize(
    ("content", "block", "fault", "message"),
    [
        (SWAPPED, {}, {}, r":13: outputs\.S: the time stamp .* lies before one above it; faults: \{backwards: sort\}"),
        (AGAIN, {}, {}, r":13: outputs\.S: the time stamp .* has come before, on line 12; faults: \{repeated: first\}"),
        (FILLED, {}, {}, r":2: outputs\.S: .* on straight lines, .* \(lines 2 to 8, .*\); faults: \{filled: drop\}"),
        (STUCK, {}, {"stuck": "refuse"}, r":22: outputs\.S: 25 samples of equal values .*\(lines 22 to 46\)"),
        (
            STUCK_TWICE,
            {},
            {"stuck": "refuse"},
            r":7: outputs\.S: 43 samples in 2 stretches of equal values, .*\(lines 7 to 27, 62 to 83\)",
        ),
        (
            AT_REST,
            {},
            {"stuck": "refuse"},
            r":7: .* 43 samples in 2 stretches of equal values, as of a machine at rest,",
        ),
        (COUNTER, {}, {"stuck": "refuse"}, r":41: .* 41 samples of equal values in a row, as of a machine at rest,"),
        (
            CONSTANT,
            {},
            {"stuck": "refuse"},
            r":2: .* 100 samples of equal values in a row, as if the sensor were stuck",
        ),
        (SLIPPED, {}, {}, r":32: outputs\.S: from here on the values differ by a factor 1000 .*slips: report"),
        (GAP, {}, {"gaps": "refuse"}, r":42: outputs\.S: the time stamps jump by more than 20 usual steps"),
        (WILD, PLAUSIBLE, {"implausible": "refuse"}, r":9: outputs\.S: the value is outside of \[0, 100\]"),
        (HOLED, {}, {"missing": "refuse"}, r":9: outputs\.S: the value is missing"),
    ],
)
def test_refused(tmp_path: Path, content: str, block: dict[str, Any], fault: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv" + message):
        recorded(tmp_path, content, block | {"faults": fault})


@pytest.mark.parametrize(
    ("content", "block", "fault", "note", "kept"),
    [
        (SWAPPED, {}, {"backwards": "sort"}, ("backwards", 13, 1), range(60)),
        (SWAPPED, {}, {"backwards": "drop"}, ("backwards", 13, 1), [k for k in range(60) if k != 11]),
        (AGAIN, {}, {"repeated": "first"}, ("repeated", 13, 2), [k for k in range(60) if k not in (11, 12)]),
        (AGAIN, {}, {"repeated": "last"}, ("repeated", 13, 2), [k for k in range(60) if k not in (10, 11)]),
        (AGAIN, {}, {"repeated": "keep"}, ("repeated", 13, 2), range(60)),
        (FILLED, {}, {"filled": "report"}, ("filled", 2, 55), range(60)),
        (FILLED, {}, {"filled": "drop"}, ("filled", 2, 55), [*KNOTS, 55, 56, 57, 58, 59]),
        (STUCK, {}, {}, ("stuck", 22, 25), range(60)),
        (STUCK, {}, {"stuck": "drop"}, ("stuck", 22, 25), [*range(21), *range(45, 60)]),
        (SLIPPED, {}, {"slips": "report"}, ("slips", 32, 1), range(60)),
        (GAP, {}, {}, ("gaps", 42, 1), range(60)),
        (WILD, PLAUSIBLE, {}, ("implausible", 9, 2), [k for k in range(60) if k not in (7, 9)]),
        (HOLED, {}, {}, ("missing", 9, 1), [k for k in range(60) if k != 7]),
    ],
)
def test_handled_as_told(
    tmp_path: Path,
    content: str,
    block: dict[str, Any],
    fault: dict[str, str],
    note: tuple[str, int, int],
    kept: Any,
) -> None:
    recording = recorded(tmp_path, content, block | {"faults": fault})
    (found,) = recording.notes
    assert (found.kind, found.line, found.count) == note
    lines = recording.outputs["S"].lines
    assert sorted(lines - 2) == list(kept)
    assert np.all(np.diff(recording.outputs["S"].taken) >= 0)


@pytest.mark.parametrize("content", [SWAPPED, AGAIN, FILLED, SLIPPED], ids=["swapped", "again", "filled", "slipped"])
def test_what_a_refusal_advises_stands_where_it_says(tmp_path: Path, content: str) -> None:
    """A process that steps by a factor 1000 once, and stays, looks as a slip does: as it is taken by what is said."""
    with pytest.raises(ConfigError) as refused:
        recorded(tmp_path, content)
    *_, advised, place = refused.value.message.split("; ")
    assert place == "faults goes below data"
    key, _, how = advised.removeprefix("faults: {").partition("}")[0].partition(": ")
    assert recorded(tmp_path, content, {"faults": {key: how}}).outputs["S"].values.size
    if key == "slips":
        values = recorded(tmp_path, content, {"faults": {key: how}}).outputs["S"].values
        np.testing.assert_array_equal(values[30:], VALUES[30:] * 1000)


@pytest.mark.parametrize(("content", "kind", "left"), [(FILLED, "filled", 55), (STUCK, "stuck", 25)])
def test_of_what_is_dropped_the_ends_stay_and_the_others_are_counted(
    tmp_path: Path, content: str, kind: str, left: int
) -> None:
    recording = recorded(tmp_path, content, {"faults": {kind: "drop"}})
    (found,) = recording.notes
    dropped = 60 - recording.outputs["S"].values.size
    assert 0 < dropped < left
    assert found.message.startswith(f"{left} samples ")
    assert found.message.endswith(f", of which {dropped} are left out")


def test_repeated_stamps_are_averaged(tmp_path: Path) -> None:
    signal = recorded(tmp_path, AGAIN, {"faults": {"repeated": "mean"}}).outputs["S"]
    assert signal.values[10] == pytest.approx(VALUES[10:13].mean(), abs=1e-12)
    np.testing.assert_array_equal(signal.values[11:], VALUES[13:])


def test_the_mean_of_angles_is_not_half_a_turn_off(tmp_path: Path) -> None:
    content = "t,glucose\n0,3.0\n1,3.1\n1,-3.1\n2,-3.0\n2,-3.1\n2,3.1\n3,1.0\n3,2.0\n"
    block = {"faults": {"repeated": "mean"}}
    found = recorded(tmp_path, content, block, periods={"S": 2 * np.pi}).outputs["S"].values
    vectors = [np.mean(np.exp(1j * np.array(some))) for some in ([3.0], [3.1, -3.1], [-3.0, -3.1, 3.1], [1.0, 2.0])]
    np.testing.assert_allclose(np.exp(1j * found), vectors / np.abs(vectors), atol=5e-4)  # of three only nearly
    assert found[3] == 1.5
    assert recorded(tmp_path, content, block, periods={"x": 2 * np.pi}).outputs["S"].values[1] == 0.0


def test_the_period_of_a_plant_holds_for_its_log(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,glucose\n0,3.0\n1,3.1\n1,-3.1\n2,-3.0\n")
    plant = {"states": ["a"], "dynamics": {"a": "0"}, "output": {"S": {"value": "a", "period": "2*pi"}}}
    source = Source({"plant": plant, "data": LOG | {"faults": {"repeated": "mean"}}}, {})
    found = log_of(source, tmp_path / "log.yaml").read()
    assert found.outputs["S"].values[1] == pytest.approx(np.pi, abs=1e-12)


def test_signals_below_each_other_are_told_apart_by_their_names(tmp_path: Path) -> None:
    rows = [f"{name},{k},{value}" for k in range(5) for name, value in (("level", 1.5 + k), ("flow", 90 + k))]
    content = "tag,t,glucose\n" + "\n".join(rows)
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, content)
    right = """which 'tag' names: quality: {column: "tag", good: ["level"]} takes those of one; faults: {repeated:"""
    assert right in str(caught.value)
    block = {"outputs": {"S": {"column": "glucose", "quality": {"column": "tag", "good": ["level"]}}}}
    assert recorded(tmp_path, content, block).outputs["S"].values.tolist() == [1.5, 2.5, 3.5, 4.5, 5.5]


TURNING = table(np.arange(60.0), (0.93 * np.arange(60) + 0.001 * np.arange(60) ** 2).round(2) % 8)
PASSED = table(np.arange(60.0), np.where(np.arange(60) < 30, 7.93, -0.18) + 0.01 * np.arange(60))


@pytest.mark.parametrize(("content", "kind"), [(TURNING, "straight lines"), (PASSED, "as if the unit had changed")])
def test_where_an_angle_passes_a_whole_turn_nothing_has_changed(tmp_path: Path, content: str, kind: str) -> None:
    with pytest.raises(ConfigError, match=kind):
        recorded(tmp_path, content)
    assert not recorded(tmp_path, content, periods={"S": 8.0}).notes


def test_a_signal_may_be_treated_otherwise(tmp_path: Path) -> None:
    column = {"column": "glucose", "faults": {"repeated": "last"}}
    recording = recorded(tmp_path, AGAIN, {"outputs": {"S": column}, "faults": {"repeated": "refuse"}})
    assert recording.outputs["S"].values.size == 58


def test_nothing_is_left(tmp_path: Path) -> None:
    block = {"outputs": {"S": {"column": "glucose", "plausible": [1000, 2000]}}}
    with pytest.raises(ConfigError, match="no value is left"):
        recorded(tmp_path, table(TIMES, VALUES), block)


@pytest.mark.parametrize("good", [[0], ["0"], ["good", 0]])
def test_only_good_values(tmp_path: Path, good: list[Any]) -> None:
    rows = table(TIMES, VALUES).splitlines()
    flags = ["0" if k % 4 else "192" if k % 8 else "bad" for k in range(60)]
    content = "\n".join([rows[0] + ",q", *(f"{row},{flag}" for row, flag in zip(rows[1:], flags, strict=True))])
    block = {"outputs": {"S": {"column": "glucose", "quality": {"column": "q", "good": good}}}}
    recording = recorded(tmp_path, content, block)
    np.testing.assert_array_equal(recording.outputs["S"].values, VALUES[np.arange(60) % 4 > 0])
    assert [(note.kind, note.line, note.count) for note in recording.notes] == [("quality", 2, 15)]


def late(rows: str) -> dict[str, str]:
    return {"content": "t,known,glucose\n" + rows}


LATE = {"outputs": {"S": {"column": "glucose", "available": "known"}}}


def test_known_before_it_was_taken(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r":3: outputs\.S: known at 1 s, before it was taken at 2 s"):
        recorded(tmp_path, changes=LATE, **late("1,5,3\n2,1,4\n"))


def test_known_long_after_the_log(tmp_path: Path) -> None:
    """No output grid reaches that far: the line is named, and not the key of the grid."""
    with pytest.raises(
        ConfigError, match=r":3: outputs\.S: known at 1e\+300 s, more than 1e\+08 mean steps of the log"
    ):
        recorded(tmp_path, changes=LATE, **late("1,5,3\n2,1e300,4\n3,4,9\n"))
    recording = recorded(tmp_path, changes=LATE, **late("1,5,3\n2,1e7,4\n3,4,9\n"))
    assert recording.span == (1, 1e7)


def test_what_is_never_known_is_left_out(tmp_path: Path) -> None:
    recording = recorded(tmp_path, changes=LATE, **late("1,5,3\n2,,4\n3,4,9\n"))
    np.testing.assert_array_equal(recording.outputs["S"].taken, [1, 3])
    assert "the time when it was known is missing" in str(recording.notes[0])
    assert recording.span == (1, 5)


def test_replicates_of_late_samples_by_arrival(tmp_path: Path) -> None:
    changes = LATE | {"faults": {"repeated": "keep"}}
    signal = recorded(tmp_path, changes=changes, **late("3,4,9\n1,7,3\n1,5,4\n")).outputs["S"]
    np.testing.assert_array_equal(signal.taken, [1, 1, 3])
    np.testing.assert_array_equal(signal.available, [5, 7, 4])


@pytest.mark.parametrize(
    ("content", "told", "message"),
    [
        ('t;glucose\n0;"1,234"\n1;"2,500"\n', {}, r":2: '1,234' may be a number with thousands or with decimals"),
        ("t;glucose\n0,0;1,0\n0,1;1,1\n0,2;1.2\n0,3;1,1\n", {}, r":4: glucose: .*decimals have a comma here"),
        ("t;glucose;D\n0;9,005;0,0\n1;8.810;0,0\n2;8,788;0,1\n", {}, r":3: glucose: .*'8.810'; decimals have a comma"),
        ("t;glucose;n\n0;999.5;1\n1;1,234;2\n2;2,345;3\n3;3,456;4\n", {}, r":3: glucose: .*decimals have a point here"),
        ("t;glucose;note\n0;1.5;2,5\n1;2.5;2,5\n2;2,5;1.5\n3;2.5;2,5\n", {}, r":4: glucose: .*decimals have a point"),
        (
            "t;glucose\n0;1.5\n1;2,5\n",
            {"decimal": "."},
            r":3: glucose: .*decimals have a point here; where all have a comma",
        ),
        (
            "t;glucose\n0;1.5\n1;2,5\n",
            {"decimal": ","},
            r":2: glucose: .*decimals have a comma here; where all have a point",
        ),
        (
            "0,1.5\n1,2.5\n",
            {},
            r":1: expected a line with the names of the columns.*, such as t,y1: columns are taken by",
        ),
        ("0\t1.5\n1\t2.5\n", {}, r":1: expected a line with the names .*write such a line above them, of 2 names: "),
        ("#a\n0,1.5\n1,2.5\n", {}, r":2: expected a line with the names of the columns"),
        (
            "t,glucose\n0,2024-05-31\n1,2\n",
            {},
            r":2: glucose: .*with time: {column: glucose, format: iso}",
        ),
        ("t,glucose\n0,1\n\n1,2,3\n", {}, r":4: 3 cells, where the header has 2"),
        ("t,glucose\nh,g/L\n", {}, r":1: a header without values below it"),
        (
            "t,glucose\n0,1.5\n1,2\n",
            {"units_row": True},
            r":2: data.csv.units_row: expected the units of .*found 0,1.5",
        ),
        ('t,glucose\n0,1\n1,"2" 3\n', {}, r":3: not CSV"),
    ],
)
def test_text_that_is_refused(tmp_path: Path, content: str, told: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv" + message):
        recorded(tmp_path, content, {"csv": told})


@pytest.mark.parametrize("total", ["Mean;2,0", "Mean", "Mean;"])
@pytest.mark.parametrize("first", ["{}", "2024-01-01T00:0{}:00"], ids=["numbers", "dates"])
def test_a_total_below_the_rows_and_what_is_advised_about_it(tmp_path: Path, total: str, first: str) -> None:
    rows = "t;glucose\n" + "".join(f"{first.format(k)};{k},5\n" for k in range(3))
    with pytest.raises(ConfigError, match=r":5: .*a line that is no sample, .*, is removed, or begins with #"):
        recorded(tmp_path, rows + total)
    with pytest.raises(ConfigError, match=r", or begins with %"):
        recorded(tmp_path, rows + total, {"csv": {"comment": "%"}})
    for advised in ("", f"# {total}"):
        assert recorded(tmp_path, rows + advised).outputs["S"].values.tolist() == [0.5, 1.5, 2.5]


def test_thousands_or_decimals_once_it_is_told(tmp_path: Path) -> None:
    content = 't;glucose\n0;"1,234"\n1;"2,500"\n'
    signal = recorded(tmp_path, content, {"csv": {"decimal": ","}}).outputs["S"]
    np.testing.assert_array_equal(signal.values, [1.234, 2.5])


def test_lines_above_the_header(tmp_path: Path) -> None:
    content = "Logger 7, serial 12\nStation,4,north\n" + table(TIMES, VALUES)
    signal = recorded(tmp_path, content, {"csv": {"skip": 2}}).outputs["S"]
    np.testing.assert_array_equal(signal.lines, np.arange(4, 64))


@pytest.mark.parametrize("stated", ["sep=;", '"sep=;"', "SEP=;\r"])
def test_a_first_line_that_states_the_separator_is_no_header(tmp_path: Path, stated: str) -> None:
    """As Excel writes and reads it; the names alone would be divided by commas."""
    content = f"{stated}\n" + "t;glucose;a,b,c\n0;1,5;7\n1;2,5;8\n"
    signal = recorded(tmp_path, content).outputs["S"]
    assert (signal.values.tolist(), signal.lines.tolist()) == ([1.5, 2.5], [3, 4])
    assert recorded(tmp_path, content, {"csv": {"skip": 1}}).outputs["S"].values.tolist() == [1.5, 2.5]
    tabs = content.replace(";", "\t")
    assert recorded(tmp_path, tabs, {"csv": {"separator": "\t"}}).outputs["S"].values.tolist() == [1.5, 2.5]


def test_names_that_stand_twice(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="2 columns called 'glucose'"):
        recorded(tmp_path, "t,glucose,glucose\n0,1,2\n1,2,3\n")


@pytest.mark.parametrize(
    ("content", "column", "message"),
    [
        ("Messung 3;\nt;glucose [g/L]\n0;1.5\n1;2.5\n", "glucose [g/L]", r"csv: {skip: 1}"),
        ("Messung 3\n\nam 3.5.\nt,glucose\n0,1.5\n1,2.5\n", "glucose", r"csv: {skip: 3}"),
        ("# tank 3\nt;glucose [g/L]\n0;1.5\n1;2.5\n", "glucose", r"column 'glucose'. Did you mean `glucose \[g/L\]`"),
        ("t;glucose [g/L]\n0;1.5\n1;2.5\n", "Glucose", r"Did you mean `glucose \[g/L\]`"),
        # not what has the same unit, nor what is as long
        ("t;time [C];temp [K];pump in rpm\n0;1;2;3\n1;2;3;4\n", "tmp [C]", r"Did you mean `temp \[K\]`"),
        ("t;temp [K];temp [C];hemp [F]\n0;1;2;3\n1;2;3;4\n", "tempp [C]", r"Did you mean `temp \[C\]`"),
        ("t;flow in l/min;pump in rpm\n0;1;2\n1;2;3\n", "pmp in l/min", "Did you mean `pump in rpm`"),
    ],
)
def test_a_column_that_is_not_found_is_looked_for(tmp_path: Path, content: str, column: str, message: str) -> None:
    with pytest.raises(Problem, match=message):
        recorded(tmp_path, content, {"outputs": {"S": column}})
