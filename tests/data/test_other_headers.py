"""Headers below the header: of a logger that was restarted with other columns or units."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import noisy, recorded

from hgorun.errors import ConfigError

TIMES, VALUES = noisy(40)
ROWS = [f"{t!r},{v!r},{v / 2!r}" for t, v in zip(TIMES.tolist(), VALUES.tolist(), strict=True)]


def restarted(first: list[str], again: list[str], separator: str = ",") -> str:
    return "\n".join([*first, *ROWS[:20], *again, *ROWS[20:], ""]).replace(",", separator)


@pytest.mark.parametrize(
    ("first", "again", "line"),
    [
        (["# t,glucose,temp"], ["# t,temp,glucose"], 22),
        (["t,glucose,temp"], ["# t,temp,glucose"], 22),
        (["t,glucose,temp"], ["#t,temp,glucose"], 22),
        (["t,glucose,temp"], ["# restarted", "# t,flow,glucose"], 23),
        (["t,glucose,temp"], ["# t,flow,temp,"], 22),
        (["# t,glucose,temp", "# s,m,K"], ["# t,glucose,temp", "# s,mm,K"], 24),
        (["t,glucose,temp", "s,m,K"], ["# [s],[mm],[K]"], 23),
        (["# t,glucose,temp [K]"], ["# t,glucose,temp [degC]"], 22),
        (["t,glucose,temp"], ["t,temp,glucose"], 22),
        (["t,glucose,temp [K]"], ["t,glucose,temp [degC]"], 22),
    ],
)
@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("quoted", [False, True])
def test_another_header_is_refused_with_its_line(
    tmp_path: Path, first: list[str], again: list[str], line: int, separator: str, quoted: bool
) -> None:
    text = restarted(first, again, separator)
    if quoted:  # rows are read one by one
        number = ROWS[0].partition(",")[0]
        text = text.replace(number + separator, f'"{number}"{separator}', 1)
    with pytest.raises(ConfigError, match=rf":{line}: this (comment|line) is another header"):
        recorded(tmp_path, text)


@pytest.mark.parametrize("separator", [" ", "\t"])
def test_so_is_one_between_spaces(tmp_path: Path, separator: str) -> None:
    text = restarted(["# t,glucose,temp"], ["# t,temp,glucose"], separator).replace("# t\t", "# t ")
    with pytest.raises(ConfigError, match=":22: this comment is another header"):
        recorded(tmp_path, text, {"csv": {"separator": " "}})


@pytest.mark.parametrize(
    ("first", "again"),
    [
        (["# t,glucose,temp"], ["# t,glucose,temp"]),
        (["t,glucose,temp"], ["# t,glucose,temp,"]),
        (["# t,glucose,temp", "# s,m,K"], ["# t,glucose,temp", "# s,m,K"]),
        (["t,glucose,temp", "s,m,K"], ["# [s],[m],[K]"]),
        (["t,glucose,temp [K]"], ["# t,glucose,temp"]),
        (["t,glucose,temp"], ["# 1.5,2.5,3.5"]),
        (["t,glucose,temp"], ["# pump off, valve open, glucose low"]),
        (["t,glucose,temp"], ["# glucose, calibrated, by J."]),
        (["t,glucose,temp", "s,m,K"], ["# ---,---,---"]),
        (["t,glucose,temp", "s,m,K"], ["# 5 m, 3 K, 1 s"]),
        (["t,glucose,temp"], ["# temp in K, glucose in g/L, t in s"]),
        (["t,glucose,temp"], ["# t, then feed, then stop"]),
        (["t,glucose,temp"], ["# t, glucose, temp ok"]),
        (["t,glucose,temp"], ["# glucose, t, ok"]),
        (["t,glucose,temp", "s,m,K"], ["# kg, g, A"]),
    ],
)
def test_equal_headers_and_other_comments_are_fine(tmp_path: Path, first: list[str], again: list[str]) -> None:
    found = recorded(tmp_path, restarted(first, again))
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)


@pytest.mark.parametrize("header", ["\ufefft,glucose,temp", '\ufeff"t","glucose","temp"'])
def test_a_header_of_a_file_that_was_joined_is_one(tmp_path: Path, header: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(":22: this line repeats the header: cut it out")):
        recorded(tmp_path, restarted(["t,glucose,temp"], [header]))


def test_words_with_the_name_of_the_times_are_no_header(tmp_path: Path) -> None:
    changes: dict[str, Any] = {"outputs": {"S": "glucose"}, "csv": {"separator": " "}}
    found = recorded(tmp_path, restarted(["t,glucose,temp"], ["# t was glucose"], " "), changes)
    np.testing.assert_array_equal(found.outputs["S"].values, VALUES)


def test_a_comment_with_fewer_cells_is_none(tmp_path: Path) -> None:
    number = ROWS[0].partition(",")[0]
    text = restarted(["t,glucose,temp"], ["# temp low"]).replace(number, f'"{number}"', 1)  # rows are read one by one
    np.testing.assert_array_equal(recorded(tmp_path, text).outputs["S"].values, VALUES)


@pytest.mark.parametrize(
    "note", ["# t, then level rises", "# t,stop", "# t, off", "# t,glucose low", "# glucose in g/L, t in s"]
)
def test_a_note_in_a_log_of_two_columns_is_no_header(tmp_path: Path, note: str) -> None:
    rows = [",".join(row.split(",")[:2]) for row in restarted(["t,glucose,temp"], [note]).splitlines() if row[0] != "#"]
    rows.insert(9, note)
    found = recorded(tmp_path, "\n".join([*rows, ""]), {"outputs": {"S": "glucose"}})
    assert found.outputs["S"].values.size == len(VALUES)
