"""Files with every kind of fault: refused with their line, or read as they were before; nothing is made up."""

from __future__ import annotations

import codecs
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest
import yaml
from logs import LOG, noisy, recorded
from shell import Shell

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Signal
from hgorun.errors import ConfigError, Problem

Random: TypeAlias = np.random.Generator
Rows: TypeAlias = list[list[str]]
CASES = 500


@dataclass(frozen=True)
class Case:
    """A file and what may become of it.

    Attributes
    ----------
    content : bytes
    samples : set of (time, value)
        What was measured: nothing else may be read.
    line : int or None
        Where the fault is; None where the file may be read all the same, 0 where the fault has no line of its own.
    """

    content: bytes
    samples: set[tuple[float, float]]
    line: int | None


def rows_of(random: Random) -> Rows:
    times, values = noisy(int(random.integers(12, 60)), int(random.integers(2**31)))
    return [[repr(t), repr(v)] for t, v in zip(times.tolist(), values.tolist(), strict=True)]


# Each changes the rows, and says in which of them the fault is: None where all may be read.
def unharmed(rows: Rows, random: Random) -> int | None:
    return None


def text(rows: Rows, random: Random) -> int:
    k, words = (
        place(rows, random),
        ["bad", "12,5,3", "1.2.3", "--", "0x1f", "1_0", "1e", "∞", "inf", "1e999", "٣", "5 %"],
    )
    rows[k][int(random.integers(2))] = f'"{random.choice(words)}"'
    return k


def missing(rows: Rows, random: Random) -> None:
    for k in random.choice(len(rows), 3, replace=False):
        rows[k][1] = str(random.choice(["", "NaN", "nan", "N/A", "null", "  "]))


def no_stamp(rows: Rows, random: Random) -> int:
    k = place(rows, random)
    rows[k][0] = ""
    return k


def short(rows: Rows, random: Random) -> int:
    k = place(rows, random)
    del rows[k][1]
    return k


def long(rows: Rows, random: Random) -> int:
    k = place(rows, random)
    rows[k].append("1.0")
    return k


def twice(rows: Rows, random: Random) -> int:
    k = place(rows, random)
    rows[k][0] = rows[k - 1][0]
    return k


def reversed_stamp(rows: Rows, random: Random) -> int:
    k = max(place(rows, random), 2)
    rows[k][0] = repr(float(rows[k - 2][0]) - 0.25)
    return k


def huge_cell(rows: Rows, random: Random) -> int:
    k = place(rows, random)
    rows[k][1] = "7" * 200_000
    return k


def open_quote(rows: Rows, random: Random) -> int:
    k = place(rows, random)
    rows[k][1] = '"' + rows[k][1]
    return k


def number_on_two_lines(rows: Rows, random: Random) -> int:
    """Inside quotes, where the end of a line belongs to the cell."""
    k = place(rows, random)
    rows[k][1] = '"0.\n5"'
    return k


def slip(rows: Rows, random: Random) -> int:
    k = int(random.integers(3, len(rows) - 3)) if len(rows) < 30 else int(random.integers(5, len(rows) - 5))
    for row in rows[k:]:
        row[1] = repr(float(row[1]) * 1000)
    return k


def interpolated(rows: Rows, random: Random) -> int:
    rows[:] = [[repr(float(k)), row[1]] for k, row in enumerate(rows)]
    knots = np.arange(0, len(rows), 5)
    values = np.interp(np.arange(len(rows)), knots, [float(rows[k][1]) for k in knots])
    for row, value in zip(rows, values.tolist(), strict=True):
        row[1] = repr(value)
    return 0


ROW_FAULTS: list[Callable[[Rows, Random], int | None]] = [
    unharmed, text, missing, no_stamp, short, long, twice, reversed_stamp, huge_cell, open_quote, number_on_two_lines,
    slip, interpolated,
]  # fmt: skip


def place(rows: Rows, random: Random) -> int:
    return int(random.integers(1, len(rows)))


def written(rows: Rows, random: Random) -> tuple[str, int, str]:
    """The rows as text in some dialect, the line of the first one, and the separator."""
    separator = str(random.choice([",", ";", "\t", "|"]))
    comma = separator != "," and random.random() < 0.4
    plain = [
        [cell if cell.startswith('"') else cell.replace(".", "," if comma else ".") for cell in row] for row in rows
    ]
    head = ["# comment"] * int(random.integers(3))
    lines = [*head, separator.join(["t", "glucose"]), *(separator.join(row) for row in plain)]
    if random.random() < 0.2:
        lines.insert(len(head) + 1, separator.join(["s", "g/L"]))
    return "\n".join(lines) + "\n", len(lines) - len(rows) + 1, separator


def coded(content: str, random: Random) -> bytes:
    ends = str(random.choice(["\n", "\r\n", "\r", "mixed"]))
    if ends == "mixed":
        parts = content.split("\n")
        content = "".join(part + str(random.choice(["\n", "\r\n"])) for part in parts[:-1])
    else:
        content = content.replace("\n", ends)
    forms: list[Callable[[], bytes]] = [
        lambda: content.encode(),
        lambda: codecs.BOM_UTF8 + content.encode(),
        lambda: content.encode("utf-16"),
        lambda: codecs.BOM_UTF16_BE + content.encode("utf-16-be"),
    ]
    return forms[int(random.integers(4))]()


