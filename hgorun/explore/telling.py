"""What a page is told of a run and of its theory, as JSON, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from hgorun.errors import printable
from hgorun.explore.numbers import promised_cells
from hgorun.explore.picture import Bound, Picture, words_of
from hgorun.explore.promises import AT_ONCE, LATER, Promise

Told = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Theory:
    """What is said of an observer, and what is drawn of that."""

    label: str
    promise: Promise
    bounds: list[Bound]


class Page(Protocol):
    """What is drawn on, by the server's own thread alone. What has been drawn is seen with what is told next."""

    def draw(self, picture: Picture, bounds: Mapping[str, list[Bound]]) -> None:
        """Show a run, and with it what the theory bounds of some of its observers; an empty list: nothing."""

    def draw_bounds(self, bounds: Mapping[str, list[Bound]]) -> None:
        """Show what the theory bounds of observers."""

    def tell(self, told: Told) -> None:
        """Give numbers and messages to the page."""


def told_of_picture(picture: Picture) -> Told:
    table = picture.table
    beyond = [words for panel in (*picture.panels, *picture.innovations) for words in panel.beyond]
    return {
        "status": picture.status,
        "said": [*picture.said, *beyond],
        "columns": table.columns,
        "meanings": table.meanings,
        "rows": [
            {
                "label": row.label,
                "status": row.status,
                "reason": row.reason,
                "cells": [[cell.text, cell.digits] for cell in row.cells],
            }
            for row in table.rows
        ],
    }


def told_of_theories(theories: Sequence[Theory], states: Sequence[str]) -> list[Told]:
    """What is told of observers' theories, with what is drawn of them."""
    found = []
    for one in theories:
        names = tuple(bound.name for bound in one.bounds)
        found.append(
            told_of_limits(one.label, one.promise)
            | {
                "drawn": "" if not one.bounds else "bound" if one.bounds[0].holds else "decay",
                "words": printable(words_of(one.promise)),
                "reason": printable(one.promise.reason),
                "others": [] if names == tuple(states) else names,  # coordinates that have figures of their own
            }
        )
    return found


def told_of_limits(label: str, promise: Promise) -> Told:
    """The numbers of an observer's theory alone."""
    cells = promised_cells({label: promise}, (*AT_ONCE, *LATER))[label]
    return {
        "label": label,
        "cells": {name: {state: [cell.text, cell.digits] for state, cell in of.items()} for name, of in cells.items()},
        "reasons": {name: printable(reason) for name, reason in promise.reasons.items()},
    }
