"""Columns of text side by side in the width that a terminal has, and numbers as tables show them."""

from __future__ import annotations

import math
import os
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from hgorun.tables.typeset import columns, printable, shortened

_WIDTH = 100  # columns where nothing says how many there are: of a file, or of a page
_LEAST = 20  # columns without which there are no tables
_LABEL = 40  # columns for a label, at most
_FEWEST = 5  # columns of a part of a name that is shortened
_SHORTEST = 12  # columns to which a label may be shortened, to make room for a column beside it


def width() -> int:
    """How many columns a line may have: those that ``COLUMNS`` says, else those of the terminal, else 100."""
    told = os.environ.get("COLUMNS", "")
    if told.isdecimal() and int(told):
        return max(int(told), _LEAST)
    try:
        found = os.get_terminal_size(sys.stdout.fileno()).columns
    except (AttributeError, OSError, ValueError):  # no terminal, or a stream without a number
        found = 0
    return max(found or _WIDTH, _LEAST)


@dataclass(frozen=True)
class Name:
    """What a row is called: a part that is never shortened, such as a state, between others.

    Attributes
    ----------
    before, kept, after : str
    """

    before: str
    kept: str = ""
    after: str = ""

    @property
    def whole(self) -> str:
        return printable(self.before + self.kept + self.after)

    def within(self, limit: int) -> str:
        """In so many columns, if that is enough for the part that is kept and a little of the others."""
        if not self.kept or columns(self.whole) <= limit:
            return shortened(self.whole, limit)
        before, kept, after = map(printable, (self.before, self.kept, self.after))
        room = limit - columns(kept)
        behind = max(min(columns(after), max(room // 2, room - columns(before))), _FEWEST)
        return shortened(before, max(room - min(columns(after), behind), _FEWEST)) + kept + shortened(after, behind)


def packed(
    texts: Sequence[str | Name],
    groups: Sequence[Sequence[Sequence[str]]],
    *,
    title: str = "",
    room: int | None = None,
) -> list[list[str]]:
    """Lines of tables with as many columns side by side as there is room for.

    Where a column has no room even alone, the table lies on its side: below the name of each row stands a line for
    each column.

    Parameters
    ----------
    texts : sequence of str or Name
        What the rows are called; names that have no room are shortened.
    groups : sequence of sequence of columns
        Columns that stay together where they fit. A column is its head and a cell a row.
    title : str
        What stands above the rows.
    room : int, optional
        The most columns of characters of a line: by default :func:`width`.
    """
    whole = width() if room is None else room
    printed = [[[printable(cell) for cell in column] for column in group] for group in groups]
    widest = max((2 + _width(column) for group in printed for column in group), default=0)
    full = [text if isinstance(text, Name) else Name(text) for text in texts]
    names = apart(full, whole - widest)
    beside = columns(title) + widest <= whole
    above = [] if beside else wrapped(printable(title), room=whole)
    labels = [printable(title) if beside else "", *names]
    left = whole - _width(labels)
    if widest > left:
        return [
            [
                *above,
                *_on_its_side([name.whole for name in full], [column for group in printed for column in group], whole),
            ]
        ]
    blocks: list[list[Sequence[str]]] = [[]]
    for group in printed:
        fits = sum(2 + _width(c) for c in group) <= left
        for part in [list(group)] if fits else [[column] for column in group]:
            if blocks[-1] and sum(2 + _width(column) for column in blocks[-1] + part) > left:
                blocks.append([])
            blocks[-1] += part
    return [[*above, *aligned(labels, block)] for block in blocks]


def apart(names: Sequence[Name], room: int = 0) -> list[str]:
    """Names shortened as far as those that differ still do: to the room there is, if that is enough."""
    limit = min(_LABEL, max(room, _SHORTEST))
    whole = [name.whole for name in names]
    while True:
        found = [name.within(limit) for name in names]
        if len(set(found)) == len(set(whole)) or limit >= max(map(columns, whole)):
            return found
        limit += 10 if limit >= _LABEL else 1


def _on_its_side(labels: Sequence[str], table: Sequence[Sequence[str]], room: int) -> list[str]:
    """A line for each column of each row, broken where it is too long."""
    lines: list[str] = []
    for row, label in enumerate(labels, start=1):
        lines += wrapped(label or "-", room=room)
        for column in table:
            lines += wrapped(f"{column[0]}: {column[row]}", "  ", then="    ", room=room)
    return lines


def aligned(labels: Sequence[str], block: Sequence[Sequence[str]]) -> list[str]:
    """Lines with labels and status flush left, numbers flush right."""
    lines = [cell + " " * (_width(labels) - _width([cell])) for cell in labels]
    for column in block:
        gap = [2 + (0 if column[0] == "status" else _width(column) - _width([cell])) for cell in column]
        lines = [f"{line}{' ' * g}{cell}" for line, g, cell in zip(lines, gap, column, strict=True)]
    return [line.rstrip() for line in lines]


def number(value: float | None) -> str:
    """Four significant digits; a dash where there is none."""
    if value is None:
        return "-"
    return f"{value:#.4g}".removesuffix(".") if math.isfinite(value) else str(value)


def _width(cells: Sequence[str]) -> int:
    return max(map(columns, cells))


def wrapped(words: str, indent: str = "", *, then: str | None = None, room: int | None = None) -> list[str]:
    """Lines of a sentence, no longer than there is room for.

    Parameters
    ----------
    words : str
    indent : str
        What the first line begins with.
    then : str, optional
        What the others begin with: by default the same, or two spaces where that is empty.
    room : int, optional
        The most columns of characters of a line: by default :func:`width`.
    """
    # a character that takes two columns counts as two while lines are broken
    counted = "".join(char + "\0" * (columns(char) - 1) for char in words)
    lines = textwrap.wrap(
        counted,
        width() if room is None else room,
        initial_indent=indent,
        subsequent_indent=(indent or "  ") if then is None else then,
        break_on_hyphens=False,
    )
    return [line.replace("\0", "") for line in lines]


def entry(name: str, words: str, beside: int) -> list[str]:
    """A name and what it means: side by side where there is room, else below each other.

    Parameters
    ----------
    beside : int
        Columns for the name, when the words stand beside it.
    """
    if width() - beside < 2 * _LEAST:
        return [*wrapped(name, "  "), *wrapped(words, "      ")]
    first, *others = wrapped(words, " " * (beside + 4)) or [""]
    return [f"  {name:<{beside}}  {first.lstrip()}".rstrip(), *others]


def reflowed(text: str) -> list[str]:
    """Lines of text in paragraphs: those that are too long are filled anew, what is indented keeps its lines."""
    lines: list[str] = []
    for paragraph in text.split("\n\n"):
        own = paragraph.split("\n")
        if all(columns(line) <= width() for line in own):
            lines += own
        elif any(line.startswith((" ", "- ")) for line in own):
            for line in own:
                indent = line[: len(line) - len(line.lstrip())]
                lines += wrapped(line.lstrip(), indent, then=indent + "  ")
        else:
            lines += wrapped(" ".join(own), then="")
        lines.append("")
    return lines[:-1]
