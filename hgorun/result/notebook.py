"""How a notebook shows a result: the observers with their metrics."""

from __future__ import annotations

from hgorun import markup
from hgorun.result.metrics.base import all_metrics, unit_of
from hgorun.result.records.data import ResultData


def as_html(result: ResultData) -> str:
    """A table with a row for each observer."""
    known = [m for m in all_metrics(closed=True) if any(m in o.metrics for o in result.observers.values())]
    columns = [(metric, state) for metric in known for state in result.states]
    head = ["observer", "status", *(_headed(result, *column) for column in columns)]
    rows = [
        [label, o.verdict.text(result.units.get("time", ""))]
        + [
            markup.number(float(o.metrics[metric][result.states.index(state)])) if metric in o.metrics else "–"
            for metric, state in columns
        ]
        for label, o in result.observers.items()
    ]
    points, unit = f"{result.time.size} points", result.units.get("time", "")
    span = f"{result.time[0]:g} to {result.time[-1]:g} {unit}" if result.time.size else "no time"
    kind = "estimates of recorded data" if result.kind == "estimate" else "simulation"
    caption = f"{result.name}: {result.title}" if result.title else result.name
    notes = [f"{kind}, {span.rstrip()}, {points}", *result.troubles(), *result.remarks]
    return markup.table(caption, head, rows, notes)


def _headed(result: ResultData, metric: str, state: str) -> str:
    unit = unit_of(metric, state, result.units)
    return f"{metric} {state} [{unit}]" if unit else f"{metric} {state}"
