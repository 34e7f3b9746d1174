"""Headers of several lines, or without a name for a column: what is said of them is right when it is followed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from logs import recorded

from hgorun.errors import ConfigError

ROWS = "0,1\n1,2\n2,4\n"
OF_R = [
    ('"t" "glucose"\n"1" 0 1.5\n"2" 1 2.5\n', '"" "t" "glucose"'),
    ("t glucose\nrow1 0 1.5\nrow2 1 2.5\n", "row t glucose"),
    ('"t"\t"glucose"\n"1"\t0\t1.5\n"2"\t1\t2.5\n', '""\t"t"\t"glucose"'),
    ('"t","glucose"\n"1",0,1.5\n"2",1,2.5\n', '"","t","glucose"'),
    ('"t";"glucose"\n"1";0;1.5\n"2";1;2.5\n', '"";"t";"glucose"'),
]


@pytest.mark.parametrize(("content", "header"), OF_R)
def test_names_of_rows_without_one_of_their_column(tmp_path: Path, content: str, header: str) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv:2: 3 cells, where the header has 2; where each row") as caught:
        recorded(tmp_path, content)
    assert caught.value.message.endswith("the header needs a name for that column, too (col.names = NA)")
    assert "decimal commas" not in caught.value.message
    named = recorded(tmp_path, header + "\n" + content.partition("\n")[2]).outputs["S"]
    assert (named.taken.tolist(), named.values.tolist()) == ([0, 1], [1.5, 2.5])


def test_further_down_a_row_has_no_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv:3: 3 cells, where the header has 2$"):
        recorded(tmp_path, "t;glucose\n0;1\n1;2;x\n")


def test_whole_numbers_may_be_either(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"decimal commas in a file .*; where each row begins with its name"):
        recorded(tmp_path, "t,glucose\n0,1,5\n1,2,5\n")


@pytest.mark.parametrize(
    ("above", "hint", "told", "values"),
    [
        (
            "t,glucose\nsampled,Reactor A\n",
            ":2: glucose: expected a number, found 'Reactor A'; if this line belongs to the header, as one of units "
            "does: csv: {units_row: true}; csv goes below data",
            ("t,glucose\nsampled,Reactor A\n", {"csv": {"units_row": True}}),
            [1, 2, 4],
        ),
        (
            "t,glucose\nsampled,Reactor A\ns,g/L\n",
            ":2: glucose: expected a number, found 'Reactor A'; if this line and the next belong to the header: "
            "begin them with #, as comments",
            ("t,glucose\n#sampled,Reactor A\n#s,g/L\n", {}),
            [1, 2, 4],
        ),
        (
            "t,glucose\ns,g/L\nsampled,Reactor A\n",
            ":3: glucose: expected a number, found 'Reactor A'; if this line belongs to the header: "
            "begin it with #, as a comment",
            ("t,glucose\ns,g/L\n#sampled,Reactor A\n", {}),
            [1, 2, 4],
        ),
    ],
)
def test_a_header_of_several_lines(
    tmp_path: Path, above: str, hint: str, told: tuple[str, dict[str, Any]], values: list[float]
) -> None:
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, above + ROWS)
    assert str(caught.value).endswith("log.csv" + hint)
    assert recorded(tmp_path, told[0] + ROWS, told[1]).outputs["S"].values.tolist() == values


@pytest.mark.parametrize(
    ("content", "csv"),
    [("t,glucose\n0,OFF\n1,2\n", {}), ("t,glucose\nsampled,OFF\n1,2\n", {"units_row": False})],
)
def test_a_word_in_a_row_of_data_may_mean_a_missing_value(tmp_path: Path, content: str, csv: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"found 'OFF'; if it means a missing value: csv: {missing: \[\"OFF\"\]}"):
        recorded(tmp_path, content, {"csv": csv})
