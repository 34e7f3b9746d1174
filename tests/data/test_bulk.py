"""Plain rows in machine code: the bits of Python's numbers, and the rows that are read one by one."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from hgorun.config.data import Csv
from hgorun.data.cells import Cells, Flags, Numbers, Stamps
from hgorun.data.csv import bulk, csv_table
from hgorun.data.csv.bulk import Bulk
from hgorun.data.csv.csv_table import CsvFile
from hgorun.data.csv.dialect import dialect_of
from hgorun.data.csv.rows import Rows
from hgorun.data.csv.text import Block, blocks
from hgorun.data.table import Table
from hgorun.errors import ConfigError

WANTED = [Numbers("t"), Numbers("a")]
HARD = [
    "9007199254740993",  # half-way between two doubles
    "9007199254740992.5",
    "1.7976931348623157e308",
    "2.2250738585072014e-308",
    "2.2250738585072011e-308",
    "4.9e-324",
    "1e23",
    "8.41e21",
    "9.5367431640625e-07",
    "0.1",
    "-0.0",
    "-0",
    "+7",
    ".5",
    "5.",
    "1e-400",
    "0e999",
    "000000000000000000000000012.5",
    "0.00000000000000000000000000000012345678901234567",
    "1234567890123456789012345678901234567890",
    "123456789012345678e-40",
    "12345678",
    "1234567812345678",
    "00000000",
    "0000000012345678",
]


def bulk_of(text: str, wanted: list[Cells] | None = None) -> tuple[int, list[np.ndarray]]:
    block = Block(text.encode(), 1)
    dialect = dialect_of(block, Path("log.csv"), Csv(), {})
    columns = [np.empty(block.lines) for _ in wanted or WANTED]
    count, end = Bulk(dialect, wanted or list(WANTED)).rows(block, text.index("\n") + 1, columns)
    return end, [column[:count] for column in columns]


def read_of(cells: list[str]) -> np.ndarray:
    """Cells in machine code, and those that it leaves to others by Python."""
    rows = [f"{cell},1\n" for cell in cells]
    text = "t,a\n" + "".join(rows)
    values: list[float] = []
    while len(values) < len(cells):
        text = "t,a\n" + "".join(rows[len(values) :])
        values += bulk_of(text)[1][0].tolist()
        if len(values) < len(cells):
            values.append(float("nan"))
    return np.array(values)


def same_bits(cells: list[str]) -> float:
    """The share of cells that machine code reads; fails where it reads other bits than Python."""
    found, expected = read_of(cells), np.array(list(map(float, cells)))
    known = ~np.isnan(found)
    np.testing.assert_array_equal(found[known].view(np.int64), expected[known].view(np.int64))
    return float(known.mean())


def test_hard_numbers() -> None:
    assert same_bits(HARD) > 0.7


@pytest.mark.costly
@pytest.mark.parametrize("digits", [1, 3, 8, 15, 16, 17, 18])
def test_numbers_of_any_length_and_size(digits: int) -> None:
    random = np.random.default_rng(digits)
    values = random.normal(size=4000) * 10.0 ** random.integers(-30, 30, 4000)
    assert same_bits([f"{value:.{digits}e}" for value in values]) > 0.98  # some are exact, which takes longer to see
    assert same_bits([f"{value:.{digits}e}" for value in np.arange(4000) / 64]) > 0.99
    assert same_bits([f"{value:.{digits}f}" for value in random.normal(size=4000)]) > 0.99
    everywhere = [f"{m}e{e}" for m, e in random.integers([1, -345], [10**18, 300], (2000, 2)).tolist()]
    assert same_bits(everywhere) > 0.9


@pytest.mark.parametrize("sign", ["", "-", "+"])
@pytest.mark.parametrize("behind", range(11))
def test_digits_on_both_sides_of_a_decimal_sign(sign: str, behind: int) -> None:
    random = np.random.default_rng(behind)
    wholes = [str(random.integers(10**count)).zfill(count) for count in range(1, 10) for _ in range(20)]
    assert same_bits([f"{sign}{one}.{random.integers(10**behind):0{behind}d}" for one in wholes]) == 1
    assert same_bits([f"{sign}{'0' * count}.{'0' * behind}" for count in range(1, 12)]) == 1


def test_doubles_and_what_lies_half_way_between_them() -> None:
    random = np.random.default_rng(1)
    words = random.integers(0x0010000000000000, 0x7FE0000000000000, 4000)
    assert same_bits([repr(value) for value in words.view(float).tolist()]) > 0.99
    for bits in (54, 62, 63):  # of numbers between which doubles have a distance of their own
        apart = 2 ** (bits - 53)
        between = (random.integers(2 ** (bits - 1), 2**bits - 2 * apart, 60) // apart * apart + apart // 2).tolist()
        assert all(float(value) != value for value in between)
        assert same_bits(list(map(str, between))) > 0.3  # of every other one it is left open which is even
        assert same_bits([str(value + side) for value in between for side in (-1, 1)]) == 1


@pytest.mark.parametrize(
    ("row", "plain"),
    [
        ("1,2", True),
        ("1 , 2 ", True),
        (" 1,2", False),
        (",2", True),
        ("1,", True),
        ("NaN,nan", True),
        ("1,2,3", False),
        ("1", False),
        ("", False),
        ("# 1,2", False),
        ("1,inf", False),
        ("1,2e", False),
        ("1,.", False),
        ("1,-", False),
        ("1,1e999999", False),
        ("1,0x1", False),
        ('"1",2', False),
        ("1,nano", False),
        ("1,12 34", False),
        ("-1.5,--1.5", False),
        ("1.5,-1.-5", False),
        ("1.5,1.5.5", False),
        ("1.5,1:5", False),
        ("1.5,1/5", False),
        ("1.5,1.5\xb5", False),
        ("1.5,\xfa.5", False),
        ("-1.5,+1.5", True),
        ("-.5,5.", True),
        ("1.5, 2.5 ", True),
    ],
)
def test_it_stops_at_the_first_row_that_is_not_plain(row: str, plain: bool) -> None:
    text = f"t,a\n7,8\n{row}\n5,6\n"
    end, (first, _) = bulk_of(text)
    assert first[0] == 7
    assert first.size == (3 if plain else 1)
    assert end == (len(text) if plain else text.index("7,8\n") + 4)


def test_columns_that_nobody_wants_may_hold_text() -> None:
    text = "t,note,a,more\n" + "1,good,2,\n3,b\u00e4d # ; x,4,y\n"
    end, (first, second) = bulk_of(text)
    assert end == len(text.encode())
    np.testing.assert_array_equal([first, second], [[1, 3], [2, 4]])
    assert bulk_of('t,note,a\n1,"a,b",2\n')[0] == 9


def table(path: Path, wanted: list[Cells]) -> Table:
    return CsvFile(path, Csv(), {}).table(wanted, 1e9)


def by_rows(path: Path, wanted: list[Cells]) -> tuple[np.ndarray, list[np.ndarray]]:
    """The oracle: every row by Python's reader."""
    block = Block(path.read_bytes(), 1)
    parts = list(Rows(path, dialect_of(block, path, Csv(), {}), wanted).arrays(iter([block])))
    return np.concatenate([lines for lines, _ in parts]), [
        np.concatenate(c) for c in zip(*(v for _, v in parts), strict=True)
    ]


