"""Quantities of results: read from text, measured on trajectories.

A quantity is a call such as ``hf('te02/FHGO I', x3)``: it names runs and observers in quotes, then a state, then
perhaps a window of time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hgorun.config.expressions import ExpressionError, nearest, parse
from hgorun.result.closed import ClosedLoop
from hgorun.result.data import PLANT
from hgorun.result.measure import measure
from hgorun.result.metrics.base import METRICS, all_metrics
from hgorun.result.metrics.smoothness import HF, nothing_moves
from hgorun.result.result import Result
from hgorun.result.windows import MetricSettings, points_in

Of = tuple[tuple[str, str | None], ...]  # (run, observer) each
Window = tuple[float, float] | None

_OF_ONE_RUN = "largest"  # may be without the run's name where there is one run
CALL = re.compile(rf"\b(?:([A-Za-z_]\w*)\s*\(\s*((?:'[^']*'\s*,?\s*)+)|({_OF_ONE_RUN})\s*\(\s*(?!'))([^()']*)\)")
_QUOTED = re.compile(r"'([^']*)'")


@dataclass(frozen=True)
class Quantity:
    """One call: ``function('run/observer', state, from, to)``.

    Attributes
    ----------
    function : str
    of : tuple of (run, observer)
        The observer is None where the plant itself is meant.
    state : str or None
        A state of the plant, or an input where the quantity is of one; None where it is of neither.
    window : (from, to) or None
    """

    function: str
    of: Of
    state: str | None
    window: Window = None
    key: str | None = None

    def __str__(self) -> str:
        names = ", ".join(f"'{run}/{label}'" if label else f"'{run}'" for run, label in self.of)
        rest = "".join(f", {part}" for part in (self.key, self.state, *(self.window or ())) if part is not None)
        return f"{self.function}({names}{rest})"


def read_quantity(text: str, runs: tuple[str, ...]) -> Quantity:
    """Read one call.

    Parameters
    ----------
    text : str
        Such as ``std('run/F', x2, 2, 6)``.
    runs : tuple of str
        Names of the runs; where there is only one, a name in quotes may be without it.

    Raises
    ------
    ExpressionError
    """
    match = CALL.fullmatch(text.strip())
    if match is None:
        raise ExpressionError(f"expected a quantity such as std('label', x1), found {text!r}")
    return quantity_of(match, runs)


def quantity_of(call: re.Match[str], runs: tuple[str, ...]) -> Quantity:
    """The quantity that a match of :data:`CALL` says; see :func:`read_quantity`."""
    if call[3] is None:
        return _quantity(call[1], _QUOTED.findall(call[2]), call[4], runs)
    if len(runs) > 1:
        raise ExpressionError(f"the file has several runs: expected {call[3]}('run', state), found {call[0]}")
    return _quantity(call[3], [runs[0]], call[4], runs)


def _quantity(function: str, names: list[str], rest: str, runs: tuple[str, ...]) -> Quantity:
    known = kinds()
    if function not in known:
        raise ExpressionError(
            f"no quantity is called {function!r}.{nearest(function, known)} Known: {', '.join(known)}"
        )
    kind = known[function]
    if len(names) != kind.names:
        raise ExpressionError(f"{function} takes {kind.names} name(s) in quotes, found {len(names)}")
    arguments = [part.strip() for part in rest.split(",") if part.strip()]
    if kind.of != "state" and len(arguments) != (kind.of == "input"):
        wanted = "an input" if kind.of == "input" else "nothing"
        raise ExpressionError(f"{function} takes {wanted} after the name in quotes, found {rest.strip() or 'nothing'}")
    key = arguments.pop(0) if kind.keyed and arguments else None
    state = arguments.pop(0) if arguments else None
    if state is None and not kind.keyed and kind.of == "state":
        raise ExpressionError(f"{function} needs a state after the name in quotes")
    if kind.keyed and key is None:
        raise ExpressionError(f"{function} needs a key after the name in quotes")
    if len(arguments) not in (0, 2):
        raise ExpressionError(f"{function}: after the state there is a window, from and to, or nothing")
    window = (parse(arguments[0], names=()).number(), parse(arguments[1], names=()).number()) if arguments else None
    return Quantity(function, tuple(_named(n, runs, kind) for n in names), state, window, key)


def _named(name: str, runs: tuple[str, ...], kind: Kind) -> tuple[str, str | None]:
    """Run and observer of a name in quotes."""
    run, slash, label = name.rpartition("/")
    if kind.of_plant:
        if slash:
            raise ExpressionError(f"expected the name of a run, found {name!r}")
        return name, None
    if not slash:
        if len(runs) > 1:
            raise ExpressionError(f"the file has several runs: expected 'run/observer', found {name!r}")
        return runs[0], name
    return run, label


def measure_quantity(quantity: Quantity, results: Mapping[str, Result]) -> float:
    """A quantity's value, from the results of the runs that it names; infinite where an observer diverged."""
    kind = kinds()[quantity.function]
    assert kind.measure is not None
    return kind.measure(quantity, results)


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


