"""Metrics of one or several results as text, JSON, CSV and LaTeX."""

from __future__ import annotations

import csv as csv_module
import io
import math
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hgorun.errors import called
from hgorun.files import json_value
from hgorun.result.data import ObserverResult
from hgorun.result.metrics.base import all_metrics
from hgorun.result.result import Result
from hgorun.result.run_names import run_names
from hgorun.result.status import Verdict
from hgorun.tables.typeset import columns, latex_words, printable, shortened, symbol

_WIDTH = 100  # columns of a terminal
_LABEL = 40  # of them for a label, at most
_PAGE = 6  # numbers side by side on a page


# what theory says of a result's observers: {label: {column: number}}
Predicted = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class _Row:
    """One observer of one result."""

    run: str
    label: str
    text: str
    result: Result
    observer: ObserverResult

    def value(self, metric: str, state: str) -> float | None:
        """None where there is no such number."""
        if metric not in self.observer.metrics or state not in self.result.states:
            return None
        return float(self.observer.metrics[metric][self.result.states.index(state)])

    @property
    def status(self) -> str:
        """The word, and the time with its unit where there is one."""
        return self.observer.verdict.text(printable(self.result.units.get("time", "")))


def _rows(results: Sequence[Result]) -> list[_Row]:
    return [
        _Row(run, label, f"{run}: {label}" if len(results) > 1 else label, result, observer)
        for run, result in zip(run_names(results), results, strict=True)
        for label, observer in result.observers.items()
    ]


def _metrics(rows: Sequence[_Row]) -> list[str]:
    """Those of any row: the known ones in their order, then what only files know."""
    found = dict.fromkeys(metric for row in rows for metric in row.observer.metrics)
    known = [name for name in all_metrics() if name in found]
    return [*known, *(name for name in found if name not in known)]


def _states(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(state for result in results for state in result.states))


def as_json(result: Result, file: str | None = None, predicted: Predicted | None = None) -> dict[str, Any]:
    """A result's metrics as JSON holds them.

    Parameters
    ----------
    result : Result
    file : str, optional
        Where it is stored.
    predicted : mapping, optional
        What theory says of the observers: they have a key ``predicted`` then.

    Returns
    -------
    dict
        ``{"name", "file", "status", "observers": {label: {"status", "status_at", "reason",
        metric: {state: number}}}}``, ``integration_error`` and ``remarks`` where there are any, ``plant`` with its
        status where that is not ok, and an observer's ``coordinates``, where it has a choice of them:
        ``{"map", "chains": {output: length}}``. Numbers that are not finite are text, a time or reason that is not
        known is null.
    """
    observers: dict[str, dict[str, Any]] = {
        label: _said(result.observers[label].verdict) | metrics for label, metrics in result.metrics().items()
    }
    for label, o in result.observers.items():
        if o.coordinates is not None:
            observers[label]["coordinates"] = {"map": o.coordinates.map, "chains": dict(o.coordinates.chains)}
    for label, values in (predicted or {}).items():
        observers[label]["predicted"] = values
    found: dict[str, Any] = {
        "name": result.name,
        "file": file,
        "status": result.status,
        "observers": observers,
    }
    if result.integration_error is not None:
        found["integration_error"] = result.integration_error
    if result.verdict.status != "ok":
        found["plant"] = _said(result.verdict)
    if result.remarks:
        found["remarks"] = list(result.remarks)
    return {key: json_value(value) for key, value in found.items()}


def _said(verdict: Verdict) -> dict[str, str | float | None]:
    return {"status": verdict.status, "status_at": verdict.at, "reason": verdict.reason}


