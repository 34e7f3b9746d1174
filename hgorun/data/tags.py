"""Logs whose rows are of several signals, each with the name of its own: tag, time, value.

A column of names tells them apart where it is called so, or where nothing else is measured in the rows. What is read of
such rows is no signal if it jumps as the name changes, and hardly moves from one row of a name to the next.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from hgorun.data.cells import PLAIN_NUMBER
from hgorun.data.samples import Samples
from hgorun.data.table import Texts
from hgorun.pieces import median

NearRows: TypeAlias = Callable[..., Texts]
"""Gives the first rows of a file, or those near some lines."""
_MOST = 50  # different names
_EACH = 3.0  # rows of each of them, at the least, where the column is not called after names
_TWICE = 2.0  # rows of each, and how often it comes again
_APART = 5.0  # times: so much more do values jump from name to name than they move within one
_OFTEN = 0.5  # of all rows: so many have another name than the one above
_LOOKED_AT = 1_000_000  # samples in which the largest steps are looked for
_STEPS, _LARGE = 4, 20.0  # of them, and times the usual one
_SHOWN, _LONGEST = 3, 40  # names that a message has, and characters of each
_CALLED = (
    *("tag", "signal", "variable", "var", "channel", "chan", "sensor", "point", "parameter", "param", "item", "topic"),
    *("metric", "series", "field", "measurement", "attribute", "quantity", "device", "node", "object", "name", "id"),
    *("source", "key", "entity", "instrument", "messstelle", "kanal", "signalname", "bezeichnung", "variablenname"),
)
_COLUMNS = frozenset(f"{of}{end}" for of in _CALLED for end in ("", "s", "name", "id", "no", "nr", "number"))
"""What columns are called that name signals, without signs between their words."""
_OF_ROWS = re.compile(
    r"stat[eu]|mode|quali|valid|phase|step|flag|alarm|event|comment|remark|operator|user|shift|batch|recipe|product|"
    r"command|zustand|betrieb|bemerkung|schicht|charge|bediener|befehl",
    re.IGNORECASE,
)
"""Columns whose words say something of a row, and not which signal it is of."""
_STATES = frozenset(
    (
        *("on", "off", "open", "opened", "close", "closed", "auto", "automatic", "manual", "man", "hand", "remote"),
        *(
            "local",
            "run",
            "running",
            "stop",
            "stopped",
            "idle",
            "start",
            "started",
            "end",
            "ready",
            "ok",
            "good",
            "bad",
        ),
        *("uncertain", "fault", "error", "alarm", "warning", "normal", "high", "low", "hi", "lo", "hh", "ll", "max"),
        *("min", "true", "false", "yes", "no", "heat", "heating", "cool", "cooling", "fill", "filling", "empty"),
        *("emptying", "drain", "up", "down", "forward", "reverse", "active", "inactive", "enabled", "disabled", "fast"),
        *("slow", "full", "ein", "aus", "an", "auf", "zu", "offen", "geschlossen", "ja", "nein", "automatik", "gut"),
        *("schlecht", "stopp", "halt", "störung"),
    )
)
"""Words for how something is."""


@dataclass(frozen=True)
class Mixed:
    """That values are of several signals.

    Attributes
    ----------
    column : str
        Which names them.
    names : sequence of str
        The different ones.
    line : int
        Where a second one stands.
    sure : bool
        Whether the column is called after such names, and these are no numbers.
    """

    column: str
    names: Sequence[str]
    line: int
    sure: bool

    def sentence(self, *, measured: bool) -> str:
        """What is wrong, and what takes the rows of one signal, or of all.

        Parameters
        ----------
        measured : bool
            Whether a sensor measured the values: inputs have no quality.
        """
        more = len(self.names) - _SHOWN
        names = ", ".join(name[:_LONGEST] for name in self.names[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
        be = "are" if self.sure else "may be"
        right = (
            f"{_quality(self.column, self.names[0])} takes those of one, and good with all names all of them"
            if measured
            else "an input needs a file with its own rows"
        )
        return f"rows {be} of several signals, which {self.column!r} names ({names}), and are read as one: {right}"


def _quality(column: str, name: str) -> str:
    """The key that takes the rows of a name."""
    column, name = (json.dumps(text, ensure_ascii=False) for text in (column, name))
    return f"quality: {{column: {column}, good: [{name}]}}"


def of_several(near: NearRows | None, samples: Samples, pair: tuple[int, int], otherwise: str) -> str:
    """What to write where the stamps of two samples are one, or run backwards, if they may be of two signals.

    Parameters
    ----------
    near : callable or None
    samples : Samples
    pair : (int, int)
    otherwise : str
        What else may be right.
    """
    places = [samples.place(k) for k in pair]
    if near is None or {file for file, _ in places} != {str(samples.sources[0])}:
        return otherwise
    lines = [line for _, line in places]
    for column, cells in _candidates(near(*lines), ()):
        before, behind = (cells.get(line, "") for line in lines)
        if before and behind and before != behind:
            right = _quality(column, before)
            return f"rows may be of several signals, which {column!r} names: {right} takes those of one; {otherwise}"
    return otherwise


def mixed(
    near: NearRows, samples: Samples, column: str, read: Collection[str], plausible: tuple[float, float] | None = None
) -> Mixed | None:
    """That values are of several signals; None where nothing says so.

    Parameters
    ----------
    near : callable
        Of the first file.
    samples : Samples
        As they stand in the files.
    column : str
        That of the values.
    read : collection of str
        All columns that are read as numbers or dates.
    plausible : (float, float), optional
        Between what values are used.
    """
    low, high = plausible or (-math.inf, math.inf)
    size = int(np.searchsorted(samples.part, 0, "right")) if samples.part.size else samples.lines.size
    size = min(size, _LOOKED_AT)
    lines, values = samples.lines[:size], samples.values[:size]
    rows = _rows(near, lines, values)
    for name, cells in _candidates(rows, read):
        places = np.flatnonzero(np.isin(lines, list(cells)))
        every = zip(lines[places].tolist(), values[places].tolist(), strict=True)
        found = [(line, cells[line], y) for line, y in every if cells[line] and low <= y <= high]
        words = [word for _, word, _ in found]
        names = list(dict.fromkeys(words))
        often = sum(one != other for one, other in pairwise(words))
        if len(names) < 2 or often + 1 < _TWICE * len(names):
            continue
        in_turn, jumps = often >= _OFTEN * len(words), _jump(words, np.array([y for *_, y in found]))
        called = _is_called(name) and not all(map(PLAIN_NUMBER.fullmatch, names))
        if (called and (jumps or in_turn)) or (jumps and in_turn and _nothing_else(name, names, rows, column)):
            line = next(line for line, word, _ in found if word != names[0])
            return Mixed(name, names, line, called and jumps)
    return None


def _rows(near: NearRows, lines: np.ndarray, values: np.ndarray) -> Texts:
    """The first rows of a file, with those near the largest steps where a column may have one name for long."""
    rows = near()
    steps = np.abs(np.diff(values))
    steps[np.isnan(steps)] = 0.0
    if not steps.size or not any(map(_is_called, rows)):
        return rows
    largest = np.argpartition(steps, -min(_STEPS, steps.size))[-_STEPS:]
    beside = lines[largest[steps[largest] > _LARGE * median(steps)] + 1]
    more = near(*beside.tolist()) if beside.size else {}
    return {name: dict(sorted({**cells, **more.get(name, {})}.items())) for name, cells in rows.items()}


def _candidates(rows: Texts, read: Collection[str]) -> Iterator[tuple[str, Mapping[int, str]]]:
    """Columns of words of which few are different, those first that are called after names of signals."""
    for called in (True, False):
        for name, cells in rows.items():
            if name not in read and _is_called(name) == called and _are_names(cells.values(), called=called):
                yield name, cells


def _is_called(column: str) -> bool:
    return re.sub(r"[\s_./\\-]+", "", column.casefold()) in _COLUMNS


def _are_names(cells: Collection[str], *, called: bool) -> bool:
    """Whether cells may be names, of which each stands in several rows: numbers are none but where a column says so."""
    texts = [cell for cell in cells if cell]
    different = set(texts)
    likely = called or all(text[:1].isalpha() for text in different)
    return likely and 1 < len(different) <= min(_MOST, len(texts) / (_TWICE if called else _EACH))


def _jump(words: Sequence[str], values: np.ndarray) -> bool:
    """Whether values jump from name to name, and move little from one row of a name to its next."""
    steps = pairwise(zip(words, values.tolist(), strict=True))
    between = [abs(b - a) for (one, a), (other, b) in steps if one != other]
    within = [np.abs(np.diff(values[[word == name for word in words]])) for name in set(words)]
    moved = np.concatenate(within)
    return moved.size > 0 and median(np.array(between)) > _APART * median(moved)


def _nothing_else(column: str, names: Sequence[str], rows: Texts, own: str) -> bool:
    """Whether names are none of a state, and no other column of the rows has measured values."""
    if _OF_ROWS.search(column) or any(name.casefold() in _STATES for name in names):
        return False
    return not any(_are_measured(list(cells.values())) for name, cells in rows.items() if name not in (own, column))


def _are_measured(cells: Sequence[str]) -> bool:
    """Whether cells are numbers that are not all the same, and neither count nor are times."""
    numbers = [float(cell.replace(",", ".")) for cell in cells if PLAIN_NUMBER.fullmatch(cell.replace(",", "."))]
    return 2 * len(numbers) > len(cells) and len(set(numbers)) > 1 and any(b < a for a, b in pairwise(numbers))