# Each changes a whole file; what becomes of it is not known beforehand.
def cut(content: bytes, random: Random) -> bytes:
    return content[: int(random.integers(len(content)))]


def noise(content: bytes, random: Random) -> bytes:
    return random.bytes(int(random.integers(1, 5000)))


def flipped(content: bytes, random: Random) -> bytes:
    found = bytearray(content)
    for k in random.choice(len(found), 4):
        found[k] = int(random.integers(256))
    return bytes(found)


def zeros(content: bytes, random: Random) -> bytes:
    k = int(random.integers(len(content)))
    return content[:k] + bytes(100) + content[k:]


def huge_line(content: bytes, random: Random) -> bytes:
    return content + b"1," * 2_000_000


def wrong_marks(content: bytes, random: Random) -> bytes:
    return codecs.BOM_UTF16_LE + content


def empty(content: bytes, random: Random) -> bytes:
    return random.choice([b"", b"\n\n", b"t,glucose\n", codecs.BOM_UTF8, b"# nothing\n", b"\xff\xfe"])


FILE_FAULTS: list[Callable[[bytes, Random], bytes]] = [cut, noise, flipped, zeros, huge_line, wrong_marks, empty]


def case(seed: int) -> Case:
    random = np.random.default_rng(seed)
    rows = rows_of(random)
    samples = {(float(t), float(v)) for t, v in rows}
    if seed % 3 == 2:
        fault = FILE_FAULTS[seed // 3 % len(FILE_FAULTS)]
        harmed = fault(coded(written(rows, random)[0], random), random)
        # a digit that has changed may make another number, which nobody can know
        return Case(harmed, set() if fault in (cut, flipped, zeros) else samples, 0)
    change = ROW_FAULTS[seed % len(ROW_FAULTS)]
    k = change(rows, random)
    content, first, _ = written(rows, random)
    line = None if k is None else 0 if change is interpolated else first + k
    return Case(coded(content, random), samples, line)


def attempt(folder: Path, made: Case) -> Signal | ConfigError | Problem:
    """What becomes of a file."""
    (folder / "log.csv").write_bytes(made.content)
    try:
        return read(Data.model_validate(LOG), folder).outputs["S"]
    except (ConfigError, Problem) as error:
        return error


@pytest.mark.slow
@pytest.mark.parametrize("tenth", range(10))
def test_corrupted_files_are_refused_with_their_line_or_read_right(tmp_path: Path, tenth: int) -> None:
    for seed in range(tenth, CASES, 10):
        made = case(seed)
        outcome = attempt(tmp_path, made)
        if isinstance(outcome, Signal):
            found = set(zip(outcome.taken.tolist(), outcome.values.tolist(), strict=True))
            assert not made.line, (seed, found - made.samples)
            assert not made.samples or found <= made.samples, (seed, found - made.samples)
            assert np.all(np.isfinite(outcome.values)), seed
            assert np.all(np.diff(outcome.taken) > 0), seed
            continue
        assert made.line is not None, (seed, outcome)
        if isinstance(outcome, ConfigError):
            assert outcome.file == str(tmp_path / "log.csv"), seed
            assert outcome.line == made.line or not made.line, (seed, outcome)
        else:  # the names of the columns are gone
            assert not made.line, (seed, outcome)


@pytest.mark.slow
def test_the_command_ends_with_two_and_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plant = {"states": ["S"], "dynamics": {"S": "-S"}, "output": {"S": "S"}}
    observers = {"SHGO": {"type": "shgo", "theta": 1, "poles": -1}}
    (tmp_path / "c.yaml").write_text(yaml.safe_dump({"plant": plant, "data": LOG, "observers": observers}))
    shell = Shell(tmp_path, monkeypatch, capsys)
    refused = 0
    for seed in range(60):
        made = case(seed)
        if not isinstance(attempt(tmp_path, made), Signal):
            code, out, err = shell("estimate", "c.yaml", "log.csv", "-o", "found.h5")
            assert (code, out) == (2, ""), seed
            assert err.startswith(("hgorun: log.csv", "hgorun: c.yaml:")), seed
            assert err.count("\n") == 1, seed
            refused += 1
    assert refused > 40
    code, _, err = shell("estimate", "c.yaml", "nowhere.csv")
    assert (code, err) == (2, "hgorun: nowhere.csv: there is no such file\n")
    assert {path.name for path in tmp_path.iterdir()} == {"c.yaml", "log.csv"}


@pytest.mark.parametrize("content", [b"", b"# nothing\n", b"PK\x03\x04 a workbook", b"\x1f\x8b compressed", b"CDF\x01"])
def test_what_holds_no_line_of_numbers_is_refused_at_its_first(content: bytes, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"log\.csv:1: "):
        recorded(tmp_path, content)
