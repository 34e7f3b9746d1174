"""Headers of several lines, or without a name for a column: what is said of them is right when it is followed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from logs import recorded

from hgorun.errors import ConfigError, Problem

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


LOGGER = (
    '"TOA5","CR1000","dump"\n"TIMESTAMP","RECORD","glucose"\n"TS","RN","mg/L"\n"","","%s"\n'
    '"2024-01-01 00:00:00",0,1\n"2024-01-01 00:00:01",1,2.5\n"2024-01-01 00:00:02",2,"NAN"\n'
)


@pytest.mark.parametrize("processing", ["Smp", "Avg", "Max"])
def test_files_of_a_logger_are_read_where_their_first_line_is_left_out(tmp_path: Path, processing: str) -> None:
    clock: dict[str, Any] = {"time": "TIMESTAMP"}
    with pytest.raises(Problem, match=r"Line 2 has it: if that is the header, csv: {skip: 1}"):
        recorded(tmp_path, LOGGER % processing, clock)
    clock["csv"] = {"skip": 1}
    with pytest.raises(Problem, match=r"the file says mg/L .*unit: mg/L} converts"):
        recorded(tmp_path, LOGGER % processing, clock, units={"S": "g/L"})
    found = recorded(tmp_path, LOGGER % processing, clock, units={"S": "mg/L"}).outputs["S"]
    assert (found.taken.tolist(), found.values.tolist()) == ([0, 1], [1, 2.5])


def test_the_line_of_the_header_has_all_names_as_whole_cells(tmp_path: Path) -> None:
    above = "Report of site\nglucose at t\nof t\nt of start;3\n"
    for names in ('t,glucose,"t [s]"', "t [s];glucose [g/L]"):
        with pytest.raises(Problem) as caught:
            recorded(tmp_path, f"{above}{names}\n" + ROWS)
        told = str(caught.value)
        assert told.count("Line 5 has it: if that is the header, csv: {skip: 4}") == 1
        assert "skip: 1" not in told
        assert "skip: 3" not in told


def test_a_row_below_the_units_that_no_logger_writes_is_one_of_data(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv:4: glucose: expected a number, found 'Raw'; if this"):
        recorded(tmp_path, LOGGER.replace("TOA5", "#") % "Raw", {"time": "TIMESTAMP", "csv": {"skip": 1}})


@pytest.mark.parametrize("brackets", ["[]", "()", "{}", "<>"])
def test_units_in_brackets_of_any_kind(tmp_path: Path, brackets: str) -> None:
    row = f"{brackets[0]}s{brackets[1]},{brackets[0]}mg/L{brackets[1]}\n"
    with pytest.raises(Problem, match=r"the file says mg/L .*unit: mg/L} converts"):
        recorded(tmp_path, "t,glucose\n" + row + ROWS, units={"S": "g/L"})


@pytest.mark.parametrize(
    ("content", "csv"),
    [("t,glucose\n0,OFF\n1,2\n", {}), ("t,glucose\nsampled,OFF\n1,2\n", {"units_row": False})],
)
def test_a_word_in_a_row_of_data_may_mean_a_missing_value(tmp_path: Path, content: str, csv: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"found 'OFF'; if it means a missing value: csv: {missing: \[\"OFF\"\]}"):
        recorded(tmp_path, content, {"csv": csv})


@pytest.mark.parametrize(
    ("header", "column"),
    [
        ('t,"glucose\n(g/L)"', "glucose (g/L)"),
        ('t;"glucose\r\n  in ""A""\r\n(g/L)"\r', 'glucose in "A" (g/L)'),
        ('"t"\t"glucose\n(g/L)"', "glucose (g/L)"),
        ('"t" "glucose\n(g/L)"', "glucose (g/L)"),
        ('"t\n[s]","glucose\n(g/L)"', "glucose (g/L)"),
    ],
)
def test_names_in_quotes_over_several_lines(tmp_path: Path, header: str, column: str) -> None:
    """Each is one with spaces, whose unit is that of the column."""
    separator = next(one for one in ";\t, " if one in header.replace(" (", "("))
    content = f"{header}\n{ROWS.replace(',', separator)}"
    told = {"time": "t [s]" if "[s]" in header else "t", "outputs": {"S": column}}
    found = recorded(tmp_path, content, told).outputs["S"]
    assert (found.taken.tolist(), found.values.tolist()) == ([0, 1, 2], [1, 2, 4])
    assert found.lines.tolist()[0] == header.count("\n") + 2
    with pytest.raises(Problem, match=r"its name says g/L .*unit: g/L} converts"):
        recorded(tmp_path, content, told, units={"S": "mg/L"})


@pytest.mark.parametrize(
    ("header", "name"), [('t,glucose,width 5"', 'width 5"'), ('t,glucose,"width', '"width'), ('t,glucose,"', '"')]
)
def test_a_quote_that_does_not_close_takes_no_rows(tmp_path: Path, header: str, name: str) -> None:
    content = f"{header}\n0,1,7\n1,2,8\n2,4,9\n"
    assert recorded(tmp_path, content).outputs["S"].values.tolist() == [1, 2, 4]
    assert recorded(tmp_path, content, {"outputs": {"S": name}}).outputs["S"].values.tolist() == [7, 8, 9]
    quoted = content.replace("8\n", '"8"\n').replace("9", '9"')
    with pytest.raises(ConfigError, match=r"log\.csv:4"):
        recorded(tmp_path, quoted, {"outputs": {"S": name}})


@pytest.mark.parametrize(
    "below",
    ["# logged by X", "# logged by X, Berlin", "# 31.05.2024,X", "#", "# -------", "# float,float", "# s,g/L\n# a,b"],
)
def test_a_header_in_a_comment_may_have_others_below_it(tmp_path: Path, below: str) -> None:
    signal = recorded(tmp_path, f"# Log of a tank\n# t,glucose\n{below}\n0,1\n1,2\n2,4\n").outputs["S"]
    assert signal.values.tolist() == [1, 2, 4]


def test_units_below_such_a_header_are_known(tmp_path: Path) -> None:
    content = "# t,glucose\n# s,mg/L\n# float,float\n0,1000\n1,2000\n2,4000\n"
    assert recorded(tmp_path, content, {"outputs": {"S": {"column": "glucose", "unit": "mg/L"}}}).outputs["S"].unit
    with pytest.raises(Problem, match="the file says mg/L"):
        recorded(tmp_path, content, units={"S": "g/L"})