def csv(results: Sequence[Result], predicted: Sequence[Predicted] = ()) -> str:
    """One number a line: name, observer, status, state, metric, value.

    Values have all their digits; what is not finite is ``inf`` or ``nan``. What theory predicts, where it is given
    for each result, follows an observer's metrics, without a state.
    """
    buffer = io.StringIO()
    writer = csv_module.writer(buffer, lineterminator="\n")
    writer.writerow(["name", "observer", "status", "state", "metric", "value"])
    for row in _rows(results):
        for metric, values in row.observer.metrics.items():
            for state, value in zip(row.result.states, values, strict=True):
                writer.writerow([row.run, row.label, row.observer.verdict.text(), state, metric, repr(float(value))])
        for key, prediction in _theory(row, results, predicted).items():
            writer.writerow([row.run, row.label, row.observer.verdict.text(), "", key, repr(float(prediction))])
    return buffer.getvalue()


def text(results: Sequence[Result], predicted: Sequence[Predicted] = ()) -> str:
    """An aligned table for a terminal, at most 100 columns wide.

    Above it stand the windows that the numbers are from, below it the integration error where it is known.
    Metrics that do not fit side by side follow below each other, and after them what theory predicts, where it
    is given for each result.
    """
    rows, runs = _rows(results), run_names(results)
    lines = []
    for run, result in zip(runs, results, strict=True):
        lines += wrapped(": ".join(part for part in (printable(run), printable(result.title)) if part))
        lines += wrapped(_windows(result), "  ")
    for block in (
        _blocks(rows, _states(results), _predictions(rows, results, predicted)) if rows else [["no observers"]]
    ):
        lines += ["", *block]
    for run, result in zip(runs, results, strict=True):
        if result.integration_error is not None:
            start = f"{printable(run)}: " if len(runs) > 1 else ""
            errors = ", ".join(f"{printable(k)} {v:.1e}" for k, v in result.integration_error.items())
            lines += ["", *wrapped(f"{start}integration error: {errors}")]
    return "\n".join(lines)


def _windows(result: Result) -> str:
    """Where the numbers are from."""
    windows, unit = result.windows, printable(result.units.get("time", ""))
    named = {name for o in result.observers.values() for name in o.metrics}
    shown = [metric for metric in all_metrics().values() if metric.name in named or not named]
    groups: dict[str, list[str]] = {}
    for metric in shown:
        groups.setdefault(metric.window, []).append(metric.name)
    parts = [
        f"{', '.join(names)}: {windows[window][0]:g} to {windows[window][1]:g} {unit}".rstrip()
        for window, names in groups.items()
        if window in windows
    ]
    for metric in sorted(shown, key=lambda m: m.setting or ""):
        if metric.setting and metric.setting in windows:
            with called("metric", metric.name, "told"):
                parts.append(f"{metric.name}: {metric.told(windows[metric.setting], unit)}")
    return "; ".join(parts)


def _theory(row: _Row, results: Sequence[Result], predicted: Sequence[Predicted]) -> Mapping[str, float]:
    """What is predicted for a row."""
    found = [p for result, p in zip(results, predicted, strict=False) if result is row.result]
    return found[0].get(row.label, {}) if found else {}


def _predictions(rows: Sequence[_Row], results: Sequence[Result], predicted: Sequence[Predicted]) -> list[list[str]]:
    """Columns of what is predicted."""
    values = [_theory(row, results, predicted) for row in rows]
    keys = dict.fromkeys(key for row in values for key in row)
    return [[key, *(number(row.get(key)) for row in values)] for key in keys]


def _blocks(rows: Sequence[_Row], states: Sequence[str], more: Sequence[Sequence[str]]) -> list[list[str]]:
    """The lines of each part of the table; a metric's states stay together where they fit."""
    groups = [
        [[f"{metric} {s}", *(number(row.value(metric, s)) for row in rows)] for s in states]
        for metric in _metrics(rows)
    ]
    status = ["status", *(row.status for row in rows)]
    return packed([row.text for row in rows], [*groups, [status], *([column] for column in more)])


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
    labels = [title, *(shortened(printable(text), _LABEL) for text in texts)]
    room = _WIDTH - _width(labels)
    blocks: list[list[Sequence[str]]] = [[]]
    for group in groups:
        fits = sum(2 + _width(c) for c in group) <= room
        for part in [list(group)] if fits else [[column] for column in group]:
            if blocks[-1] and sum(2 + _width(column) for column in blocks[-1] + part) > room:
                blocks.append([])
            blocks[-1] += part
    return [aligned(labels, block) for block in blocks]


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