@pytest.fixture
def short_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of a few hundred rows, several of which are read at once."""
    monkeypatch.setattr(csv_table, "blocks", partial(blocks, size=2**13))


@pytest.mark.costly
@pytest.mark.usefixtures("short_blocks")
@pytest.mark.parametrize(
    "odd", ["", "# a comment", "\n", "3,NULL,5", "3,1.00000000000000000000001,0", '3,"4",5', "3,4,n/a"]
)
def test_rows_between_plain_ones(tmp_path: Path, odd: str) -> None:
    random = np.random.default_rng(0)
    path = tmp_path / "log.csv"
    rows = [
        f"{t},{a!r},{q}"
        for t, a, q in zip(range(12_000), random.normal(size=12_000).tolist(), [0, 1] * 6_000, strict=True)
    ]
    for place in (0, 17, 18, 19, 20, 1000, 5000, 11_000, 11_999) if odd else ():
        rows[place] = odd
    path.write_text("t,a,q\n" + "\n".join(rows) + "\n")
    wanted: list[Cells] = [Numbers("t"), Numbers("a"), Flags("q", (0.0,))]
    found = table(path, wanted)
    lines, values = by_rows(path, wanted)
    np.testing.assert_array_equal(found.lines, lines)
    for cells, column in zip(wanted, values, strict=True):
        np.testing.assert_array_equal(found.columns[cells], column)


@pytest.mark.usefixtures("short_blocks")
@pytest.mark.parametrize("place", [1, 7_000, 11_999])
def test_a_fault_far_down_has_its_line(tmp_path: Path, place: int) -> None:
    rows = [f"{t},{t / 7!r}" for t in range(12_000)]
    rows[place] = "12,bad"
    (tmp_path / "log.csv").write_text("t,a\n" + "\n".join(rows))
    with pytest.raises(ConfigError, match=rf":{place + 2}: a: expected a number, found 'bad'"):
        table(tmp_path / "log.csv", list(WANTED))


def test_blocks_and_lines_meet_anywhere(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    for end in ("\n", "\r\n"):
        values = random.normal(size=90_000)  # some two megabytes
        text = end.join(["t,a", *(f"{t},{a!r}" for t, a in enumerate(values.tolist()))])
        (tmp_path / "log.csv").write_bytes(text.encode())
        found = table(tmp_path / "log.csv", list(WANTED))
        np.testing.assert_array_equal(found.columns[WANTED[1]], values)
        np.testing.assert_array_equal(found.lines, np.arange(2, 90_002))


@pytest.mark.usefixtures("short_blocks")
def test_dates_of_blocks_that_are_read_at_once_do_not_mix_their_zones(tmp_path: Path) -> None:
    rows = [f"2024-05-31T{k // 3600:02}:{k // 60 % 60:02}:{k % 60:02},{k}" for k in range(5_000)]
    stamps = Stamps("t")
    (tmp_path / "log.csv").write_text("t,a\n" + "\n".join(rows))
    found = table(tmp_path / "log.csv", [stamps, WANTED[1]])
    np.testing.assert_array_equal(np.diff(found.columns[stamps]), 10**9)
    rows[1_000:] = [row.replace(",", "Z,") for row in rows[1_000:]]
    (tmp_path / "log.csv").write_text("t,a\n" + "\n".join(rows))
    with pytest.raises(ConfigError, match=":1002: t: dates with and without a time zone"):
        table(tmp_path / "log.csv", [Stamps("t"), WANTED[1]])


def test_blocks_that_are_read_at_once_share_what_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    block = Block(b"t,a\n7,0.1\n5,1e-30\n", 1)
    reading = Bulk(dialect_of(block, Path("log.csv"), Csv(), {}), list(WANTED))

    def made_by_two_threads() -> None:
        raise AssertionError("each thread would have its own, and that of one of them is gone while it is read")

    for name in ("code", "powers"):
        monkeypatch.setattr(bulk, name, made_by_two_threads)
    columns = [np.empty(2) for _ in WANTED]
    assert reading.scanned(block, 4, columns)[0] == 2
    np.testing.assert_array_equal(columns, [[7, 5], [0.1, 1e-30]])
