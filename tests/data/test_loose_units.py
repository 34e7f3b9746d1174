"""A unit of another kind without brackets in the name of a column is told; what may as well be a word is not."""

from __future__ import annotations

from pathlib import Path

import pytest
from logs import recorded

from hgorun.data.units.loose_units import remark_on_name


@pytest.mark.parametrize(
    ("name", "wanted", "said"),
    [
        ("cA mg/L", "mol/L", "mg/L"),
        ("cA_mg/L", "mol/L", "mg/L"),
        ("cA / mg/L", "mol/L", "mg/L"),
        ("cA, mg L-1", "mol/L", "mg L-1"),
        ("cA mmol", "mol/L", "mmol"),
        ("flux_kg/m2/s", "mol/L", "kg/m2/s"),
        ("q m3/h", "m", "m3/h"),
        ("v_m/s", "m", "m/s"),
        ("v_ms", "m/s", "ms"),
        ("level_mA", "m", "mA"),
        ("level_%", "m", "%"),
        ("T °C", "Pa", "°C"),
        ("level_meters", "Pa", "meters"),
        ("wind 10 m", "m/s", ""),
        ("c mol/L", "mol/L", ""),
        ("n U/min", "rpm", ""),
        ("n 1/min", "m", "1/min"),
        ("air/fuel", "m", ""),
        ("valve A/B", "m", ""),
        ("tank_V", "m", ""),
        ("x_bar", "mol/L", ""),
        ("T_sec", "degC", ""),
        ("flow_in", "m^3/s", ""),
        ("level_MV", "m", ""),
        ("c mg/L", "cells", ""),
        ("level_mA (raw)", "m", ""),
    ],
)
def test_a_unit_of_another_kind(name: str, wanted: str, said: str) -> None:
    of = f"column {name!r}: its name may say {said}, the model has {wanted}, of another kind: taken as they are"
    assert remark_on_name(name, wanted) == (of if said else "")


@pytest.mark.parametrize(("column", "unit", "notes"), [("cA mg/L", None, 1), ("cA mg/L", "mol/L", 0), ("cA", None, 0)])
def test_it_is_told_of_a_log_unless_the_configuration_says_the_unit(
    tmp_path: Path, column: str, unit: str | None, notes: int
) -> None:
    output = {"column": column, **({} if unit is None else {"unit": unit})}
    found = recorded(tmp_path, f"t,{column}\n0,1\n1,0.5\n", {"outputs": {"S": output}}, units={"S": "mol/L"})
    assert [note.kind for note in found.notes] == ["units"] * notes
    assert found.outputs["S"].values.tolist() == [1, 0.5]
