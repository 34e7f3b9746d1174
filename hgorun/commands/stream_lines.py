"""Samples as lines of text: those that are in the pipe already, at once."""

from __future__ import annotations

import codecs
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, TextIO

import numpy as np

from hgorun.config.nearest import nearest
from hgorun.config.tokens import short
from hgorun.data.cells import PLAIN_NUMBER
from hgorun.data.times.date_texts import looks_like_iso
from hgorun.errors import ConfigError
from hgorun.symbolic.evaluate import Floats

INPUT = "standard input"
_COLUMNS = ("t", "signal", "y", "available")
_VALUES = ("value", "val", "v", "reading")  # what others call y
_TIMES = ": times of a stream are numbers in the unit time.unit, on the clock of time.start"
_BYTES = 1 << 16  # of a pipe that are read at once: as much as it holds


class Sample(NamedTuple):
    """A line of the stream."""

    line: int
    t: float
    signal: str
    y: float
    available: float | None


class Samples(NamedTuple):
    """Lines of a stream with numbers alone, all known when they were taken, shape (N,) each.

    ``kinds`` are the numbers of their signals.
    """

    t: Floats
    kinds: np.ndarray
    y: Floats


@dataclass(frozen=True)
class Block:
    """Lines that were there together, and the number of the first."""

    first: int
    lines: list[str]

    def numbered(self) -> Iterator[tuple[int, str]]:
        return enumerate(self.lines, start=self.first)


@dataclass(frozen=True)
class CsvForm:
    """Samples as CSV: how many cells a line has, and in which stand t, signal, y and available."""

    cells: int
    places: tuple[int, int, int, int | None]

    def samples(self, block: Block) -> Iterator[Sample]:
        """The samples of some lines one after the other; the line that is wrong is named."""
        for number, line in block.numbered():
            cells = _cells(line)
            if cells == [""]:
                continue
            if len(cells) != self.cells:
                raise ConfigError(f"expected {self.cells} cells, found {len(cells)}", file=INPUT, line=number)
            t, signal, y, known = (None if place is None else cells[place] for place in self.places)
            yield _sample(number, t, signal, y, known or None)

    def together(self, block: Block, kinds: Mapping[str, int]) -> Samples | None:
        """All samples of some lines; None where one of the lines needs a closer look, see :meth:`samples`."""
        at_t, at_signal, at_y, late = self.places
        rows = [line.split(",") for line in block.lines]
        if late is not None or any(len(row) != self.cells for row in rows):
            return None
        numbers = "".join([row[at_t] + row[at_y] for row in rows])
        if "_" in numbers or not numbers.isascii():  # which Python takes for parts of numbers
            return None
        try:
            t = np.array([float(row[at_t]) for row in rows])
            y = np.array([float(row[at_y]) for row in rows])
            found = np.array([kinds[row[at_signal].strip().strip('"')] for row in rows])
        except (ValueError, KeyError):
            return None
        return Samples(t, found, y) if np.all(np.isfinite(t)) and np.all(np.isfinite(y)) else None


@dataclass(frozen=True)
class JsonForm:
    """Samples as objects, one a line; ``signal`` is that of an object without this key."""

    signal: str | None = None

    def samples(self, block: Block) -> Iterator[Sample]:
        """The samples of some lines one after the other; the line that is wrong is named."""
        for number, line in block.numbered():
            if line.strip():
                try:
                    found = json.loads(line, object_pairs_hook=_once)
                except _Twice as twice:
                    raise ConfigError(f"the key {twice} stands twice", file=INPUT, line=number) from None
                except (ValueError, RecursionError) as error:
                    raise ConfigError(f"not JSON: {error}", file=INPUT, line=number) from None
                if not isinstance(found, dict):
                    raise ConfigError("expected an object with t, signal and y", file=INPUT, line=number)
                if self.signal is not None:
                    found.setdefault("signal", self.signal)
                _require_keys(found, number)
                _require_numbers(found, number)
                yield _sample(number, *(found.get(name) for name in _COLUMNS))

    def together(self, _block: Block, _kinds: Mapping[str, int]) -> None:
        """Each is looked at: any object may be of a late sample."""


def form_of(header: str) -> CsvForm | JsonForm:
    """The form of a stream, from its first line.

    Raises
    ------
    ConfigError
    """
    if header.lstrip().startswith("{"):
        return JsonForm()
    names = _cells(header)
    if any(name not in names for name in _COLUMNS[:3]):
        signs = "; cells are separated by commas, and decimals have a point" if ";" in header or "\t" in header else ""
        raise ConfigError(
            f"expected the header t,signal,y[,available], found {header.strip()[:80]!r}{signs}", file=INPUT, line=1
        )
    for name in _COLUMNS:
        if names.count(name) > 1:
            raise ConfigError(f"the column {name} stands twice", file=INPUT, line=1)
    t, signal, y = (names.index(name) for name in _COLUMNS[:3])
    return CsvForm(len(names), (t, signal, y, names.index(_COLUMNS[3]) if _COLUMNS[3] in names else None))


