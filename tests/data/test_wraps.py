"""Encoders that begin anew after a turn, where the model does not say so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import recorded, table

TIMES = np.round(np.arange(0.0, 20.0, 0.05), 3)
TURNING = np.round(np.rad2deg(3.0 * np.sin(0.5 * TIMES) + 4.0 * np.sin(0.13 * TIMES)), 3)


def told(folder: Path, values: np.ndarray, unit: str, said: str = "deg", **options: object) -> list[str]:
    changes = {"outputs": {"S": {"column": "glucose", "unit": said}}}
    notes = recorded(folder, table(TIMES, values), changes, units={"S": unit}, **options).notes
    return [f"{note.line} {note.message}" for note in notes if note.kind == "wraps"]


@pytest.mark.parametrize("low", [0.0, -180.0])
@pytest.mark.parametrize(("unit", "period"), [("rad", "2*pi"), ("deg", "360")])
def test_jumps_of_a_turn_are_told_with_the_key_that_takes_them(
    tmp_path: Path, low: float, unit: str, period: str
) -> None:
    values = np.mod(TURNING - low, 360) + low
    jumps = np.flatnonzero(np.abs(np.diff(values)) > 180)
    (found,) = told(tmp_path, values, unit)
    assert found.startswith(f"{jumps[0] + 3} the values jump {jumps.size} times by a whole turn")  # behind the header
    assert f"`period: {period}` of this output" in found
    assert told(tmp_path, values, unit, periods={"S": 2 * np.pi if unit == "rad" else 360.0}) == []


@pytest.mark.parametrize("unit", ["rad", "degF", "rad/s", ""])
def test_what_turns_on_or_is_no_angle_does_not_begin_anew(tmp_path: Path, unit: str) -> None:
    values = TURNING if unit == "rad" else np.mod(TURNING, 360)
    assert told(tmp_path, values, unit, unit or "deg") == []


def test_a_scanner_that_flies_back_makes_no_turn(tmp_path: Path) -> None:
    assert told(tmp_path, np.mod(40 * TIMES, 350), "deg") == []


def test_two_places_are_no_turn(tmp_path: Path) -> None:
    """Nor is noise over the whole range: without a jump its steps are as large."""
    assert told(tmp_path, np.where(np.mod(TIMES, 4) < 2, 5.0, 200.0) + np.mod(TIMES, 1.3), "deg") == []
    assert told(tmp_path, np.random.default_rng(1).uniform(0, 360, TIMES.size), "deg") == []
