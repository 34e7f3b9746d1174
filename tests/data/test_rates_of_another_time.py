"""Columns whose names say that they are per another unit of time than the model, which has no unit for them."""

from __future__ import annotations

from pathlib import Path

import pytest
from logs import recorded

from hgorun.data.units.denominators import per_unit_of


@pytest.mark.parametrize(
    ("unit", "time", "found"),
    [
        ("1/h", "s", "1/s"),
        ("1/h", "h", ""),
        ("1/hour", "h", ""),  # the same in another notation
        ("1/h", "-", ""),  # of a model that says nothing of its time
        ("g/L/h", "min", "g/L/min"),
        ("km/h", "s", "km/s"),
        ("m/s^2", "h", "m/h^2"),
        ("m/s/s", "h", "m/h/h"),
        ("m s^-1 s^-1", "min", "m min^-1 min^-1"),
        ("m/(s s)", "h", "m/(h h)"),
        ("h^-1", "s", "s^-1"),
        ("h-1", "s", "s-1"),
        ("d⁻¹", "h", "h⁻¹"),
        ("h", "s", ""),  # no rate
        ("mg/L", "s", ""),
    ],
)
def test_what_is_per_another_unit_of_time(unit: str, time: str, found: str) -> None:
    assert per_unit_of(unit, time) == found


@pytest.mark.parametrize(
    ("changes", "units", "told"),
    [
        ({}, {}, 1),
        ({}, {"S": "1/h"}, 0),  # as the message says
        ({"unit": "1/h"}, {"S": "1/s"}, 0),
    ],
)
def test_a_remark_tells_what_would_be_right(
    tmp_path: Path, changes: dict[str, str], units: dict[str, str], told: int
) -> None:
    column = {"column": "S [1/h]", **changes}
    found = recorded(tmp_path, "t,S [1/h]\n0,7200\n1,3600\n", {"outputs": {"S": column}}, time_unit="s", units=units)
    assert found.outputs["S"].values.tolist() == ([2.0, 1.0] if changes else [7200.0, 3600.0])
    assert len(found.notes) == told
    if told:
        remark = found.notes[0].message
        assert "its name says 1/h, and the model, whose time is in s, has no unit for S: taken as they are" in remark
        assert "plant.units: {S: 1/h} says that this is right" in remark
        assert "plant.units: {S: 1/s} and data.outputs.S.unit: 1/h convert" in remark
