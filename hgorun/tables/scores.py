"""Scores of estimates of recorded data as columns of a table."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.tables.layout import number
from hgorun.tables.rows import Row


def scores_of(rows: Sequence[Row]) -> list[list[list[str]]]:
    """For each score the columns of all that it is of: outputs, states or gains; nothing for simulated plants."""
    return [
        [[f"{score} {name}", *(score_text(score, score_of(row, score, name)) for row in rows)] for name in names]
        for score, names in names_of_scores(rows).items()
    ]


def names_of_scores(rows: Sequence[Row]) -> dict[str, list[str]]:
    """For each score all that it is of."""
    of: dict[str, dict[str, None]] = {}
    for row in rows:
        for score, values in row.observer.assessed.scores.items() if row.observer.assessed else ():
            of.setdefault(score, {}).update(dict.fromkeys(values))
    return {score: list(names) for score, names in of.items()}


def score_of(row: Row, score: str, name: str) -> float | None:
    """A score of an observer, where it has that one."""
    return row.observer.assessed.scores.get(score, {}).get(name) if row.observer.assessed else None


def score_text(score: str, value: float | None) -> str:
    """What tables show of a score: counts are whole numbers."""
    return str(int(value)) if score == "gated" and value is not None else number(value)
