"""A log in several files has one name and one unit for a column; what is read beside it has a key of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording
from hgorun.errors import Problem

FIRST, SECOND = "t,level\n0,1\n1,2\n2,3\n", "t,level\n3,4\n4,5\n5,6\n"


def parts(
    folder: Path,
    contents: Mapping[str, str],
    outputs: Mapping[str, Any],
    changes: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> Recording:
    """What is read of files with these contents, in m where nothing else is said."""
    for name, content in contents.items():
        (folder / name).write_text(content)
    block: dict[str, Any] = {"file": list(contents), "time": "t", "outputs": outputs}
    return read(
        Data.model_validate({**block, **(changes or {})}),
        folder,
        units={"h": "m", "g": "m"} if units is None else units,
    )


def with_units(log: str, time: str, level: str) -> str:
    return log.replace("t,level\n", f"t,level\n{time},{level}\n")


def test_files_in_one_unit_are_read(tmp_path: Path) -> None:
    contents = {"a.csv": with_units(FIRST, "s", "mm"), "b.csv": with_units(SECOND, "s", "millimeters")}
    found = parts(tmp_path, contents, {"h": {"column": "level", "unit": "mm"}})
    np.testing.assert_allclose(found.outputs["h"].values, np.arange(1, 7) / 1000, rtol=1e-15)
    assert not found.notes


@pytest.mark.parametrize("unit", [None, "m", "mm"])
@pytest.mark.parametrize(("first", "second"), [("m", "mm"), ("mm", "m"), ("bar(a)", "mbar")])
def test_files_in_two_units_are_refused_whatever_the_key_says(
    tmp_path: Path, first: str, second: str, unit: str | None
) -> None:
    """Either unit would be wrong for one of them."""
    contents = {"a.csv": with_units(FIRST, "s", first), "b.csv": with_units(SECOND, "s", second)}
    told = rf"a\.csv says {re.escape(first)} and .*b\.csv {second}, and a unit is that of all files"
    with pytest.raises(Problem, match=told):
        parts(tmp_path, contents, {"h": {"column": "level"} | ({"unit": unit} if unit else {})})


ANOTHER_ZERO = [
    ("bar", "barg"),
    ("barg", "bar(a)"),
    ("kPa", "barg"),
    ("barg", "m"),
    ("psia", "psig"),
    ("mbar", "mbar diff"),
    ("m3/h", "Nm3/h"),
    ("Sm3/h", "m3(n)/h"),
    ("L/min", "slpm"),
    ("scfm", "cfm"),
    ("m^3(NTP)/h", "Nm3/h"),
]


@pytest.mark.parametrize("units", [None, "bar", "m3/h"])
@pytest.mark.parametrize(("first", "second"), ANOTHER_ZERO)
def test_so_are_two_zeros_of_a_pressure_and_two_conditions_of_a_volume(
    tmp_path: Path, first: str, second: str, units: str | None
) -> None:
    contents = {"a.csv": with_units(FIRST, "s", first), "b.csv": with_units(SECOND, "s", second)}
    told = rf"a\.csv says {re.escape(first)} and .*b\.csv {re.escape(second)}, and a unit is that of all files"
    with pytest.raises(Problem, match=told):
        parts(tmp_path, contents, {"h": "level"}, units={"h": units} if units else {})


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("barg", "bar(g)"),
        ("bar rel", "BARG"),
        ("bara", "bar abs."),
        ("Nm3/h", "m3/h i.N."),
        ("Sm3/h", "m3(STP)/h"),
        ("slpm", "SLPM"),
        ("lpm", "L/min"),
    ],
)
def test_one_of_them_in_two_notations_is_one_unit(tmp_path: Path, first: str, second: str) -> None:
    contents = {"a.csv": with_units(FIRST, "s", first), "b.csv": with_units(SECOND, "s", second)}
    assert parts(tmp_path, contents, {"h": "level"}, units={}).outputs["h"].values.size == 6


def test_labels_that_nobody_knows_are_told_for_each_file(tmp_path: Path) -> None:
    contents = {"a.csv": with_units(FIRST, "s", "Skt"), "b.csv": with_units(SECOND, "s", "Raw")}
    told = [note.message for note in parts(tmp_path, contents, {"h": "level"}).notes]
    assert ["Skt" in told[0], "Raw" in told[1], len(told)] == [True, True, 2]


def test_a_file_that_says_no_unit_has_a_word(tmp_path: Path) -> None:
    contents = {"a.csv": FIRST, "b.csv": with_units(SECOND, "s", "mm")}
    with pytest.raises(Problem, match=r"converts.*; unit is that of all files, and .*a\.csv says none"):
        parts(tmp_path, contents, {"h": "level"})
    (note,) = parts(tmp_path, contents, {"h": {"column": "level", "unit": "mm"}}).notes
    assert Path(note.file).name == "a.csv"
    assert re.fullmatch(r"column 'level': no unit is said here, and .*b\.csv says mm: taken in mm, too", note.message)
    assert not parts(tmp_path, contents | {"b.csv": with_units(SECOND, "s", "m")}, {"h": "level"}).notes


@pytest.mark.parametrize("time", ["t", {"column": "t", "unit": "min"}])
def test_so_it_is_with_units_of_time(tmp_path: Path, time: Any) -> None:
    contents = {"a.csv": with_units(FIRST, "s", "m"), "b.csv": with_units(SECOND, "min", "m")}
    with pytest.raises(Problem, match=r"column 't': .*a\.csv says s and .*b\.csv min, and a unit is that of all"):
        parts(tmp_path, contents, {"h": "level"}, {"time": time})


@pytest.mark.parametrize("name", ["Level", "level [mm]", "LEVEL (m)", "level in mm", "level_mm"])
def test_a_column_by_another_spelling_is_not_lost(tmp_path: Path, name: str) -> None:
    contents = {"a.csv": FIRST, "b.csv": SECOND.replace("level", f'"{name}"')}
    with pytest.raises(Problem, match=r"b\.csv has .* where .*a\.csv has 'level'") as caught:
        parts(tmp_path, contents, {"h": "level"})
    assert caught.value.path == ("data", "outputs", "h", "column")


def test_nor_is_it_beside_a_column_that_is_read(tmp_path: Path) -> None:
    two = "t,level,other\n3,4,1\n4,5,1\n"
    contents = {"a.csv": two.replace("3,", "0,").replace("4,5", "1,5"), "b.csv": two.replace("level", "Level")}
    with pytest.raises(Problem, match=r"has 'Level' where .* has 'level': .* file: below outputs.h names the file"):
        parts(tmp_path, contents, {"h": "level", "g": "other"})


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("level_m", "level_mm"),
        ("level_mm", "level"),
        ("level in m", "level in mm"),
        ("T_C", "T_F"),
        ("T, K", "T, °C"),
        ("q_m3/h", "q_m3/s"),
        ("p_bar", "p_barg"),
        ("p_kPag", "p_bar"),
    ],
)
def test_nor_with_another_unit_behind_its_name(tmp_path: Path, first: str, second: str) -> None:
    two = "t,level,other\n0,4,1\n1,5,1\n"
    contents = {"a.csv": two.replace("level", f'"{first}"'), "b.csv": two.replace("level", f'"{second}"')}
    with pytest.raises(Problem, match="a log in parts has one name for it in all of them"):
        parts(tmp_path, contents, {"h": first, "g": "other"})


@pytest.mark.parametrize(
    ("first", "second"), [("x_d", "x_s"), ("x_1", "x_2"), ("level_m", "level_V"), ("tank_m", "level_mm"), ("a", "b")]
)
def test_other_ends_of_names_are_other_columns(tmp_path: Path, first: str, second: str) -> None:
    contents = {"a.csv": f"t,{first},other\n0,4,1\n1,5,1\n", "b.csv": f"t,{second},other\n2,4,1\n3,5,1\n"}
    (note,) = parts(tmp_path, contents, {"h": first, "g": "other"}, units={}).notes
    assert note.message == f"no column {first!r}: read from other files alone"


@pytest.mark.parametrize("name", ["level2", "level 2", "level_s", "levels"])
def test_another_column_is_none(tmp_path: Path, name: str) -> None:
    contents = {"a.csv": FIRST, "b.csv": f"t,{name},other\n3,1,2\n4,2,3\n5,3,5\n"}
    assert not parts(tmp_path, contents, {"h": "level", "g": "other"}).notes


def test_a_file_of_which_nothing_is_read_is_refused(tmp_path: Path) -> None:
    contents = {"a.csv": FIRST, "b.csv": SECOND.replace("level", "levels")}
    with pytest.raises(Problem, match=r"b\.csv has none of the columns that are read: 'level'\. Did you mean `levels`"):
        parts(tmp_path, contents, {"h": "level"})


def test_a_column_that_ends_with_a_part_has_a_word(tmp_path: Path) -> None:
    contents = {"a.csv": "t,level,other\n0,1,2\n1,2,3\n2,3,5\n", "b.csv": "t,other\n3,6\n4,8\n5,11\n"}
    (note,) = parts(tmp_path, contents, {"h": "level", "g": "other"}).notes
    assert (Path(note.file).name, note.signal, note.kind) == ("b.csv", "outputs.h", "format")
    assert note.message == "no column 'level': read from other files alone"


def test_files_with_columns_of_their_own_are_no_parts_of_one_table(tmp_path: Path) -> None:
    contents = {"a.csv": FIRST, "b.csv": "t,other\n0.5,6\n1.5,8\n2.5,11\n"}
    assert not parts(tmp_path, contents, {"h": "level", "g": "other"}).notes
    own = {"h": {"column": "level", "file": "a.csv"}, "g": {"column": "other", "file": "b.csv"}}
    assert not parts(tmp_path, contents, own, {"file": "a.csv"}).notes


@pytest.mark.parametrize(("unit", "row"), [(None, "s,mm"), ("cm", "s,mm"), (None, "min,m")])
def test_advice_of_a_file_beside_a_log_is_of_that_file(tmp_path: Path, unit: str | None, row: str) -> None:
    (tmp_path / "lab.csv").write_text(f"t,level\n{row}\n1,2000\n2,3000\n")
    output = {"column": "level", "file": "lab.csv"} | ({"unit": unit} if unit else {})
    block = {"time": "t", "outputs": {"h": output}}
    with pytest.raises(Problem, match=r"converts") as caught:
        read(Data.model_validate(block), tmp_path, units={"h": "m"}, reference='data.reference: {h: {file: "lab.csv"')
    advised = re.search(r"data\.reference: \{.*?\}\}+ converts", caught.value.message)
    assert advised is not None
    key = yaml.safe_load(advised[0].removesuffix(" converts"))["data.reference"]
    found = read(Data.model_validate({"time": "t", "outputs": key}), tmp_path, units={"h": "m"}).outputs["h"]
    in_time, in_level = (row == "min,m", row == "s,mm")
    np.testing.assert_allclose(found.values, np.array([2000, 3000]) / (1000 if in_level else 1), rtol=1e-15)
    np.testing.assert_allclose(found.taken, np.array([1, 2]) * (60 if in_time else 1), rtol=1e-15)


@pytest.mark.parametrize(("unit", "notes"), [("m", 0), ("metre", 0), ("mm", 1)])
def test_who_states_the_unit_of_the_model_is_told_of_no_silent_file(tmp_path: Path, unit: str, notes: int) -> None:
    contents = {"a.csv": FIRST, "b.csv": with_units(SECOND, "s", unit)}
    assert len(parts(tmp_path, contents, {"h": {"column": "level", "unit": unit}}).notes) == notes


def test_where_an_input_ends_is_said_with_the_part_that_it_ends_in(tmp_path: Path) -> None:
    rows = [f"{t},{t + 1}," for t in range(60)]
    contents = {"a.csv": "\n".join(["t,level,u", *(row + "1" for row in rows[:30])]) + "\n"}
    contents["b.csv"] = "\n".join(["t,level,u", rows[30] + "1", *rows[31:]]) + "\n"
    found = parts(tmp_path, contents, {"h": "level"}, {"inputs": {"u": "u"}})
    (note,) = (note for note in found.notes if note.message.startswith("its values end"))
    assert (Path(note.file).name, note.line) == ("b.csv", 2)