def read(stream: TextIO) -> tuple[CsvForm | JsonForm, bool, Iterator[Block]]:
    """The form of a stream, whether some samples may be late, and the lines with samples, as they come.

    Raises
    ------
    ConfigError
        With the number of the line.
    """
    blocks = _blocks(stream)
    start = next(blocks, Block(1, [""]))
    header, *lines = start.lines
    header = header.removeprefix("\ufeff")  # a byte order mark, whatever follows
    form = form_of(header)
    late = isinstance(form, JsonForm) or form.places[3] is not None
    rest = Block(1, [header, *lines]) if isinstance(form, JsonForm) else Block(2, lines)
    return form, late, (block for part in ((rest,), blocks) for block in part if block.lines)


def _blocks(stream: TextIO) -> Iterator[Block]:
    """Whole lines, as many as have come; the last one may lack its end."""
    number, begun = 1, list[str]()
    for text in _pieces(stream):
        *whole, rest = text.split("\n")
        if whole:
            whole[0] = "".join([*begun, whole[0]])
            begun = []
            yield Block(number, whole)
            number += len(whole)
        begun.append(rest)
    last = "".join(begun)
    if last:
        yield Block(number, [last])


def _pieces(stream: TextIO) -> Iterator[str]:
    """What has come, without waiting for more; line by line where a stream is no text over bytes."""
    buffer = stream.buffer if isinstance(stream, io.TextIOWrapper) else None
    if not isinstance(buffer, io.BufferedIOBase):
        yield from iter(stream.readline, "")
        return
    decoder = io.IncrementalNewlineDecoder(
        codecs.getincrementaldecoder(stream.encoding)(stream.errors or "strict"), translate=True
    )
    while data := buffer.read1(_BYTES):
        yield decoder.decode(data)
    yield decoder.decode(b"", final=True)


class _Twice(Exception):
    """A key of an object that is there more than once."""


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """An object of JSON, each key of which stands once."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        raise _Twice(next(short(name) for name in names if names.count(name) > 1))
    return found


def _require_keys(found: Mapping[str, object], line: int) -> None:
    """Refuse an object where a key is missing, or is called nearly like one that may be missing."""
    missing = [name for name in _COLUMNS if name not in found]
    for key in found:
        is_value = "y" in missing and key.lower() in _VALUES
        meant = " Did you mean `y`?" if is_value else nearest(key, missing)
        if key not in _COLUMNS and meant:
            raise ConfigError(f"unknown key {short(key)!r}.{meant}", file=INPUT, line=line)
    for name in missing:
        if name != "available":
            why = " (null stands for a missing sample)" if name == "y" else ""
            raise ConfigError(f"the key {name} is missing{why}", file=INPUT, line=line)


def _require_numbers(found: Mapping[str, object], line: int) -> None:
    """Refuse numbers that are written as text, but for one that is missing."""
    for name in ("t", "y", "available"):
        value = found.get(name)
        if isinstance(value, str) and not (name == "y" and value.strip().lower() in ("", "nan")):
            told = f"{name}: expected a number, found the text {short(value)!r}{_instead(name, value)}"
            raise ConfigError(told, file=INPUT, line=line)


def _instead(name: str, value: object) -> str:
    """What is to be written in place of a date."""
    return _TIMES if name != "y" and isinstance(value, str) and looks_like_iso(value.strip()) else ""


def _cells(line: str) -> list[str]:
    """What stands between the commas, which are in no name and in no number."""
    return [cell.strip().strip('"') for cell in line.split(",")]


def _sample(line: int, t: object, signal: object, y: object, available: object) -> Sample:
    if not isinstance(signal, str) or not signal:
        raise ConfigError(f"signal: expected a name, found {signal!r:.50}", file=INPUT, line=line)
    known = None if available is None else _number(line, "available", available)
    value = float("nan") if y in ("", None) else _number(line, "y", y)
    return Sample(line, _number(line, "t", t), signal, value, known)


def _number(line: int, name: str, value: object) -> float:
    try:
        if isinstance(value, str) and value.strip().lower() != "nan" and not PLAIN_NUMBER.fullmatch(value.strip()):
            raise ValueError
        number = float(value)  # type: ignore[arg-type]  # whatever it is, this says whether it is a number
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if isinstance(value, bool) or (name != "y" and not math.isfinite(number)) or math.isinf(number):
        told = f"{name}: expected a number, found {value!r:.50}{_instead(name, value)}"
        raise ConfigError(told, file=INPUT, line=line)
    if name == "y" and number != number and str(value).strip().lower() != "nan":
        raise ConfigError(f"y: expected a number, found {value!r:.50}", file=INPUT, line=line)
    return number
