"""The report of an ensemble: one HTML page that holds everything it shows, with figures to zoom and tables to sort."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from hgorun.ensemble.collected import Collected
from hgorun.ensemble.statistics import Statistics
from hgorun.errors import HgorunError
from hgorun.figures.ensemble import Cast
from hgorun.files import write_text
from hgorun.tables.axis_names import short_axis
from hgorun.tables.ensemble import NUMBERS, Compared, summary
from hgorun.version import __version__

_PAID = ("hf", "settling")
_MOST_STATES, _MOST_ROWS = 8, 20_000
_WRAPPED = {"flex-wrap": "wrap"}  # figures that have no room beside each other stand one below the other
# Pixels of a column: of numbers with four digits, of one beside its characters, of each of them; of any at most.
_NUMBERS, _RIMS, _CHARACTER, _WIDEST = 88, 24, 7, 300
# Four significant digits, as tables in a terminal have them; a column is sorted by the numbers themselves.
_NUMBER = """<%- value == null || isNaN(value) ? "-" : !isFinite(value) ? (value > 0 ? "inf" : "-inf")
  : value == 0 ? "0" : Math.abs(value) < 1e-4 || Math.abs(value) >= 1e5 ? value.toExponential(3)
  : Math.abs(value) >= 1e4 ? value.toFixed(0) : value.toPrecision(4) %>"""


def write_page(found: Compared, path: Path) -> Path:
    """Write the report of an ensemble.

    Parameters
    ----------
    found : Compared
        The ensemble with its statistics.
    path : Path
        An HTML file. Its folder is made when missing.

    Raises
    ------
    HgorunError
        When bokeh is missing, or the file cannot be written.
    """
    try:
        from bokeh.embed import file_html
        from bokeh.resources import INLINE
    except ImportError as error:
        raise HgorunError("a report needs the package bokeh: pip install 'hgorun[explore]'") from error
    sections = _sections(found)
    tables = [content for *_, content in sections if not isinstance(content, dict)]
    lines = summary(found)
    values = {
        "style": _read("report.css"),
        "script": "".join(_read(f"{name}.js") for name in ("labels", "scheme", "report")),
        "lines": [escape(line) for line in lines[1:]],
        "sections": [
            {
                "heading": escape(heading),
                "note": escape(note),
                "root": None if isinstance(content, dict) else tables.index(content),
                "tabs": _tabs(content) if isinstance(content, dict) else [],
            }
            for heading, note, content in sections
        ],
        "version": __version__,
    }
    html = file_html(
        tables,
        resources=INLINE,
        title=lines[0],
        template=_read("report.html"),
        template_variables=values,
        suppress_callback_warning=True,
    )
    write_text(path, html)
    return path


def _read(name: str) -> str:
    return (files("hgorun.explore") / name).read_text(encoding="utf-8")


def _tabs(contents: Mapping[str, list[Any]]) -> list[dict[str, str]]:
    """Title and figures of every tab, as text from which the page makes these once they are in sight."""
    from bokeh.core.json_encoder import serialize_json
    from bokeh.embed import json_item
    from bokeh.layouts import row

    rows = {title: row(plots, sizing_mode="scale_width", styles=_WRAPPED) for title, plots in contents.items()}
    return [
        {"title": escape(title), "figures": serialize_json(json_item(one)).replace("<", "\\u003c")}
        for title, one in rows.items()
    ]


def _sections(found: Compared) -> list[tuple[str, str, Any]]:
    """Heading, note and content of every part of the page: a table, or the figures of every tab by its title."""
    members = found.members
    sections = [
        (
            "Statistics",
            "A click on a column's head sorts. mean, ± (half the 95 % interval) and sem (standard error) are over "
            "members that are ok or inaccurate; in quantiles a lost estimate counts as infinite.",
            _table(_statistics(found)),
        )
    ]
    differences = _differences(found)
    if differences["observers"]:
        note = (
            "The same members, so the same noise, for both observers; p after Holm for all pairs of a metric and state."
        )
        sections.append(("Paired differences", note, _table(differences)))
    return sections + _figures(members, list(dict.fromkeys(metric for _, metric, _ in found.whole.summaries)))


def _figures(members: Collected, metrics: Sequence[str]) -> list[tuple[str, str, Any]]:
    from hgorun.explore import drawing

    cast = Cast(members)
    states = members.states[:_MOST_STATES]
    found: list[tuple[str, str, Any]] = []

    for axis in members.chosen:
        note = f"Medians, 50 % and 90 % of the members{_pooled(members, [axis])}. A click on a name hides an observer."
        found.append(
            (f"Against {axis}", note, {m: [drawing.against(cast, axis, m, s) for s in states] for m in metrics})
        )
    if not members.chosen:
        note = "Median, 50 % and 90 % of the members."
        found.append(("Spread", note, {m: [drawing.boxes(cast, m, s) for s in states] for m in metrics}))
    if len(members.chosen) == 2:
        axes = (members.chosen[0], members.chosen[1])
        contents = {f"{m} {s}": drawing.heat_maps(cast, axes, m, s) for m in metrics for s in states}
        found.append(
            (
                "Maps",
                f"Medians{_pooled(members, axes)}; grey: most members are lost, or there are none.",
                contents,
            )
        )
    if members.gains and all(metric in metrics for metric in _PAID):
        contents = {s: [drawing.trade_off(cast, _PAID, s)] for s in states}
        each = ", ".join(short_axis(axis, members.grid) for axis in members.surroundings)
        note = "Medians over random draws; lines: fronts" + (f", one for each {each}." if each else ".")
        found.append(("Settling time against noise amplification", note, contents))
    if members.trajectories is not None and len(members.trajectories.member) > 1:
        contents = {s: [drawing.along_time(cast, s, error=e) for e in (False, True)] for s in states}
        kept = f"{len(members.trajectories.member)} members that were kept{_pooled(members, [])}"
        note = f"Medians, 50 % and 90 % of the {kept}."
        found.append(("Along time", note, contents))
    return found


def _pooled(members: Collected, drawn: Sequence[str]) -> str:
    """What is said of axes that were chosen, and that a figure shows together."""
    names = [short_axis(axis, members.grid) for axis in members.grid if axis not in drawn]
    return f", over all values of {', '.join(names)}" if names else ""


def _statistics(found: Compared) -> dict[str, list[Any]]:
    """Columns of the table of statistics: values on axes, observer, state, metric, numbers."""
    rows = []
    for part in found.parts:
        for (label, metric, state), s in part.summaries.items():
            rows.append(
                {
                    **_at(part, found),
                    "observer": label,
                    "state": state,
                    "metric": metric,
                    "n": s.n,
                    "lost": part.failed(label),
                    "mean": s.mean,
                    "±": s.half,
                    **{name: getattr(s, name) for name in NUMBERS if name != "mean"},
                }
            )
    return _columns(rows)


def _differences(found: Compared) -> dict[str, list[Any]]:
    rows = []
    for part in found.parts:
        for d in part.differences:
            low, high = d.ci95
            rows.append(
                {
                    **_at(part, found),
                    "observers": f"{d.a} - {d.b}",
                    "state": d.state,
                    "metric": d.metric,
                    "n": d.n,
                    "mean": d.mean,
                    "low": low,
                    "high": high,
                    "p": d.p_holm,
                }
            )
    return _columns(rows) or {"observers": []}


def _at(part: Statistics, found: Compared) -> dict[str, Any]:
    return {short_axis(axis, found.by): value for axis, value in part.at.items()}


def _columns(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    kept = rows[:_MOST_ROWS]
    return {name: [r[name] for r in kept] for name in kept[0]} if kept else {}


def _table(columns: dict[str, list[Any]]) -> Any:
    """A table that sorts by the column whose head is clicked."""
    from bokeh.models import ColumnDataSource, DataTable, HTMLTemplateFormatter, TableColumn

    def formatted(values: list[Any]) -> dict[str, Any]:
        if all(isinstance(value, float) for value in values):
            return {"formatter": HTMLTemplateFormatter(template=_NUMBER)}
        return {}

    widths = {name: _width(name, values) for name, values in columns.items()}
    shown = [TableColumn(field=n, title=n, width=widths[n], **formatted(values)) for n, values in columns.items()]
    height, width = min(28 * (len(next(iter(columns.values()))) + 1) + 4, 420), sum(widths.values()) + _RIMS
    return DataTable(
        source=ColumnDataSource(columns), columns=shown, height=height, width=width, sortable=True,
        index_position=None, reorderable=False, sizing_mode="fixed", autosize_mode="none",
    )  # fmt: skip


def _width(name: str, values: Sequence[Any]) -> int:
    """Of a column, so that what stands in it is seen to its end; where the page is narrower, the table is scrolled."""
    longest = max(map(len, [name, *{str(value) for value in values if not isinstance(value, float)}]))
    least = _NUMBERS if any(isinstance(value, float) for value in values) else 0
    return min(max(least, _CHARACTER * longest + _RIMS), _WIDEST)
