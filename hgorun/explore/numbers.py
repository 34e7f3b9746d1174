"""Numbers of a page as they are shown, and all their digits: metrics, scores, and what the theory says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hgorun.explore.promises import Promise
from hgorun.result.metrics.base import all_metrics
from hgorun.result.result import Result
from hgorun.tables.layout import number
from hgorun.tables.rows import metrics_of, rows_of
from hgorun.tables.scores import score_text


@dataclass(frozen=True)
class Cell:
    """A number as it is shown, and all its digits."""

    text: str
    digits: str


@dataclass(frozen=True)
class Row:
    """A line of the table: an observer, what has become of it, its metrics."""

    label: str
    status: str
    reason: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Table:
    """Metrics of all observers: a column for every metric of every state."""

    columns: tuple[str, ...] = ()
    meanings: tuple[str, ...] = ()
    rows: tuple[Row, ...] = ()


def metrics_table(result: Result) -> Table:
    rows = rows_of([result])
    known = all_metrics(closed=True)
    columns = [(metric, state) for metric in metrics_of(rows) for state in result.states]
    return Table(
        columns=tuple(f"{metric} {state}" for metric, state in columns),
        meanings=tuple(known[metric].meaning if metric in known else "" for metric, _ in columns),
        rows=tuple(
            Row(
                label=row.label,
                status=row.status,
                reason=row.observer.reason or "",
                cells=tuple(_cell(row.value(metric, state), row.text_of(metric, state)) for metric, state in columns),
            )
            for row in rows
        ),
    )


def scores_table(result: Result) -> Table:
    """What is said of estimates without a truth; a column for each score of each output, state or gain."""
    scores = {label: one.assessed.scores if one.assessed else {} for label, one in result.observers.items()}
    columns = list(dict.fromkeys((score, of) for own in scores.values() for score, each in own.items() for of in each))
    return Table(
        columns=tuple(f"{score} {of}" for score, of in columns),
        meanings=tuple("" for _ in columns),
        rows=tuple(
            Row(
                label=row.label,
                status=row.status,
                reason=row.observer.reason or "",
                cells=tuple(
                    _cell(value := scores[row.label].get(score, {}).get(of), score_text(score, value))
                    for score, of in columns
                ),
            )
            for row in rows_of([result])
        ),
    )


def _cell(value: float | None, text: str | None = None) -> Cell:
    """A number with all its digits, under a text that tables show in its place, if any."""
    return Cell(number(value) if text is None else text, "" if value is None else repr(value))


def promised_cells(promises: Mapping[str, Promise], names: Sequence[str]) -> dict[str, dict[str, dict[str, Cell]]]:
    """Numbers of the theory by observer, finding and state."""
    return {
        label: {
            name: {state: _cell(value) for state, value in promise.numbers[name].items()}
            for name in names
            if name in promise.numbers
        }
        for label, promise in promises.items()
    }
