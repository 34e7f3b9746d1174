"""Rows of several signals, each with the name of its own, are not read as one signal without a word."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import recorded

from hgorun.errors import ConfigError

Row = tuple[str, float]
NOISE = np.random.default_rng(4).normal(size=200)


def in_turn(*names: str, levels: Sequence[float] = (5.0, 80.0, 3e5)) -> list[Row]:
    """Slow signals, a row of each in turn."""
    return [(name, level * (1 + 0.002 * k)) for k in range(20) for name, level in zip(names, levels, strict=False)]


def log(column: str, rows: Sequence[Row], more: Callable[[int], str] = lambda _: "", header: str = "") -> str:
    lines = [f"{k},{name},{value:.5g}{more(k)}" for k, (name, value) in enumerate(rows)]
    return f"t,{column},glucose{header}\n" + "\n".join(lines)


def told(folder: Path, content: str, changes: dict[str, Any] | None = None) -> list[str]:
    return [note.message for note in recorded(folder, content, changes).notes]


SELDOM = [("TT" if k % 30 == 29 else "LT", (80 if k % 30 == 29 else 5) + 0.01 * k) for k in range(200)]

VERY_SELDOM = [("TT", 80 + 0.01 * k) if k % 1000 == 0 and k else ("LT", 5 + 0.001 * (k % 7)) for k in range(3500)]
ALIKE = [("LC101.SP" if k % 2 else "LC101.PV", 5 + 0.02 * y) for k, y in enumerate(NOISE[:60])]


@pytest.mark.parametrize(
    ("content", "line", "names"),
    [
        (log("tag", in_turn("LT", "TT")), 3, "'tag' names (LT, TT)"),
        (log("tag", [(name, 5.0 if name == "LT" else 80.0) for name, _ in in_turn("LT", "TT")]), 3, "(LT, TT)"),
        (log("Tag Name", in_turn("LT", "TT", "PT")), 3, "'Tag Name' names (LT, TT, PT)"),
        (log("VarName", in_turn(*"ABCDE", levels=[1, 9, 20, 40, 70])), 3, "(A, B, C and 2 more)"),
        (log("sensor_id", in_turn("4711-A", "4711-B")), 3, "(4711-A, 4711-B)"),
        (log("signal", SELDOM), 31, "(LT, TT)"),
        (log("signal", VERY_SELDOM), 2002, "(LT, TT)"),  # near the largest steps
        (log("point", in_turn("LT", "TT"), lambda k: f",{7 * k % 5},{'m' if k % 2 else 'K'}", ",x,unit"), 3, "LT, TT"),
    ],
)
def test_a_column_of_names_tells_that_rows_are_of_several_signals(
    tmp_path: Path, content: str, line: int, names: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, content)
    said = str(caught.value)
    assert f"log.csv:{line}: outputs.S: rows are of several signals, which " in said
    assert names in said


def test_what_is_said_takes_the_rows_of_one_or_of_all(tmp_path: Path) -> None:
    content = log("tag", in_turn("LT", "TT"))
    with pytest.raises(ConfigError, match=r'quality: \{column: "tag", good: \["LT"\]\} takes those of one, and good w'):
        recorded(tmp_path, content)
    of_one, of_all = ({"quality": {"column": "tag", "good": good}} for good in (["LT"], ["LT", "TT"]))
    for more, count in ((of_one, 20), (of_all, 40), ({"plausible": [0, 30]}, 20)):
        column = {"column": "glucose", **more}
        assert recorded(tmp_path, content, {"outputs": {"S": column}}).outputs["S"].values.size == count


def test_an_input_has_rows_of_its_own(tmp_path: Path) -> None:
    column = {"column": "glucose", "quality": {"column": "tag", "good": ["LT"]}}
    with pytest.raises(ConfigError, match=r"inputs\.F: rows are of several .* an input needs a file with its own rows"):
        recorded(tmp_path, log("tag", in_turn("LT", "TT")), {"outputs": {"S": column}, "inputs": {"F": "glucose"}})


@pytest.mark.parametrize(
    "content",
    [
        log("col2", in_turn("LT", "TT")),
        log("col2", in_turn("LT", "TT"), lambda k: f",{'m' if k % 2 else 'K'},192,{k}", ",unit,quality,ms"),
        log("unit", in_turn("m", "degC")),
        log("channel", in_turn("1", "2")),
        log("tag", ALIKE),
    ],
)
def test_names_in_a_column_that_is_called_otherwise_or_of_like_values_are_told(tmp_path: Path, content: str) -> None:
    (said,) = told(tmp_path, content)
    assert said.startswith("rows may be of several signals, which ")


ON = [("on" if k % 2 else "off", 2.0 if k % 2 else 0.02) for k in range(60)]
SLOW = 20 + np.sin(np.arange(90) / 3) + 0.1 * NOISE[:90]


@pytest.mark.parametrize(
    "content",
    [
        log("state", [("A" if k % 2 else "B", y) for k, (_, y) in enumerate(ON)]),
        log("col2", ON),
        log("tag", [("LT", y) for y in SLOW]),
        log("operator", [("Meier" if k // 9 % 2 else "Huber", y) for k, y in enumerate(SLOW)]),
        log("device", [("R1" if k // 9 % 2 else "R2", y) for k, y in enumerate(SLOW)]),  # reads one signal
        log("quality", [("Bad", 0.0) if k % 7 == 3 else ("Good", y) for k, y in enumerate(SLOW)]),
        log("unit", [("g/L", y) for y in SLOW]),
        log("batch id", [(f"B{k // 30}", y + 40 * (k // 30)) for k, y in enumerate(SLOW)]),
        log("col2", [("P1" if k % 2 else "P2", y) for k, y in enumerate(SLOW)]),
        log("col2", in_turn("P1", "P2"), lambda k: f",{7 * k % 5}", ",level"),  # something else is measured there
        log("tag", [("", y) if k % 2 else ("LT", y) for k, y in enumerate(SLOW)]),
        log("tag", [("LT", 5.0), ("TT", 80.0), ("LT", 5.1), ("PT", 1.0)]),  # too few to say so
    ],
)
def test_words_that_name_no_signal_are_not_told(tmp_path: Path, content: str) -> None:
    assert told(tmp_path, content, {"faults": {"slips": "report"}}) == []


def test_signals_one_below_the_other_are_told_where_the_next_one_begins(tmp_path: Path) -> None:
    rows = [f"{k},{name},{level + 0.1 * k:g}" for name, level in (("LT", 5), ("TT", 80)) for k in range(400)]
    content = "t,tag,glucose\n" + "\n".join(rows)
    right = r'log\.csv:402: .* lies before one above it; rows may be .* good: \["LT"\]\} takes those of one; faults'
    with pytest.raises(ConfigError, match=right):
        recorded(tmp_path, content)
    with pytest.raises(ConfigError, match=r"lies before one above it, as if another log began, or another signal"):
        recorded(tmp_path, content.replace(",TT,", ",LT,"))


def test_a_stamp_that_comes_again_in_another_part_is_of_the_same_signal(tmp_path: Path) -> None:
    rows = [f"{k},{name},{k}\n" for k, name in enumerate(["LT"] * 8 + ["TT"] * 8)]
    for name, part in (("one.csv", rows[:12]), ("two.csv", rows[11:])):
        (tmp_path / name).write_text("t,col2,glucose\n" + "".join(part))
    with pytest.raises(ConfigError, match=r"line 13 of .*one\.csv; faults: \{repeated: first\}"):
        recorded(tmp_path, "", {"file": ["one.csv", "two.csv"]})


def test_a_parquet_table_of_several_signals(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow.parquet import write_table

    rows = in_turn("LT", "TT")
    names = pyarrow.array([name for name, _ in rows]).dictionary_encode()
    columns = {"t": np.arange(40.0), "tag": names, "glucose": [y for _, y in rows], "list": [[1.0]] * 40}
    write_table(pyarrow.table(columns), tmp_path / "log.parquet")
    with pytest.raises(ConfigError, match=r"log\.parquet:2: outputs\.S: rows are of several signals, which 'tag'"):
        recorded(tmp_path, "", {"file": "log.parquet"})
