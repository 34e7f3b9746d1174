"""Columns of text side by side on a terminal, and numbers as tables show them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from hgorun.tables.typeset import columns, printable, shortened

_WIDTH = 100  # columns of a terminal
_LABEL = 40  # of them for a label, at most


def packed(texts: Sequence[str], groups: Sequence[Sequence[Sequence[str]]], *, title: str = "") -> list[list[str]]:
    """Lines of tables with as many columns side by side as a terminal has room for.

    Parameters
    ----------
    texts : sequence of str
        What the rows are called.
    groups : sequence of sequence of columns
        Columns that stay together where they fit. A column is its head and a cell a row.
    title : str
        What stands above the rows.
    """
    labels = [title, *_apart([printable(text) for text in texts])]
    room = _WIDTH - _width(labels)
    blocks: list[list[Sequence[str]]] = [[]]
    for group in groups:
        fits = sum(2 + _width(c) for c in group) <= room
        for part in [list(group)] if fits else [[column] for column in group]:
            if blocks[-1] and sum(2 + _width(column) for column in blocks[-1] + part) > room:
                blocks.append([])
            blocks[-1] += part
    return [aligned(labels, block) for block in blocks]


def _apart(texts: Sequence[str]) -> list[str]:
    """Names of rows, shortened as far as those that differ still do."""
    limit = _LABEL
    while True:
        found = [shortened(text, limit) for text in texts]
        if len(set(found)) == len(set(texts)) or limit >= max(map(columns, texts)):
            return found
        limit += 10


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


def wrapped(words: str, indent: str = "") -> list[str]:
    return textwrap.wrap(words, _WIDTH, initial_indent=indent, subsequent_indent=indent or "  ")
