"""Comments and empty lines between rows: the numbers and lines of the rows, read at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hgorun.config.data import Csv
from hgorun.data.cells import Numbers
from hgorun.data.csv import csv_table
from hgorun.data.csv.csv_table import CsvFile
from hgorun.data.table import Table
from hgorun.errors import ConfigError

WANTED = [Numbers("t"), Numbers("a")]
ROWS = 3000


def read(folder: Path, text: str, **told: object) -> Table:
    path = folder / "log.csv"
    path.write_bytes(text.encode())
    return CsvFile(path, Csv.model_validate(told), {}).table(WANTED, 1e9)


@pytest.mark.parametrize(
    "between",
    ["# a word\n", "#\n", "\n", "# 1,2\n# 3,4\n", '# a "word\n', "#note\n", "\r\n#\r\n"],
)
@pytest.mark.parametrize("every", [1, 7])
def test_rows_between_comments(tmp_path: Path, between: str, every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text, lines, expected = ["t,a\n"], [], []
    line = 2
    for k in range(ROWS):
        a = f"{k / 8}" if k % 5 else ""
        text.append(f"{k},{a}\n")
        lines.append(line)
        expected.append(float(a) if a else np.nan)
        line += 1
        if k % every == 0:
            text.append(between)
            line += between.count("\n")
    alone: list[int] = []
    slow = csv_table._Reading._one_by_one

    def counted(self: csv_table._Reading, parts: object) -> None:
        some = list(parts)  # type: ignore[call-overload]  # blocks
        alone.extend(block.lines for block in some)
        slow(self, iter(some))

    monkeypatch.setattr(csv_table._Reading, "_one_by_one", counted)
    found = read(tmp_path, "".join(text))
    np.testing.assert_array_equal(found.lines, lines)
    np.testing.assert_array_equal(found.columns[WANTED[0]], np.arange(ROWS))
    np.testing.assert_array_equal(found.columns[WANTED[1]], expected)
    assert not alone


def test_a_value_that_begins_like_a_comment_is_a_row(tmp_path: Path) -> None:
    found = read(tmp_path, "t,a\n1,2\n#N/A,3\n# 4,5\n6,7\n")
    np.testing.assert_array_equal(found.lines, [2, 3, 5])
    np.testing.assert_array_equal(found.columns[WANTED[0]], [1, np.nan, 6])


def test_a_line_inside_quotes_is_no_comment(tmp_path: Path) -> None:
    text = 't,a,note\n1,2,x\n# a "word\n3,4,"two\n# lines, and\n\nmore"\n5,6,y\n# 7,8,9\n'
    found = read(tmp_path, text)
    np.testing.assert_array_equal(found.lines, [2, 4, 8])
    np.testing.assert_array_equal(found.columns[WANTED[1]], [2, 4, 6])


def test_a_row_that_is_not_plain_is_told_with_its_line(tmp_path: Path) -> None:
    text = "t,a\n" + "".join(f"# {k}\n{k},1\n" for k in range(20)) + "# x\n20,one\n"
    with pytest.raises(ConfigError, match=r":43: a: .*one"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("missing", "cell", "row"),
    [
        ("#", "#", True),
        ("#", "# ", True),
        ("#", "#\u00a0", True),
        ("#é", "#é", True),
        ("#é", "#É", True),
        ("#kein", "#\u212aEIN", True),  # the sign of kelvin is a capital k
        ("#x", "#X", True),
        ("#", "#5", False),
        ("#", "##", False),
        ("#é", "#e", False),
        ("#x", "# x", False),
    ],
)
@pytest.mark.parametrize("separator", [",", ";", "~"])
def test_any_text_for_a_missing_value_begins_a_row(
    tmp_path: Path, missing: str, cell: str, row: bool, separator: str
) -> None:
    text = "a,t,b\n0.5,1,0\n" + "".join(f"{cell},{k},0\n" for k in range(2, 6)) + "1.5,6,0\n"
    found = read(tmp_path, text.replace(",", separator), missing=[missing], separator=separator)
    assert found.columns[WANTED[0]].tolist() == ([1, 2, 3, 4, 5, 6] if row else [1, 6])


@pytest.mark.parametrize("sign", [";", "|", ","])
@pytest.mark.parametrize("quoted", [False, True])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_sign_of_comments_that_separates_cells_elsewhere(
    tmp_path: Path, sign: str, quoted: bool, separator: str
) -> None:
    first = '"1",2' if quoted else "1,2"
    text = f"t,a\n{first}\n3,4\n5,6\n".replace(",", separator)
    rows = text.splitlines(keepends=True)
    comment = f"{sign} logger 3\n"
    told: dict[str, object] = {"comment": sign}
    found = read(tmp_path, comment + rows[0] + rows[1] + comment + "".join(rows[2:]) + comment, **told)
    assert found.columns[WANTED[0]].tolist() == [1, 3, 5]
    assert found.columns[WANTED[1]].tolist() == [2, 4, 6]
    assert found.lines.tolist() == [3, 5, 6]
