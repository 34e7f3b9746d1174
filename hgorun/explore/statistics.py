"""The tables of a report, which a click on a column's head sorts. This module imports bokeh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.models import ColumnDataSource, DataTable, HTMLTemplateFormatter, TableColumn

from hgorun.ensemble.statistics.statistics import Statistics
from hgorun.result.metrics.base import unit_of
from hgorun.tables.axis_names import bracketed, short_axis, unit_of_axis
from hgorun.tables.ensemble import NUMBERS, Compared, known_of, mean_and_half_of
from hgorun.tables.typeset import printable
from hgorun.tables.uncertain import mean_and_half

_MOST_ROWS = 20_000
# Pixels of a column: of numbers with four digits, of one beside its characters, of each of them; of any at most.
_NUMBERS, _RIMS, _CHARACTER, _WIDEST = 88, 24, 7, 300
# Four significant digits, as tables in a terminal have them; a column is sorted by the numbers themselves.
_NUMBER = """<%- value == null || isNaN(value) ? "-" : !isFinite(value) ? (value > 0 ? "inf" : "-inf")
  : value == 0 ? "0" : Math.abs(value) < 1e-4 || Math.abs(value) >= 1e5 ? value.toExponential(3)
  : Math.abs(value) >= 1e4 ? value.toFixed(0) : value.toPrecision(4) %>"""

_TEXT = " as text"  # a column that is sorted by numbers shows the texts of the column of this name


def of_observers(found: Compared) -> DataTable:
    """Statistics of every observer, state and metric: values on axes, observer, state, metric, unit, numbers."""
    rows = []
    for part in found.parts:
        for label, metric, state in part.summaries:
            known = known_of(part, label, metric, state)
            rows.append(
                {
                    **_at(part, found),
                    "observer": label,
                    **_what(found, metric, state),
                    "n": part.summaries[label, metric, state].n,
                    "lost": part.failed(label),
                    "never": part.without.get((label, metric, state), 0),
                    "mean": known.mean,
                    "±": known.half,
                    **{name: getattr(known, name) for name in NUMBERS if name != "mean"},
                    **_texts(*mean_and_half_of(part, label, metric, state)),
                }
            )
    return _table(rows)


def of_pairs(found: Compared) -> DataTable:
    """Differences of every pair of observers; none of times that have none in at least half of the members."""
    rows = []
    for part in found.parts:
        for d in part.differences:
            none = part.has_none(d.metric, d.state, d.a, d.b)
            mean, half, p = (float("nan"),) * 3 if none else (d.mean, d.half, d.p_holm)
            rows.append(
                {
                    **_at(part, found),
                    "observers": f"{d.a} - {d.b}",
                    **_what(found, d.metric, d.state),
                    "n": d.n,
                    "mean": mean,
                    "±": half,
                    "p": p,
                    **_texts(*mean_and_half(mean, half)),
                }
            )
    return _table(rows)


def _at(part: Statistics, found: Compared) -> dict[str, Any]:
    units = found.members.units
    return {short_axis(axis, found.by) + bracketed(unit_of_axis(axis, units)): value for axis, value in part.at.items()}


def _what(found: Compared, metric: str, state: str) -> dict[str, str]:
    return {"state": state, "metric": metric, "unit": printable(unit_of(metric, state, found.members.units))}


def _texts(mean: str, half: str) -> dict[str, str]:
    """So many digits as a table in a terminal has."""
    return {f"mean{_TEXT}": mean, f"±{_TEXT}": half}


def _table(rows: Sequence[Mapping[str, Any]]) -> DataTable:
    """A table that sorts by the column whose head is clicked."""
    kept = rows[:_MOST_ROWS]
    columns = {name: [row[name] for row in kept] for name in kept[0]}
    for name in ("unit", "never"):
        if not any(columns.get(name, [True])):
            del columns[name]
    shown = {name: values for name, values in columns.items() if not name.endswith(_TEXT)}
    widths = {name: _width(name, columns.get(name + _TEXT, values)) for name, values in shown.items()}
    return DataTable(
        source=ColumnDataSource(columns),
        columns=[TableColumn(field=n, title=n, width=widths[n], **_format(n, columns)) for n in shown],
        height=min(28 * (len(kept) + 1) + 4, 420),
        width=sum(widths.values()) + _RIMS,
        sortable=True,
        index_position=None,
        reorderable=False,
        sizing_mode="fixed",
        autosize_mode="none",
    )


def _format(name: str, columns: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """How the cells of a column are written, where not as they are."""
    if name + _TEXT in columns:
        return {"formatter": HTMLTemplateFormatter(template=f'<%- obj["{name + _TEXT}"] %>')}
    if all(isinstance(value, float) for value in columns[name]):
        return {"formatter": HTMLTemplateFormatter(template=_NUMBER)}
    return {}


def _width(name: str, values: Sequence[Any]) -> int:
    """Of a column, so that what stands in it is seen to its end; where the page is narrower, the table is scrolled."""
    longest = max(map(len, [name, *{str(value) for value in values if not isinstance(value, float)}]))
    least = _NUMBERS if any(isinstance(value, float) for value in values) else 0
    return min(max(least, _CHARACTER * longest + _RIMS), _WIDEST)
