"""The values of quantities, measured on the trajectories of results."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hgorun.config.expressions import ExpressionError
from hgorun.result.evaluation.measure import measure
from hgorun.result.metrics.base import METRICS
from hgorun.result.metrics.smoothness import HF, nothing_moves
from hgorun.result.quantities.quantity import Quantity, Window
from hgorun.result.records.closed import ClosedLoop
from hgorun.result.result import Result
from hgorun.result.windows import MetricSettings, points_in


def _column(quantity: Quantity, results: Mapping[str, Result], i: int = 0) -> tuple[Result, np.ndarray, np.ndarray]:
    """The result, x and xhat of the state of the i-th name; of the plant xhat is x."""
    run, label = quantity.of[i]
    result = results[run]
    j = result.states.index(str(quantity.state))
    x = result.truth_of(label)[:, j]
    return result, x, x if label is None else result.observers[label].xhat[:, j]


def _inside(quantity: Quantity, result: Result, default: Window) -> slice:
    window = quantity.window or default
    if window is None:
        return slice(None)
    return points_in(result.time, window)


def _steady(result: Result) -> Window:
    low, high = result.windows["steady"]
    return float(low), float(high)


def of_metric(quantity: Quantity, results: Mapping[str, Result]) -> float:
    """Without a window what the run has measured; else, or where a file lacks it, from the output grid."""
    result, x, xhat = _column(quantity, results)
    stored = result.observers[str(quantity.of[0][1])].metrics
    if quantity.window is None and quantity.function in stored:
        value = float(stored[quantity.function][result.states.index(str(quantity.state))])
        return np.nan if quantity.function == HF.name and value == 0 and without_mean(result) else value
    steady, transient = (quantity.window or tuple(result.windows[key]) for key in ("steady", "transient"))
    settings = MetricSettings(steady, transient, float(result.windows["average"]), float(result.windows["settling"]))
    asked = METRICS.find(quantity.function)
    if asked.closed:
        raise ExpressionError(f"{quantity}: only closed loops have this, without a window")
    rows = _before_divergence(result.time, xhat, steady[1]) if asked.window != "run" else slice(None)
    x, xhat = x[rows, None], xhat[rows, None]
    return float(measure(result.time[rows], x, {"": xhat}, settings, [asked])[""][asked.name][0])


def without_mean(result: Result) -> bool:
    """Whether hf is 0 of every estimate because its moving mean is of one point, and not of a finer ``record``."""
    if result.time.size < 2 or "average" not in result.windows:
        return False
    found = [o.metrics[HF.name] for o in result.observers.values() if HF.name in o.metrics]
    if any(np.any(values[np.isfinite(values)]) for values in found):
        return False
    return nothing_moves(float(result.windows["average"]), float(result.time[1] - result.time[0]))


def _before_divergence(time: np.ndarray, xhat: np.ndarray, end: float) -> slice:
    """All rows, or those before an estimate was lost where a window that it is measured in ends earlier."""
    lost = np.flatnonzero(~np.isfinite(xhat))
    return slice(int(lost[0])) if lost.size and end < time[lost[0]] else slice(None)


def of_error(of: Callable[[np.ndarray], float]) -> Callable[[Quantity, Mapping[str, Result]], float]:
    def measured(quantity: Quantity, results: Mapping[str, Result]) -> float:
        result, x, xhat = _column(quantity, results)
        e = (xhat - x)[_inside(quantity, result, _steady(result))]
        return of(e) if np.all(np.isfinite(e)) else float("inf")

    return measured


def integral(quantity: Quantity, results: Mapping[str, Result]) -> float:
    """Of |error| over time, by trapezoids; the whole run by default."""
    result, x, xhat = _column(quantity, results)
    inside = _inside(quantity, result, None)
    value = float(np.trapezoid(np.abs(xhat - x)[inside], result.time[inside]))
    return value if np.isfinite(value) else float("inf")


def of_difference(of: Callable[[np.ndarray], float]) -> Callable[[Quantity, Mapping[str, Result]], float]:
    def measured(quantity: Quantity, results: Mapping[str, Result]) -> float:
        result, _, one = _column(quantity, results, 0)
        other_result, _, other = _column(quantity, results, 1)
        if one.shape != other.shape or not np.allclose(result.time, other_result.time):
            raise ExpressionError(f"{quantity}: the runs have different output grids")
        d = (one - other)[_inside(quantity, result, _steady(result))]
        return of(d) if np.all(np.isfinite(d)) else float("inf")

    return measured


def largest(quantity: Quantity, results: Mapping[str, Result]) -> float:
    result, x, _ = _column(quantity, results)
    return float(np.max(np.abs(x[_inside(quantity, result, None)])))


def of_loop(of: Callable[[ClosedLoop, int], float | None]) -> Callable[[Quantity, Mapping[str, Result]], float]:
    def measured(quantity: Quantity, results: Mapping[str, Result]) -> float:
        (run, label), *_ = quantity.of
        result = results[run]
        if str(label) not in result.closed_loop:
            raise ExpressionError(f"{quantity}: {run} is not a closed loop of that name")
        place = 0 if quantity.state is None else result.inputs.index(quantity.state)
        value = of(result.closed_loop[str(label)], place)
        if value is None:
            raise ExpressionError(f"{quantity}: the controller of {run} has no cost")
        return float(value)

    return measured


def sup(e: np.ndarray) -> float:
    return float(np.max(np.abs(e)))


def rms(e: np.ndarray) -> float:
    return float(np.sqrt(np.mean(e**2)))


def half_range(e: np.ndarray) -> float:
    return float(np.ptp(e) / 2)
