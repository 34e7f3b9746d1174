"""Statistics of ensembles as JSON and CSV, for other programs."""

from __future__ import annotations

import csv as csv_module
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, levels
from hgorun.ensemble.statistics.never import is_time
from hgorun.ensemble.statistics.statistics import Difference, Statistics, largest_errors
from hgorun.files import json_value
from hgorun.result.metrics.base import unit_of
from hgorun.tables.ensemble import NUMBERS, Compared

_MOST_VALUES = 1000  # of an axis, one by one


def as_json(found: Compared) -> dict[str, Any]:
    """The statistics as JSON holds them.

    Returns
    -------
    dict
        ``{name, file, status, members, planned, axes: {axis: [values]}, pooled: [axis], observers: {label: {failed,
        metric: {state: {mean, median, sem, ci95, q05, q25, q75, q95, n, never}}}}, paired: [{a, b, metric, state, n,
        mean, ci95, p, p_holm}]}``, and ``points``, each with ``at: {axis: value}`` and the same keys, where the
        ensemble is divided.
        ``pooled`` are the axes for which members are no independent draws; then intervals and p are not known.
        ``never``, of times only, is in how many members there is none.
        ``units: {"time" or name: unit}`` where some are known.
        ``integration_error: {members, largest: {label: number}}``, of the plant and observers in so many members.
        Numbers that are not finite are text, those that are not known null. An axis with more than a thousand values
        is ``{first, last, count}``.
    """
    members = found.members
    whole: dict[str, Any] = {
        "name": members.name,
        "file": found.file,
        "status": members.worst,
        "members": found.whole.members,
        "planned": members.planned,
        "axes": {axis: _levels(values) for axis, values in members.axes.items()},
    }
    whole |= {"units": dict(members.units)} if members.units else {}
    count, largest = largest_errors(members)
    whole |= {"integration_error": {"members": count, "largest": largest}} if count else {}
    whole |= _json_of(found.whole, members)
    if found.by:
        whole["points"] = [{"at": part.at, "members": part.members, **_json_of(part, members)} for part in found.points]
    return {key: json_value(value) for key, value in whole.items()}


def _levels(values: NDArray[Any]) -> list[Any] | dict[str, Any]:
    """The values of an axis; of very many only the ends and their number."""
    found = levels(values)
    if len(found) <= _MOST_VALUES:
        return found
    return {"first": found[0], "last": found[-1], "count": len(found)}


def _json_of(found: Statistics, members: Collected) -> dict[str, Any]:
    observers: dict[str, Any] = {}
    for label in members.observers:
        own: dict[str, Any] = {"failed": found.failed(label), "statuses": found.counts[label]}
        for (whose, metric, state), summary in found.summaries.items():
            if whose == label:
                values = {name: getattr(summary, name) for name in NUMBERS} | {"ci95": summary.ci95, "n": summary.n}
                own.setdefault(metric, {})[state] = _known(values | _never(found, whose, metric, state))
        observers[label] = own
    keys = [f.name for f in fields(Difference)]
    paired = [_known({key: getattr(d, key) for key in keys}) for d in found.differences]
    return {"pooled": [*found.pooled, *found.shared], "observers": observers, "paired": paired}


def _never(found: Statistics, label: str, metric: str, state: str) -> dict[str, int]:
    """Of a time, how many members have none."""
    return {"never": found.without.get((label, metric, state), 0)} if is_time(metric) else {}


def _known(values: Mapping[str, Any]) -> dict[str, Any]:
    """NaN stands for what is not known."""
    return {key: None if _unknown(value) else value for key, value in values.items()}


def _unknown(value: Any) -> bool:
    if isinstance(value, tuple):
        return any(map(_unknown, value))
    return isinstance(value, float) and math.isnan(value)


def csv(found: Sequence[Compared]) -> str:
    """One metric of one observer and state a line, differences between observers after them as ``a - b``.

    Values have all their digits; what is not known is empty. The unit is that of the metric, the unit of time that of
    axes such as a period. ``never``, of times only, is in how many members there is none.
    """
    axes = list(dict.fromkeys(axis for one in found for axis in one.by))
    buffer = io.StringIO()
    writer = csv_module.writer(buffer, lineterminator="\n")
    numbers = [*NUMBERS, "ci95_low", "ci95_high", "n", "failed", "p", "p_holm"]
    writer.writerow(["name", *axes, "observer", "state", "metric", *numbers, "unit", "time_unit", "never"])
    for one in found:
        for part in one.parts:
            start = [one.members.name, *(part.at.get(axis, "") for axis in axes)]
            for observer, metric, state, values in _rows(part):
                cells, never = [_exact(values.get(name)) for name in numbers], _exact(values.get("never"))
                units = one.members.units
                unit = unit_of(metric, state, units)
                writer.writerow([*start, observer, state, metric, *cells, unit, units.get("time", ""), never])
    return buffer.getvalue()


def _rows(part: Statistics) -> Iterator[tuple[str, str, str, dict[str, float]]]:
    for (label, metric, state), s in part.summaries.items():
        values: dict[str, float] = {name: getattr(s, name) for name in NUMBERS}
        ends = {"ci95_low": s.ci95[0], "ci95_high": s.ci95[1]}
        counts = {"n": s.n, "failed": part.failed(label)} | _never(part, label, metric, state)
        yield label, metric, state, values | ends | counts
    for d in part.differences:
        ends = {"ci95_low": d.ci95[0], "ci95_high": d.ci95[1]}
        yield f"{d.a} - {d.b}", d.metric, d.state, {"mean": d.mean, "n": d.n, "p": d.p, "p_holm": d.p_holm} | ends


def _exact(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else repr(value)
