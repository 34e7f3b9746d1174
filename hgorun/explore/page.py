"""The report of an ensemble: one HTML page that holds everything it shows, with figures to zoom and tables to sort."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from hgorun.ensemble.collected.collected import Collected
from hgorun.errors import HgorunError
from hgorun.figures.bands import words_of_lost_along
from hgorun.figures.ensemble import Cast, places
from hgorun.figures.fronts import words_of_lost_points
from hgorun.figures.spread import words_of_lost_at
from hgorun.files import write_text
from hgorun.tables.axis_names import bracketed, short_axis, unit_of_axis
from hgorun.tables.ensemble import Compared, said_of_errors, said_of_numbers, summary
from hgorun.version import __version__

_PAID = ("hf", "settling")
_MOST_STATES = 8
_WRAPPED = {"flex-wrap": "wrap"}  # figures that have no room beside each other stand one below the other


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
    from hgorun.explore import statistics

    note = (
        "A click on a column's head sorts. mean, ± (half the 95 % interval) and sem (standard error) are over members "
        "that are ok or inaccurate; lost is the number of the others, which count as infinite in quantiles"
    )
    note = ". ".join([note, *said_of_numbers(found), *said_of_errors(members)]) + "."
    sections: list[tuple[str, str, Any]] = [("Statistics", note, statistics.of_observers(found))]
    if any(part.differences for part in found.parts):
        note = (
            "The same members, so the same noise, for both observers; ± is half the 95 % interval of the mean; p after "
            "Holm for all pairs of a metric and state."
        )
        sections.append(("Paired differences", note, statistics.of_pairs(found)))
    return sections + _figures(members, list(dict.fromkeys(metric for _, metric, _ in found.whole.summaries)))


def _figures(members: Collected, metrics: Sequence[str]) -> list[tuple[str, str, Any]]:
    from hgorun.explore import drawing

    cast = Cast(members)
    states = members.states[:_MOST_STATES]
    found: list[tuple[str, str, Any]] = []

    for axis in members.chosen:
        at, whose = places(members.axes[axis])
        said = _pooled(members, [axis]) + words_of_lost_at(members, whose, len(at), metrics)
        note = f"Medians, 50 % and 90 % of the members{said}. A click on a name hides an observer."
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
                f"Medians{_pooled(members, axes)}; grey: most members are lost or never settle, or there are none.",
                contents,
            )
        )
    if members.gains and all(metric in metrics for metric in _PAID):
        contents = {s: [drawing.trade_off(cast, _PAID, s)] for s in states}
        each = ", ".join(short_axis(axis, members.grid) for axis in members.surroundings)
        note = "Medians over random draws; lines: fronts" + (f", one for each {each}" if each else "")
        note += f"{words_of_lost_points(members, _PAID)}."
        found.append(("Settling time against noise amplification", note, contents))
    if members.trajectories is not None and len(members.trajectories.member) > 1:
        contents = {s: [drawing.along_time(cast, s, error=e) for e in (False, True)] for s in states}
        said = _pooled(members, []) + words_of_lost_along(members, drawing.step_along(len(members.trajectories.time)))
        note = f"Medians, 50 % and 90 % of the {len(members.trajectories.member)} members that were kept{said}."
        found.append(("Along time", note, contents))
    return found


def _pooled(members: Collected, drawn: Sequence[str]) -> str:
    """What is said of axes that were chosen, and that a figure shows together."""
    names = [
        short_axis(axis, members.grid) + bracketed(unit_of_axis(axis, members.units))
        for axis in members.grid
        if axis not in drawn
    ]
    return f", over all values of {', '.join(names)}" if names else ""