def latex(results: Sequence[Result], metrics: Sequence[str] | None = None) -> str:
    r"""A ``tabular`` for a document that loads the package booktabs.

    The best number of every column is bold: the smallest, for tv the nearest to 1. Metrics that do not fit
    side by side follow below each other; observers that are not ok are named at the end.

    Parameters
    ----------
    results : sequence of Result
    metrics : sequence of str, optional
        Which, in this order; all by default.
    """
    rows, states = _rows(results), _states(results)
    known = _metrics(rows)
    chosen = [metric for metric in (known if metrics is None else metrics) if metric in known]
    at_once = max(_PAGE // max(len(states), 1), 1)
    blocks = [chosen[i : i + at_once] for i in range(0, len(chosen), at_once)] or [[]]
    width = len(blocks[0]) * len(states)
    lines = [rf"\begin{{tabular}}{{l{'r' * width}}}", r"\toprule"]
    for block in blocks:
        padding = [""] * (width - len(block) * len(states))
        lines += [*([r"\midrule"] if block is not blocks[0] else []), *latex_head(block, states, padding)]
        numbers = {(metric, s): [row.value(metric, s) for row in rows] for metric in block for s in states}
        best = {column: _best(column[0], values) for column, values in numbers.items()}
        for i, row in enumerate(rows):
            cells = [_latex_number(values[i], best[column]) for column, values in numbers.items()]
            lines.append(" & ".join([latex_words(row.text), *cells, *padding]) + r" \\")
    lost = "; ".join(latex_words(f"{row.text} {row.status}") for row in rows if row.observer.status != "ok")
    if lost:
        lines += [r"\midrule", rf"\multicolumn{{{width + 1}}}{{l}}{{{lost}}} \\"]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def latex_head(metrics: Sequence[str], states: Sequence[str], padding: Sequence[str]) -> list[str]:
    """The lines above the rows: metrics, and below each of them the states; then so many empty columns."""
    n = len(states)
    if not metrics:
        return [r"\midrule"]
    above = [rf"\multicolumn{{{n}}}{{c}}{{{latex_words(metric)}}}" for metric in metrics]
    rules = [rf"\cmidrule(lr){{{2 + i * n}-{1 + (i + 1) * n}}}" for i in range(len(metrics))]
    below = [f"${symbol(state)}$" for _ in metrics for state in states]
    return [
        " & ".join(["", *above, *padding]) + r" \\", " ".join(rules),
        " & ".join(["", *below, *padding]) + r" \\", r"\midrule",
    ]  # fmt: skip


def _best(metric: str, values: Sequence[float | None]) -> str | None:
    """The best number as printed; None where nothing is compared."""
    finite = [value for value in values if value is not None and math.isfinite(value)]
    if not finite or len(set(map(number, values))) < 2:
        return None
    known = all_metrics().get(metric)
    ideal = known.ideal if known else 0.0
    return number(min(finite, key=lambda v: abs(math.log(v / ideal)) if ideal and v > 0 else v))


def _latex_number(value: float | None, best: str | None) -> str:
    if value is None or math.isnan(value):
        return "--"
    if math.isinf(value):
        return r"$\infty$" if value > 0 else r"$-\infty$"
    shown = re.sub(r"e([-+])0*(\d+)", lambda m: rf" \times 10^{{{m[1].strip('+')}{m[2]}}}", number(value))
    return rf"$\mathbf{{{shown}}}$" if number(value) == best else f"${shown}$"
