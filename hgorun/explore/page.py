"""The report of an ensemble: one HTML page that holds everything it shows, with figures to zoom and tables to sort."""

from __future__ import annotations

from collections.abc import Sequence
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
_COLUMN = 70  # pixels that a column of a table has at least: where the page is narrower, the table is scrolled
_STYLE = """
:root { color-scheme: light; background: #fff; }
main { overflow-wrap: anywhere; box-sizing: border-box; }
main { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1300px; margin: 0 auto; padding: 1em 1.5em; }
h1 { font-size: 1.6em; margin-bottom: 0.2em; } h2 { font-size: 1.15em; margin: 1.6em 0 0.4em; }
p.note { color: #555; font-size: 0.9em; }
.part { overflow-x: auto; max-width: 100%; } :focus-visible { outline: 3px solid #00517f; outline-offset: 2px; }
"""
# Tabs and heads of columns are reached with Tab and answer to Enter and the space bar; both are drawn as one scrolls.
# What scrolls in a table takes the focus, too: its rim is inside, since all else is cut off there.
_KEYBOARD = """{
const reach = () => {
  const parts = [...document.querySelectorAll('.part')];
  for (const one of parts.flatMap((part) => label_parts(part, part.getAttribute('aria-label')))) {
    if (one.dataset.reached || !one.matches('.bk-data-table, .bk-tab, .slick-header-column')) continue;
    one.dataset.reached = 'yes';
    if (one.matches('.bk-data-table')) {  // Tab would go from cell to cell, and keep a keyboard inside
      one.addEventListener('keydown', (event) => { if (event.key === 'Tab') event.stopPropagation(); }, true);
      for (const sink of one.querySelectorAll('[hidefocus]')) sink.tabIndex = -1;  // which show no focus
      continue;
    }
    one.tabIndex = 0;
    one.setAttribute('role', one.classList.contains('bk-tab') ? 'tab' : 'button');
    one.addEventListener('keydown', (event) => {
      if (event.key !== 'Enter' && event.key !== ' ') return;
      event.preventDefault();
      one.click();
      setTimeout(reach, 300);
    });
  }
};
setInterval(reach, 1000);
}"""
# Four significant digits, as tables in a terminal have them; a column is sorted by the numbers themselves.
_NUMBER = """<%- value == null || isNaN(value) ? "-" : !isFinite(value) ? (value > 0 ? "inf" : "-inf")
  : value == 0 ? "0" : Math.abs(value) < 1e-4 || Math.abs(value) >= 1e5 ? value.toExponential(3)
  : Math.abs(value) >= 1e4 ? value.toFixed(0) : value.toPrecision(4) %>"""
_TEMPLATE = """
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">
<style>{{ style }}</style>{% endblock %}
{% block contents %}
<main>
<h1>{{ title }}</h1>
{% for line in lines %}<div>{{ line }}</div>{% endfor %}
{% for heading, note in sections %}
<h2>{{ heading }}</h2>{% if note %}<p class="note">{{ note }}</p>{% endif %}
<div class="part" role="region" tabindex="0" aria-label="{{ heading }}">{{ embed(roots[loop.index0]) }}</div>
{% endfor %}
<p class="note">hgorun {{ version }}</p>
</main>
<script>{{ keyboard }}</script>
{% endblock %}
"""


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
    lines = summary(found)
    values = {
        "style": _STYLE,
        "keyboard": (files("hgorun.explore") / "labels.js").read_text(encoding="utf-8") + _KEYBOARD,
        "lines": [escape(line) for line in lines[1:]],
        "sections": [(escape(heading), escape(note)) for heading, note, _ in sections],
        "version": __version__,
    }
    html = file_html(
        [content for *_, content in sections],
        resources=INLINE,
        title=lines[0],
        template=_TEMPLATE,
        template_variables=values,
        suppress_callback_warning=True,
    )
    write_text(path, html)
    return path


def _sections(found: Compared) -> list[tuple[str, str, Any]]:
    """Heading, note and content of every part of the page."""
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
    from bokeh.layouts import row
    from bokeh.models import TabPanel, Tabs

    from hgorun.explore import drawing

    cast = Cast(members)
    states = members.states[:_MOST_STATES]
    found: list[tuple[str, str, Any]] = []

    def tabs(contents: dict[str, list[Any]]) -> Any:
        panels = [
            TabPanel(child=row(plots, sizing_mode="scale_width"), title=title) for title, plots in contents.items()
        ]
        return Tabs(tabs=panels, sizing_mode="stretch_width")

    for axis in members.chosen:
        note = f"Medians, 50 % and 90 % of the members{_pooled(members, [axis])}. A click on a name hides an observer."
        found.append(
            (f"Against {axis}", note, tabs({m: [drawing.against(cast, axis, m, s) for s in states] for m in metrics}))
        )
    if not members.chosen:
        note = "Median, 50 % and 90 % of the members."
        found.append(("Spread", note, tabs({m: [drawing.boxes(cast, m, s) for s in states] for m in metrics})))
    if len(members.chosen) == 2:
        axes = (members.chosen[0], members.chosen[1])
        contents = {f"{m} {s}": drawing.heat_maps(cast, axes, m, s) for m in metrics for s in states}
        found.append(
            (
                "Maps",
                f"Medians{_pooled(members, axes)}; grey: most members are lost, or there are none.",
                tabs(contents),
            )
        )
    if members.gains and all(metric in metrics for metric in _PAID):
        contents = {s: [drawing.trade_off(cast, _PAID, s)] for s in states}
        each = ", ".join(short_axis(axis, members.grid) for axis in members.surroundings)
        note = "Medians over random draws; lines: fronts" + (f", one for each {each}." if each else ".")
        found.append(("Settling time against noise amplification", note, tabs(contents)))
    if members.trajectories is not None and len(members.trajectories.member) > 1:
        contents = {s: [drawing.along_time(cast, s, error=e) for e in (False, True)] for s in states}
        kept = f"{len(members.trajectories.member)} members that were kept{_pooled(members, [])}"
        note = f"Medians, 50 % and 90 % of the {kept}."
        found.append(("Along time", note, tabs(contents)))
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

    shown = [TableColumn(field=name, title=name, **formatted(values)) for name, values in columns.items()]
    height = min(28 * (len(next(iter(columns.values()))) + 1) + 4, 420)
    return DataTable(
        source=ColumnDataSource(columns), columns=shown, height=height, sizing_mode="stretch_width", sortable=True,
        index_position=None, reorderable=False, min_width=_COLUMN * len(columns),
    )  # fmt: skip
