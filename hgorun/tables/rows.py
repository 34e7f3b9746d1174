"""The rows of tables of metrics: the observers of one or several results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.result.metrics.base import Metric, all_metrics
from hgorun.result.metrics.settling import lifted_by_noise
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.result.run_names import run_names
from hgorun.tables.layout import number
from hgorun.tables.typeset import time_unit

NEVER = "never"
UNRESOLVED = "~"  # before a time that the integration does not resolve


@dataclass(frozen=True)
class Row:
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

    def never(self, metric: str, state: str) -> bool:
        """Whether what a metric waits for has not come by the end of the run, as an error that never settles."""
        return self._never(all_metrics(closed=True).get(metric), self.value(metric, state), state)

    def _never(self, known: Metric | None, value: float | None, state: str) -> bool:
        if known is None or not known.moment or value is None or not value < math.inf:
            return False
        return self.result.end <= value or self.noisy(known.name, state)

    def noisy(self, metric: str, state: str) -> bool:
        """Whether noise decides the number, see :func:`hgorun.result.metrics.settling.lifted_by_noise`."""
        known, part = all_metrics(closed=True).get(metric), self.result.windows.get("settling")
        if known is None or known.setting != "settling" or not isinstance(part, (int, float)):
            return False
        found = [self.value(name, state) for name in ("sup", "hf", "peak")]
        sup, fast, peak = (np.array(np.nan if value is None else value) for value in found)
        return bool(lifted_by_noise(sup, fast, peak, part))

    def unresolved(self, metric: str, state: str) -> bool:
        """Whether it is a time that the integration does not resolve, nor is told never to come."""
        return state in self.result.unresolved.get(self.label, {}).get(metric, ()) and not self.never(metric, state)

    def without_motion(self, metric: str, state: str) -> bool:
        """Whether a ratio has no value, since what the state itself does is nothing."""
        return self._without_motion(all_metrics(closed=True).get(metric), self.value(metric, state), state)

    def _without_motion(self, known: Metric | None, value: float | None, state: str) -> bool:
        if known is None or known.ideal == 0 or value != math.inf or self.observer.status in ("diverged", "undefined"):
            return False
        # With steps that are too long, an estimate is lost that is only called inaccurate.
        return bool(np.isfinite(self.observer.xhat[:, self.result.states.index(state)]).all())

    def text_of(self, metric: str, state: str, *, marked: bool = True) -> str:
        """What a table shows; a time that is not resolved is not marked as that where a pass more takes too long."""
        known, value = all_metrics(closed=True).get(metric), self.value(metric, state)
        if self._never(known, value, state):
            return NEVER
        shown = number(None if self._without_motion(known, value, state) else value)
        return UNRESOLVED + shown if marked and self.unresolved(metric, state) else shown

    @property
    def status(self) -> str:
        """The word, and the time with its unit where there is one."""
        return self.observer.verdict.text(time_unit(self.result.units))


def rows_of(results: Sequence[Result]) -> list[Row]:
    return [
        Row(run, label, f"{run}: {label}" if len(results) > 1 else label, result, observer)
        for run, result in zip(run_names(results), results, strict=True)
        for label, observer in result.observers.items()
    ]


def metrics_of(rows: Sequence[Row]) -> list[str]:
    """Those of any row: the known ones in their order, then what only files know."""
    found = dict.fromkeys(metric for row in rows for metric in row.observer.metrics)
    known = [name for name in all_metrics(closed=True) if name in found]
    return [*known, *(name for name in found if name not in known)]


def states_of(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(state for result in results for state in result.states))
