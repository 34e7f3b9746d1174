"""What a metric is: a record, from which its data set, tables, claims and documentation follow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Literal, TypeGuard

import numpy as np

from hgorun.registry import Registry
from hgorun.result.windows import MetricSettings, points_in

Window = Literal["run", "steady", "transient"]
_ROWS = 32  # that are taken together
_OF_ERRORS = "_rmse", "_rms", "_mean"  # how scores are called that are sizes of errors, or their means


@dataclass(frozen=True, eq=False, repr=False)
class Estimates:
    """Estimates beside the truth, over a run or over one of its windows.

    Time is the first axis of all arrays. A metric reduces it and leaves the others alone, so that one call measures
    all observers and states.

    Attributes
    ----------
    time : ndarray, shape (Nt,)
        Evenly spaced.
    x : ndarray, shape (Nt, 1, n), or (Nt, m, n) where each of the observers has a plant of its own
    xhat, error, size : ndarray, shape (Nt, m, n)
        Of m observers: estimates, xhat - x, and |xhat - x|.
    step : float
        Spacing of the grid; NaN where the run has a single point.
    settings : MetricSettings
    reference : ndarray, shape (Nt, 1, n), optional
        In a closed loop the plant that the true state drives.
    """

    time: np.ndarray
    x: np.ndarray
    xhat: np.ndarray
    error: np.ndarray
    size: np.ndarray
    step: float
    settings: MetricSettings
    reference: np.ndarray | None = None

    def within(self, window: Window) -> Estimates:
        """Those in a window of the run."""
        return {"run": self, "steady": self._steady, "transient": self._transient}[window]

    @cached_property
    def _steady(self) -> Estimates:
        return self._cut(self.settings.steady)

    @cached_property
    def _transient(self) -> Estimates:
        return self._cut(self.settings.transient)

    def _cut(self, window: tuple[float, float]) -> Estimates:
        inside = points_in(self.time, window)
        return replace(
            self,
            time=self.time[inside],
            x=self.x[inside],
            xhat=self.xhat[inside],
            error=self.error[inside],
            size=self.size[inside],
            reference=None if self.reference is None else self.reference[inside],
        )


def largest(values: np.ndarray) -> np.ndarray:
    """The maximum along the first axis; some ten times faster than numpy's for a few columns of many rows."""
    count = len(values) // _ROWS
    if count:
        folded = values[: count * _ROWS].reshape(count, _ROWS, *values.shape[1:])
        values = np.concatenate([np.max(folded, axis=0), values[count * _ROWS :]])
    return np.asarray(np.max(values, axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Metric:
    """A number for each state that says how good an estimate is; the smaller the better, unless it has an ideal.

    Attributes
    ----------
    name : str
        In files, tables and claims.
    meaning : str
        In a line, without a full stop.
    unit : {"state", "time", "1"}
        That of the state, that of time, or none.
    measure : callable
        From the estimates in the window to an array of shape (m, n). Numbers have to depend on nothing but their own
        observer and state. It is not called for windows without points or for observers that diverged.
    window : {"steady", "transient", "run"}
        Where it looks.
    phrase : str
        What an axis calls it, ``{}`` being the error's symbol.
    ideal : float
        The best value, 0 or a ratio.
    moment : bool
        It is a time that the clock shows, not a duration.
    place : int
        Where it stands among the others; those with the same place are sorted by their names.
    closed : bool
        Only of closed loops, where the estimates have a reference.
    setting, told : str and callable
        The setting of the metrics that it depends on beside its window, and from its value and the unit of time
        the words that say so.
    """

    name: str
    meaning: str
    unit: Literal["state", "time", "1"]
    measure: Callable[[Estimates], np.ndarray]
    window: Window = "steady"
    phrase: str = ""
    ideal: float = 0.0
    moment: bool = False
    place: int = 100
    closed: bool = False
    setting: Literal["average", "settling"] | None = None
    told: Callable[[float, str], str] = lambda value, unit: f"{value:g} {unit}".rstrip()


def is_metric(thing: object) -> TypeGuard[Metric]:
    """Whether it is a metric's record."""
    return isinstance(thing, Metric) and thing.name.isidentifier()


METRICS: Registry[Metric] = Registry(
    "metric",
    package="hgorun.result.metrics",
    group="hgorun.metrics",
    accepts=is_metric,
    expected="a record hgorun.result.metrics.base.Metric whose name is an identifier",
)


def metric(record: Metric) -> Metric:
    """Register a metric under its own name."""
    return METRICS.add(record.name, record)


def all_metrics(*, closed: bool = False) -> Mapping[str, Metric]:
    """Name: record, in the order of tables.

    Parameters
    ----------
    closed : bool
        With those of closed loops, which other runs do not have.

    Raises
    ------
    HgorunError
        When one of another package cannot be loaded: results would silently lack it.
    """
    return _sorted(tuple(m for m in METRICS.load().values() if closed or not m.closed))


def unit_of(metric: str, state: str, units: Mapping[str, str]) -> str:
    """What a metric of a state is measured in; empty where that is not known, or it is a mere number.

    Parameters
    ----------
    metric, state : str
    units : mapping of str to str
        Of the states, and of ``time``.
    """
    known = all_metrics(closed=True).get(metric)
    return units.get({"state": state, "time": "time"}.get(known.unit if known else "", ""), "")


def unit_of_score(score: str, of: str, units: Mapping[str, str]) -> str:
    """What a score of recorded data is measured in: errors are in the unit of their output or state, others numbers.

    Parameters
    ----------
    score, of : str
        The score, and the output, state or gain that it is of.
    units : mapping of str to str
    """
    return units.get(of, "") if score.endswith(_OF_ERRORS) else ""


@lru_cache(maxsize=8)
def _sorted(metrics: tuple[Metric, ...]) -> Mapping[str, Metric]:
    return MappingProxyType({m.name: m for m in sorted(metrics, key=lambda m: (m.place, m.name))})
