"""What is told of signals that share a clock: each of its faults once, and times as they stand in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from logs import recorded

COLUMNS = "abcdefgh"


def rows(columns: str, scale: float = 1.0, empty: tuple[str, int] = ("", 0)) -> str:
    """A row every ten units of a clock: one stamp comes again, a later one is out of order, and then there is a gap."""
    stamps = [10.0 * k + (900 if k >= 30 else 0) for k in range(60)]
    stamps[6], stamps[20] = stamps[5], stamps[19] - 5
    text = "t," + ",".join(columns) + "\n"
    for k, stamp in enumerate(stamps):
        values = ["" if empty == (name, k) else str(20 + (k * (7 + place)) % 17) for place, name in enumerate(columns)]
        text += f"{stamp * scale:g}," + ",".join(values) + "\n"
    return text


def told(folder: Path, columns: str, changes: dict[str, Any], **options: Any) -> list[str]:
    block = {"outputs": {name: name for name in columns}, "faults": {"backwards": "sort", "repeated": "mean"}} | changes
    notes = recorded(folder, rows(columns, **options), block).notes
    return [str(note).removeprefix(str(folder / "log.csv")) for note in notes]


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1), ("s", 1), ("min", 0.1)])
def test_faults_of_a_clock_are_told_once_in_its_unit(tmp_path: Path, unit: str, scale: float) -> None:
    changes = {"time": {"column": "t", "unit": unit}, "inputs": {"c": "c"}, "outputs": {"a": "a", "b": "b"}}
    who = "outputs.a, outputs.b, inputs.c"
    gap, late, again = (f"{number * scale:g} {unit}" for number in (910, 185, 50))
    assert told(tmp_path, "abc", changes, scale=scale) == [
        f":22: {who}: 1 sample sorted by time: the time stamp {late} lies before one above it",
        f":8: {who}: 1 sample (mean): the time stamp {again} has come before, on line 7",
        f":32: {who}: the time stamps jump by more than 20 usual steps, at most by {gap}; "
        "an input's last value is held meanwhile, or with hold: linear a straight line goes to the next",
    ]


def test_a_fault_of_one_signal_is_its_own(tmp_path: Path) -> None:
    """A signal without a value in the row before a gap has a longer one, and its row is not the others'."""
    found = told(tmp_path, "abc", {}, empty=("b", 29))
    assert [one for one in found if "jump" in one] == [
        ":32: outputs.a, outputs.c: the time stamps jump by more than 20 usual steps, at most by 910 s",
        ":32: outputs.b: the time stamps jump by more than 20 usual steps, at most by 920 s",
    ]


def test_of_many_signals_the_first_are_named(tmp_path: Path) -> None:
    found = told(tmp_path, COLUMNS, {})
    names = "outputs.a, outputs.b, outputs.c, outputs.d, outputs.e, and 3 more"
    assert [one.split(": ")[1] for one in found] == [names] * 3
