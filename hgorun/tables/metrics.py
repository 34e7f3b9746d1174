"""Metrics of one or several results as text, JSON and CSV."""

from __future__ import annotations

import csv as csv_module
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from hgorun.errors import called
from hgorun.files import json_value
from hgorun.result.metrics.base import Metric, all_metrics, unit_of, unit_of_score
from hgorun.result.metrics.smoothness import HF
from hgorun.result.quantities.quantity_values import without_mean
from hgorun.result.records.status import Verdict
from hgorun.result.result import Result
from hgorun.result.run_names import run_names
from hgorun.tables.axis_names import bracketed
from hgorun.tables.layout import number, packed, wrapped
from hgorun.tables.loops import loop_blocks, loop_numbers
from hgorun.tables.rows import UNRESOLVED, Row, metrics_of, rows_of, states_of
from hgorun.tables.scores import scores_of
from hgorun.tables.typeset import printable, time_unit

# what theory says of a result's observers: {label: {column: number}}
Predicted = Mapping[str, Mapping[str, float]]


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
        status where that is not ok, ``units`` where some are known: ``{"time" or name: unit}``, and
        ``coordinates`` of an observer, where it has a choice of them: ``{"map", "chains": {output: length}}``, and
        ``unresolved``, where errors are less certain than the bound that they settle below: ``{metric: [state]}``.
        Numbers that are not finite are text, a time or reason that is not known is null. A closed loop has
        ``closed_loop``: ``{label: {"effort": {input: number}, "peak_input": {input: number}, "cost": number}}``, with
        the label ``plant`` for state feedback. An estimate of recorded data has ``kind``, ``time_origin`` where the
        log has dates, and its observers have ``scores``: ``{score: {output, state or gain: number}}``.
    """
    observers: dict[str, dict[str, Any]] = {
        label: _said(result.observers[label].verdict) | metrics for label, metrics in result.metrics().items()
    }
    for label, o in result.observers.items():
        if o.assessed is not None:
            observers[label]["scores"] = {name: dict(values) for name, values in o.assessed.scores.items()}
        if o.coordinates is not None:
            observers[label]["coordinates"] = {"map": o.coordinates.map, "chains": dict(o.coordinates.chains)}
    for label, unresolved in result.unresolved.items():
        observers[label]["unresolved"] = {metric: list(states) for metric, states in unresolved.items()}
    for label, values in (predicted or {}).items():
        observers[label]["predicted"] = values
    found: dict[str, Any] = {
        "name": result.name,
        "file": file,
        "status": result.status,
        "observers": observers,
    }
    if result.kind != "simulation":
        found["kind"] = result.kind
    if result.recorded is not None and result.recorded.time_origin:
        found["time_origin"] = result.recorded.time_origin
    if result.integration_error is not None:
        found["integration_error"] = result.integration_error
    if result.closed_loop:
        found["closed_loop"] = {label: loop_numbers(result, label) for label in result.closed_loop}
    if result.verdict.status != "ok":
        found["plant"] = _said(result.verdict)
    if result.remarks:
        found["remarks"] = list(result.remarks)
    if any(result.units.values()):
        found["units"] = dict(result.units)
    return {key: json_value(value) for key, value in found.items()}


def _said(verdict: Verdict) -> dict[str, str | float | None]:
    return {"status": verdict.status, "status_at": verdict.at, "reason": verdict.reason}


def csv(results: Sequence[Result], predicted: Sequence[Predicted] = ()) -> str:
    """One number a line: name, observer, status, state, metric, value, unit, note.

    Values have all their digits; what is not finite is ``inf`` or ``nan``. What theory predicts, where it is given
    for each result, follows an observer's metrics, without a state. Units that are not known are empty, and so is the
    note but for times that the integration does not resolve: ``not resolved``.
    """
    buffer = io.StringIO()
    writer = csv_module.writer(buffer, lineterminator="\n")
    writer.writerow(["name", "observer", "status", "state", "metric", "value", "unit", "note"])
    for row in rows_of(results):
        start, units = [row.run, row.label, row.status], row.result.units
        unresolved = row.result.unresolved.get(row.label, {})
        for metric, values in row.observer.metrics.items():
            for state, value in zip(row.result.states, values, strict=True):
                note = "not resolved" if state in unresolved.get(metric, ()) else ""
                writer.writerow([*start, state, metric, repr(float(value)), unit_of(metric, state, units), note])
        assessed = row.observer.assessed
        for score, of in assessed.scores.items() if assessed else ():
            for name, value in of.items():
                writer.writerow([*start, name, score, repr(float(value)), unit_of_score(score, name, units), ""])
        for key, prediction in _theory(row, results, predicted).items():
            writer.writerow([*start, "", key, repr(float(prediction)), _unit_of_theory(key, time_unit(units)), ""])
    return buffer.getvalue()


def text(results: Sequence[Result], predicted: Sequence[Predicted] = ()) -> str:
    """An aligned table, as wide as the terminal.

    Above it stand the windows that the numbers are from, below it the integration error where it is known.
    Metrics that do not fit side by side follow below each other, and after them what theory predicts, where it
    is given for each result.
    """
    rows, runs = rows_of(results), run_names(results)
    lines = []
    for run, result in zip(runs, results, strict=True):
        lines += wrapped(": ".join(part for part in (printable(run), printable(result.title)) if part))
        lines += wrapped(_windows(result), "  ")
        lines += wrapped(_units(result), "  ")
    for block in (
        _blocks(rows, states_of(results), _predictions(rows, results, predicted)) if rows else [["no observers"]]
    ):
        lines += ["", *block]
    still = _without_motion(rows)
    lines += ["", *wrapped(still)] if still else []
    noisy = _noisy(rows)
    lines += ["", *wrapped(noisy)] if noisy else []
    unresolved = _unresolved(rows)
    lines += ["", *wrapped(unresolved)] if unresolved else []
    for run, result in zip(runs, results, strict=True):
        if result.closed_loop:
            lines += ["", *wrapped(run)] if len(runs) > 1 else []
            for block in loop_blocks(result):
                lines += ["", *block]
        if result.integration_error is not None:
            start = f"{printable(run)}: " if len(runs) > 1 else ""
            errors = ", ".join(f"{printable(k)} {v:.1e}" for k, v in result.integration_error.items())
            lines += ["", *wrapped(f"{start}integration error: {errors}")]
    return "\n".join(lines)


def _windows(result: Result) -> str:
    """Where the numbers are from."""
    windows, unit = result.windows, time_unit(result.units)
    named = {name for o in result.observers.values() for name in o.metrics}
    shown = [metric for metric in all_metrics(closed=True).values() if metric.name in named or not named]
    groups: dict[str, list[str]] = {}
    for metric in shown:
        groups.setdefault(metric.window, []).append(metric.name)
    parts = [
        f"{', '.join(names)}: {_rounded(*windows[window])} {unit}".rstrip()
        for window, names in groups.items()
        if window in windows
    ]
    for metric in sorted(shown, key=lambda m: m.setting or ""):
        if metric.setting and metric.setting in windows:
            with called("metric", metric.name, "told"):
                told = metric.told(windows[metric.setting], unit)
            if metric is HF and without_mean(result):
                told += ", no longer than a step, so that hf is 0 whatever the error is: set metrics.average"
            parts.append(f"{metric.name}: {told}" + _in_time(metric, unit))
        elif metric.unit == "time" and unit and metric.name in named:
            parts.append(metric.name + _in_time(metric, unit))
    return "; ".join(parts)


def _in_time(metric: Metric, unit: str) -> str:
    """Of a time what it is counted in."""
    return f", in {unit}" if metric.unit == "time" and unit else ""


def _rounded(start: float, end: float) -> str:
    """A window as people write it: to a thousandth of its length, or better."""
    decimals = 3 - math.floor(math.log10(end - start)) if end > start else 6
    return " to ".join(f"{round(time, max(decimals, 0)):.12g}" for time in (start, end))


def _without_motion(rows: Sequence[Row]) -> str:
    """Which ratios have no value, and why; nothing where all have one."""
    found = dict.fromkeys(
        f"{metric} {state}"
        for row in rows
        for metric in row.observer.metrics
        for state in row.result.states
        if row.without_motion(metric, state)
    )
    return f"no {', '.join(found)}: what does not move in the window has no such ratio" if found else ""


def _noisy(rows: Sequence[Row]) -> str:
    """Which errors noise keeps from settling; nothing where it keeps none."""
    found = dict.fromkeys(
        metric
        for row in rows
        for metric in row.observer.metrics
        if any(row.noisy(metric, state) for state in row.result.states)
    )
    why = "never, where noise lifts the error above that part of its peak again and again"
    return f"{', '.join(map(printable, found))}: {why}" if found else ""


def _unresolved(rows: Sequence[Row]) -> str:
    """What the mark of times means that the integration does not resolve; nothing where there are none."""
    found = any(row.unresolved(m, s) for row in rows for m in row.observer.metrics for s in row.result.states)
    why = "the integration does not tell when, being less accurate than the bound that the error settles below"
    return f"{UNRESOLVED}: {why}" if found else ""


def _units(result: Result) -> str:
    """What states, outputs and inputs are measured in: ``units: x1, x2 g/L; D 1/h``; nothing where none is stated."""
    groups: dict[str, list[str]] = {}
    for name in dict.fromkeys((*result.states, *result.outputs, *result.inputs)):
        if result.units.get(name):
            groups.setdefault(printable(result.units[name]), []).append(name)
    parts = [f"{', '.join(map(printable, names))} {unit}" for unit, names in groups.items()]
    return f"units: {'; '.join(parts)}" if parts else ""


def _theory(row: Row, results: Sequence[Result], predicted: Sequence[Predicted]) -> Mapping[str, float]:
    """What is predicted for a row."""
    found = [p for result, p in zip(results, predicted, strict=False) if result is row.result]
    return found[0].get(row.label, {}) if found else {}


def _unit_of_theory(key: str, time: str) -> str:
    """The unit of what is predicted, where that is made of the unit of time alone; also of a finding of a state."""
    from hgorun.analysis.finding import FINDINGS  # runs without theory do without it

    found = next((one.unit for one in FINDINGS.load().values() if key in (one.title, one.name)), "")
    return found.replace("time", time) if time and found in ("time", "1/time") else ""


def _predictions(rows: Sequence[Row], results: Sequence[Result], predicted: Sequence[Predicted]) -> list[list[str]]:
    """Columns of what is predicted."""
    values = [_theory(row, results, predicted) for row in rows]
    keys = dict.fromkeys(key for row in values for key in row)
    time = time_unit(results[0].units) if results else ""  # one of all, or compare refuses them
    units = {key: bracketed(_unit_of_theory(key, time)) for key in keys}
    return [[key + units[key], *(number(row.get(key)) for row in values)] for key in keys]


def _blocks(rows: Sequence[Row], states: Sequence[str], more: Sequence[Sequence[str]]) -> list[list[str]]:
    """The lines of each part of the table; a metric's states stay together where they fit."""
    groups = [
        [[f"{metric} {s}", *(row.text_of(metric, s) for row in rows)] for s in states] for metric in metrics_of(rows)
    ]
    groups += scores_of(rows)
    status = ["status", *(row.status for row in rows)]
    return packed([row.text for row in rows], [*groups, [status], *([column] for column in more)])
