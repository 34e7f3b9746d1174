"""Rows whose first cell begins as comments do: errors of spreadsheets and tags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import noisy, recorded

from hgorun.errors import ConfigError

TIMES, VALUES = noisy(40)
ROWS = [f"{t!r};{v!r}" for t, v in zip(TIMES.tolist(), VALUES.tolist(), strict=True)]


def log(cells: list[str], name: str = "flow") -> str:
    """A column with these cells, over and over, in front of the others."""
    every = (f"{cells[k % len(cells)]};{row}\n" for k, row in enumerate(ROWS))
    return f"{name};t;glucose\n" + "".join(every)


@pytest.mark.parametrize(
    "error",
    [
        "#DIV/0!",
        "#VALUE!",
        "#WERT!",
        "#REF!",
        "#NUM!",
        "#NV",
        "#NAME?",
        "#NULL!",
        "#BEZUG!",
        "########",
        "#¡VALOR!",
        "#Error",
        "#Div/0!",
        "#Deleted",
        "#NaN",
        "#N/A N/A",
    ],
)
@pytest.mark.parametrize("cells", [2, 3])
def test_a_row_that_begins_with_an_error_of_a_spreadsheet_is_read(tmp_path: Path, error: str, cells: int) -> None:
    first = ["1.5"] * cells
    for place in (0, 1):  # also in the first row
        signal = recorded(tmp_path, log([*first[:place], error, *first[place + 1 :]])).outputs["S"]
        np.testing.assert_array_equal(signal.taken, TIMES)
        np.testing.assert_array_equal(signal.values, VALUES)
        np.testing.assert_array_equal(signal.lines, np.arange(2, 42))


def test_such_an_error_in_place_of_a_time_is_told_with_its_line(tmp_path: Path) -> None:
    rows = [*ROWS[:20], "########;20.1", *ROWS[20:]]
    with pytest.raises(ConfigError, match=":22: t: expected a number, found '########'"):
        recorded(tmp_path, "t;glucose\n" + "\n".join(rows) + "\n")


@pytest.mark.parametrize("cells", [["red", "#ff0000"], ["A", "#2"]])
def test_tags_among_words_are_told_and_read(tmp_path: Path, cells: list[str]) -> None:
    found = recorded(tmp_path, log(cells, "colour"))
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)
    notes = [note for note in found.notes if note.kind == "format"]
    said = f"{cells[1]!r} begins this row, which is read, and so are 19 more such; a comment has a space behind its #"
    assert [(note.line, note.message) for note in notes] == [(3, said)]


@pytest.mark.parametrize(
    ("name", "cell", "comment"),
    [
        ("flow", "1.5", "#1.5"),  # a row that somebody has made a comment
        ("flow", "1.5", "#2"),
        ("state", "A2", "#A2"),
        ("state", "A2", "# A3"),
        ("state", "A2", "#note"),
        ("state", "A2", "#A7"),  # names that are counted on: each comes once
        ("month", "May 31 2024", "#May 30 2024"),
    ],
)
def test_a_row_that_is_made_a_comment_stays_one(tmp_path: Path, name: str, cell: str, comment: str) -> None:
    found = recorded(tmp_path, log([cell, comment], name))
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES[::2])


@pytest.mark.parametrize("line", ["#DIV/0!", "#### log; of 3", "########", "#N2 flow;1;2"])
def test_comments_with_other_cells_or_words_stay_comments(tmp_path: Path, line: str) -> None:
    text = log(["1.5"]).splitlines()
    found = recorded(tmp_path, "\n".join([*text[:9], line, *text[9:]]) + "\n")
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)


def test_words_between_spaces_are_a_comment(tmp_path: Path) -> None:
    text = log(["1.5"]).replace(";", " ").splitlines()
    found = recorded(tmp_path, "\n".join([*text[:9], "## of pump", *text[9:]]) + "\n")
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)
