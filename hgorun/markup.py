"""Small tables of HTML for notebooks; whatever stands in them is escaped, for names may come from anybody's file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from hgorun.errors import printable

_LONGEST = 80  # characters of a cell
_MOST_ROWS, _MOST_COLUMNS = 30, 13
_PADDING = "padding:0.15em 0.7em;text-align:"


def cell(text: str) -> str:
    """A text as HTML shows it: on one line, cut where it is long."""
    plain = printable(text)
    return escape(plain if len(plain) <= _LONGEST else f"{plain[: _LONGEST - 1]}…", quote=True)


def number(value: float) -> str:
    """Four significant digits; a dash for what is no number."""
    if math.isnan(value):
        return "–"
    return f"{value:.4g}" if math.isfinite(value) else ("∞" if value > 0 else "−∞")


def table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> str:
    """A table with a line above it and some below; of many rows and columns the first.

    Parameters
    ----------
    caption : str
    head : sequence of str
        Of the columns, the first of which is that of names.
    rows : sequence of sequences of str
    notes : sequence of str
    """
    left_out = [
        f"{count} more {what}"
        for count, what in (
            (len(rows) - _MOST_ROWS, "rows"),
            (len(head) - _MOST_COLUMNS, "columns"),
        )
        if count > 0
    ]
    lines = [f'<div><p style="margin:0.3em 0"><b>{cell(caption)}</b></p>']
    if rows:
        lines += ["<table>", f"<thead>{_row('th', head)}</thead>", "<tbody>"]
        lines += [_row("td", row) for row in rows[:_MOST_ROWS]] + ["</tbody>", "</table>"]
    lines += [f'<p style="margin:0.3em 0">{cell(note)}</p>' for note in [*notes, *left_out]]
    return "\n".join([*lines, "</div>"])


def _row(tag: str, cells: Sequence[str]) -> str:
    first, *others = cells[:_MOST_COLUMNS]
    parts = [f'<th scope="{"col" if tag == "th" else "row"}" style="{_PADDING}left">{cell(first)}</th>']
    parts += [f'<{tag} style="{_PADDING}right">{cell(text)}</{tag}>' for text in others]
    return f"<tr>{''.join(parts)}</tr>"
