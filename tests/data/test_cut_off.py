"""Files that end inside their last number, and quotes that open in the header and take in rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import LOG, recorded

from hgorun.config.yaml_source import Source
from hgorun.data.csv.cut_off import is_cut, unfinished_line
from hgorun.errors import ConfigError
from hgorun.estimate.log import log_of

VALUES = np.random.default_rng(3).normal(20, 1, 40).round(3)
FIXED = [f"{v:.3f}" for v in VALUES]
SHORT = [repr(float(v)) for v in VALUES.round(1)]


def log(cells: list[str], last: str, end: str = "") -> str:
    return "t;glucose\n" + "".join(f"{k};{cell}\n" for k, cell in enumerate(cells)) + f"{len(cells)};{last}{end}"


@pytest.mark.parametrize("last", ["2", "22", "22.", "22.4", "22.42"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_a_last_number_that_is_cut_off_is_told_and_left_out(
    tmp_path: Path, last: str, encoding: str, decimal: str
) -> None:
    text = log(FIXED, last).replace(".", decimal)
    found = recorded(tmp_path, text.encode(encoding), {"csv": {"decimal": decimal}})
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)
    cell = last.replace(".", decimal)
    said = (
        f"the file ends in this line, and {cell!r} has fewer decimals than all others of 'glucose': it is taken as cut "
        "off, and left out; an end of the line behind it says that it is not"
    )
    assert [(note.line, note.message) for note in found.notes if note.kind == "format"] == [(42, said)]


@pytest.mark.parametrize(
    ("cells", "last", "end"),
    [
        (FIXED, "22.424", ""),
        (FIXED, '"22.4"', ""),
        (FIXED, "22.4", "\n"),
        (FIXED, "22.4", "\r\n"),
        (FIXED, "22.4", "\n# the end"),
        (FIXED, "22.4", "\n  "),
        (FIXED[:5], "22.4", ""),
        (SHORT, "22.0", ""),
        ([f"{v:g}" for v in VALUES], "22.4", ""),  # as short as they can be
        ([str(round(v)) for v in VALUES], "22", ""),
        ([*FIXED[:20], "21", *FIXED[20:]], "22.4", ""),
        ([f"{20 + (k % 9 + 1) / 10:g}" for k in range(25)], "22", ""),
    ],
)
def test_a_last_line_without_an_end_is_healthy(tmp_path: Path, cells: list[str], last: str, end: str) -> None:
    found = recorded(tmp_path, log(cells, last, end))
    np.testing.assert_array_equal(found.outputs["S"].values, [*map(float, cells), float(last.strip('"'))])
    assert not [note for note in found.notes if "ends in this line" in note.message]


def test_a_last_number_that_is_missing_is_none(tmp_path: Path) -> None:
    found = recorded(tmp_path, log(FIXED, ""))
    assert not [note for note in found.notes if "ends in this line" in note.message]


def test_a_time_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    text = "glucose;t\n" + "".join(f"{v};{k}.250\n" for k, v in enumerate(VALUES)) + "22.4;40.2"
    with pytest.raises(ConfigError, match=r":42: .* '40.2' has fewer decimals .* take this line out"):
        recorded(tmp_path, text)


@pytest.mark.parametrize(
    ("cell", "others", "cut"),
    [
        ("2", ["2.5", "3.0"] * 5, True),
        ("2", ["2.5", "3.5"] * 5, False),  # whole by chance
        ("2.", ["2.25", "3.5"] * 5, True),
        ("2", ["2.125", "3.5"] * 5, True),
        ("2", ["2.12", "3.5"] * 5, False),  # of a hundred numbers with two decimals one is whole
        ("0", ["2.125", "3.5"] * 5, False),  # off
        ("0", ["2.125", "3.500"] * 5, True),
        ("2.5E", ["2.5E+01"] * 10, False),  # there it is refused as no number
        ("2.50E+0", ["2.50E+00", "2.50E+01"] * 5, True),
        ("2.5", ["2.51"] * 10, False),
        ("2.5", ["2.51"] * 30, True),
        ("x", ["2.50"] * 30, False),
    ],
)
def test_how_a_column_is_written_decides(cell: str, others: list[str], cut: bool) -> None:
    assert is_cut(cell, others) == cut


def test_what_stands_behind_the_last_end_of_a_line(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for encoding in ("utf-8", "utf-16-be", "utf-32-le"):
        path.write_bytes("1\r2".encode(encoding))
        assert unfinished_line(path) == "2"
        path.write_bytes("1\r2\r".encode(encoding))
        assert not unfinished_line(path)


@pytest.mark.parametrize("end", ['"', 'x"', ',"'])
def test_a_quote_of_the_header_that_takes_in_rows_is_refused(tmp_path: Path, end: str) -> None:
    rows = [f"{k},{v},ok" for k, v in enumerate(FIXED)]
    rows[4] = rows[4].removesuffix("ok").rstrip(",") + "," * (end[0] != ",") + end
    with pytest.raises(ConfigError, match=r":1: a quote that opens in this header closes on line 6, and line 2 in it"):
        recorded(tmp_path, "\n".join(['t,glucose,"note', *rows, ""]))


def test_a_name_over_several_lines_is_one(tmp_path: Path) -> None:
    rows = [f"{k},{v},ok" for k, v in enumerate(FIXED)]
    found = recorded(
        tmp_path, "\n".join(['t,"glucose\n(0.5, 1.5)\nm",note', *rows, ""]), {"outputs": {"S": "glucose (0.5, 1.5) m"}}
    )
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)


def test_a_file_that_is_held_out_is_told_of_as_the_log(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(log(FIXED, "22.424", "\n"))
    (tmp_path / "rest.csv").write_text(log(FIXED, "2").replace(";", ".5;").replace("t.5", "t"))
    plant = {"states": ["a"], "dynamics": {"a": "0"}, "output": {"S": "a"}}
    opened = log_of(Source({"plant": plant, "data": LOG}, {}), tmp_path / "log.yaml")
    found, held = opened.held_out(opened.read(), "S", tmp_path / "rest.csv")
    np.testing.assert_array_equal(held.values, VALUES)
    told = [note for note in found.notes if note.file.endswith("rest.csv")]
    assert any(note.line == 42 and "the file ends in this line" in note.message for note in told)