def _metric(quantity: Quantity, results: Mapping[str, Result]) -> float:
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


def _of_error(of: Callable[[np.ndarray], float]) -> Callable[[Quantity, Mapping[str, Result]], float]:
    def measured(quantity: Quantity, results: Mapping[str, Result]) -> float:
        result, x, xhat = _column(quantity, results)
        e = (xhat - x)[_inside(quantity, result, _steady(result))]
        return of(e) if np.all(np.isfinite(e)) else float("inf")

    return measured


def _integral(quantity: Quantity, results: Mapping[str, Result]) -> float:
    """Of |error| over time, by trapezoids; the whole run by default."""
    result, x, xhat = _column(quantity, results)
    inside = _inside(quantity, result, None)
    value = float(np.trapezoid(np.abs(xhat - x)[inside], result.time[inside]))
    return value if np.isfinite(value) else float("inf")


def _of_difference(of: Callable[[np.ndarray], float]) -> Callable[[Quantity, Mapping[str, Result]], float]:
    def measured(quantity: Quantity, results: Mapping[str, Result]) -> float:
        result, _, one = _column(quantity, results, 0)
        other_result, _, other = _column(quantity, results, 1)
        if one.shape != other.shape or not np.allclose(result.time, other_result.time):
            raise ExpressionError(f"{quantity}: the runs have different output grids")
        d = (one - other)[_inside(quantity, result, _steady(result))]
        return of(d) if np.all(np.isfinite(d)) else float("inf")

    return measured


def _largest(quantity: Quantity, results: Mapping[str, Result]) -> float:
    result, x, _ = _column(quantity, results)
    return float(np.max(np.abs(x[_inside(quantity, result, None)])))


def _of_loop(of: Callable[[ClosedLoop, int], float | None]) -> Callable[[Quantity, Mapping[str, Result]], float]:
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


def _sup(e: np.ndarray) -> float:
    return float(np.max(np.abs(e)))


def _rms(e: np.ndarray) -> float:
    return float(np.sqrt(np.mean(e**2)))


def _half_range(e: np.ndarray) -> float:
    return float(np.ptp(e) / 2)


@dataclass(frozen=True, eq=False, repr=False)
class Kind:
    """How a quantity is written and measured.

    Attributes
    ----------
    measure : callable or None
        None where it takes more than one result of each run.
    names : int
        How many names in quotes.
    of_plant : bool
        Whether they name runs, not observers.
    keyed : bool
        Whether a key stands before the state, which may then be missing.
    of : {"state", "input", "loop"}
        What it is of: a state, an input of a closed loop, or all of a closed loop. The name ``plant`` is that of the
        loop with the true state.
    """

    measure: Callable[[Quantity, Mapping[str, Result]], float] | None
    names: int = 1
    of_plant: bool = False
    keyed: bool = False
    of: Literal["state", "input", "loop"] = "state"

    def takes(self, label: str, observers: Collection[str]) -> bool:
        """Whether it may be of an observer, or of what else is called so."""
        return label in observers or (self.of != "state" and label == PLANT)


_OTHERS: dict[str, Kind] = {
    "std": Kind(_of_error(lambda e: float(np.std(e)))),
    "mean": Kind(_of_error(lambda e: float(np.mean(e)))),
    "amplitude": Kind(_of_error(_half_range)),
    "integral": Kind(_integral),
    "difference": Kind(_of_difference(_sup), names=2),
    "ni": Kind(_of_difference(_rms), names=2),
    "largest": Kind(_largest, of_plant=True),
    "cost": Kind(_of_loop(lambda loop, _: loop.cost), of="loop"),
    "effort": Kind(_of_loop(lambda loop, i: loop.effort[i]), of="input"),
    "peak_input": Kind(_of_loop(lambda loop, i: loop.peak_input[i]), of="input"),
    "exponent": Kind(None),
    "analysis": Kind(None, keyed=True),
}


def kinds() -> dict[str, Kind]:
    """All quantities by their names: the metrics, and what else can be measured."""
    return dict.fromkeys(all_metrics(closed=True), Kind(_metric)) | _OTHERS


def of_loops(quantity: Quantity) -> bool:
    """Whether only closed loops have it."""
    metric = all_metrics(closed=True).get(quantity.function)
    return metric.closed if metric is not None else kinds()[quantity.function].of != "state"


def inside(value: float, window: tuple[float, float]) -> bool:
    """Whether a varied value lies in a window, its ends included in spite of rounding."""
    return window[0] * (1 - 1e-9) <= value <= window[1] * (1 + 1e-9)


def exponent(varied: Any, amplitudes: Any, window: Window) -> float:
    """Slope of log amplitude against the log of what is varied, by least squares, over values in a window."""
    values, sizes = np.asarray(varied, dtype=float), np.asarray(amplitudes, dtype=float)
    used = (values > 0) & (sizes > 0) & np.isfinite(sizes)
    if window is not None:
        used &= [inside(value, window) for value in values]
    if np.unique(values[used]).size < 2:
        return float("nan")
    return float(np.polyfit(np.log(values[used]), np.log(sizes[used]), 1)[0])
