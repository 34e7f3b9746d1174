"""How a notebook shows an ensemble: its axes, and the medians of the observers' metrics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hgorun import markup
from hgorun.ensemble.collected.collected import Collected, Floats, levels, shown
from hgorun.ensemble.statistics.never import never
from hgorun.ensemble.statistics.statistics import quantiles
from hgorun.result.metrics.base import unit_of


def as_html(members: Collected) -> str:
    """A table with a row for each observer; of members that are not sound a metric counts as infinite."""
    columns = [(metric, state) for metric in members.metrics for state in members.states]
    head = ["observer", "not ok", *(_headed(members, *column) for column in columns)]
    rows, late = [], {metric: never(members, metric) for metric in members.metrics}
    for i, label in enumerate(members.observers):
        failed = int(np.count_nonzero(~members.sound[:, i]))
        cells = [
            _median(members.metrics[metric][:, i, j], members.sound[:, i], late[metric][:, i, j])
            for metric in members.metrics
            for j in range(len(members.states))
        ]
        rows.append([label, str(failed), *cells])
    planned = f" of {members.planned}" if members.planned > len(members) else ""
    notes = [f"{len(members)}{planned} members; medians", *(_axis(members, axis) for axis in members.axes)]
    caption = f"{members.name}: {members.title}" if members.title else members.name
    return markup.table(caption, head, rows, notes)


def _median(values: Floats, sound: NDArray[np.bool_], late: NDArray[np.bool_]) -> str:
    """As tables have it: never where at least half of the members with numbers lack a time."""
    if late.any() and 2 * np.sum(late) >= np.sum(sound):
        return "never"
    return markup.number(float(quantiles(values, sound & ~late, [0.5])[0]))


def _axis(members: Collected, axis: str) -> str:
    values = levels(members.axes[axis])
    if len(values) <= 5:
        return f"{axis}: {', '.join(shown(value) for value in values)}"
    return f"{axis}: {len(values)} values, {shown(values[0])} to {shown(values[-1])}"


def _headed(members: Collected, metric: str, state: str) -> str:
    unit = unit_of(metric, state, members.units)
    return f"{metric} {state} [{unit}]" if unit else f"{metric} {state}"
