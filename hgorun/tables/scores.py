"""Scores of estimates of recorded data as columns of a table."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.tables.layout import number
from hgorun.tables.rows import Row


def scores_of(rows: Sequence[Row]) -> list[list[list[str]]]:
    """For each score the columns of all that it is of: outputs, states or gains; nothing for simulated plants."""
    scores = [{} if row.observer.assessed is None else row.observer.assessed.scores for row in rows]
    of: dict[str, dict[str, None]] = {}
    for one in scores:
        for score, values in one.items():
            of.setdefault(score, {}).update(dict.fromkeys(values))
    return [
        [[f"{score} {name}", *(score_text(score, one.get(score, {}).get(name)) for one in scores)] for name in names]
        for score, names in of.items()
    ]


def score_text(score: str, value: float | None) -> str:
    """What tables show of a score: counts are whole numbers."""
    return str(int(value)) if score == "gated" and value is not None else number(value)
