"""Decimal commas in files separated by commas, whose header has a name for what stands behind the comma."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.errors import ConfigError

VALUES = 20 + np.random.default_rng(3).normal(size=60).round(3)
SPLIT = [f"{k},{v:.3f}".replace(".", ",") for k, v in enumerate(VALUES)]


def rows(cells: list[str], end: str = "") -> str:
    return "".join(f"{cell}{end}\n" for cell in cells)


@pytest.mark.parametrize(
    ("header", "end"), [("t,glucose,note", ","), ("t,glucose,", ""), ("t,glucose,note,", ","), ("t,glucose,flow", "")]
)
def test_numbers_in_two_columns_are_refused(tmp_path: Path, header: str, end: str) -> None:
    with pytest.raises(ConfigError, match=r':2: .*may be one number or two.*if they are two: csv: {decimal: "\."}'):
        recorded(tmp_path, f"{header}\n{rows(SPLIT, end)}")
    whole = recorded(tmp_path, f"{header}\n{rows(SPLIT, end)}", {"csv": {"decimal": "."}}).outputs["S"]
    np.testing.assert_array_equal(whole.values, np.floor(VALUES))


@pytest.mark.parametrize("header", ["t,glucose,comment", "t,glucose,"])
def test_decimals_without_zeros_in_front_are_refused_where_words_would_stand(tmp_path: Path, header: str) -> None:
    cells = [f"{k},20,{1 + k % 9}5" for k in range(30)]
    with pytest.raises(ConfigError, match="may be one number or two"):
        recorded(tmp_path, f"{header}\n{rows(cells)}")


@pytest.mark.parametrize(
    ("header", "cells"),
    [
        ("t,glucose,flow", [f"{k},{20 + k % 7},{100 + 37 * k % 900}" for k in range(60)]),  # whole numbers
        ("t,glucose,flow", [f"{k},{20 + k % 7},{k:03d}" for k in range(60)]),  # of one length
        ("t,glucose,state", [f"{k},{20 + k % 7},0{k % 3}" for k in range(60)]),
        ("t,glucose,ms", [f"{k},{20 + k % 7},{137 * k % 1000:03d}" for k in range(60)]),
        ("t,glucose,note", [f"{k},{20 + k % 7},{k % 3}" for k in range(60)]),  # codes
        ("t,glucose,", [f"{k},{20 + k % 7},1" for k in range(60)]),
        ("t,glucose,flow", [f"{k}.5,{20 + k % 7},{137 * k % 1000:03d}" for k in range(60)]),  # decimals have points
        ("t,glucose,flow", ["0,20,045", "1,21,104"]),
        ("t,glucose,label", [f"{k},{20 + k % 7},{k % 10}" for k in range(60)]),
        ("t,glucose,day", [f"{k},{20 + k % 7},{k % 31 + 1:02d}" for k in range(60)]),
        ("t,glucose,note", [f"{k},{20 + k % 7},{(3 + 7 * k) % 23 if k % 9 == 0 else ''}" for k in range(60)]),
        ("t,glucose,flow", [f"{k},{20 + k % 7}," for k in range(60)]),
        ("t,glucose", [f"{k},{20 + k % 7}" for k in range(60)]),
    ],
)
def test_columns_of_whole_numbers_are_read(tmp_path: Path, header: str, cells: list[str]) -> None:
    signal = recorded(tmp_path, f"{header}\n{rows(cells)}").outputs["S"]
    assert signal.values.tolist() == [float(row.split(",")[1]) for row in cells]


def test_columns_that_are_not_read_may_be_anything(tmp_path: Path) -> None:
    cells = [f"{k},{20 + k % 7},{row.partition(',')[2]}" for k, row in enumerate(SPLIT)]
    signal = recorded(tmp_path, f"t,glucose,a,b\n{rows(cells)}").outputs["S"]
    assert signal.values.size == len(cells)


POINTS = [f"{k}.0,{v:.3f},{v / 2:.4f}" for k, v in enumerate(VALUES)]


@pytest.mark.parametrize(("place", "row"), [(20, "20,5,20.1"), (0, "0,5,20.1")])
def test_a_single_row_of_whole_numbers_among_points_is_told(tmp_path: Path, place: int, row: str) -> None:
    cells = [*POINTS[:place], row, *POINTS[place + 1 :]]
    found = recorded(tmp_path, f"t,glucose,temp\n{rows(cells)}")
    said = [(note.line, note.message.partition(":")[0]) for note in found.notes if note.kind == "format"]
    assert said == [(place + 2, f"{place},5 in this row may be one number with a decimal comma")]


@pytest.mark.parametrize("row", ["20.0,21.000,5.1", "20,20.104,5.1", "20.0,21,5.1"])
def test_a_row_with_a_point_is_not(tmp_path: Path, row: str) -> None:
    found = recorded(tmp_path, f"t,glucose,temp\n{rows([*POINTS[:20], row, *POINTS[21:]])}")
    assert not [note for note in found.notes if note.kind == "format"]


def test_columns_of_whole_numbers_here_and_there_are_not(tmp_path: Path) -> None:
    cells = [f"{k},{20 + k % 4 / 2:g}" for k in range(60)]
    assert not recorded(tmp_path, f"t,glucose\n{rows(cells)}").notes
