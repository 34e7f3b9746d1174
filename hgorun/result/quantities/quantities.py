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
from hgorun.result.metrics.base import all_metrics
from hgorun.result.quantities.quantity import Quantity, Window
from hgorun.result.quantities.quantity_values import (
    half_range,
    integral,
    largest,
    of_difference,
    of_error,
    of_loop,
    of_metric,
    rms,
    sup,
)
from hgorun.result.records.data import PLANT
from hgorun.result.result import Result

_OF_ONE_RUN = "largest"  # may be without the run's name where there is one run
# of estimates of recorded data, which are not measured on trajectories
SCORES = frozenset(
    (
        *("holdout_rmse", "holdout_mean", "holdout_coverage", "reference_rmse"),
        *("innovation_mean", "innovation_rms", "whiteness", "size", "gated"),
    )
)
CALL = re.compile(rf"\b(?:([A-Za-z_]\w*)\s*\(\s*((?:'[^']*'\s*,?\s*)+)|({_OF_ONE_RUN})\s*\(\s*(?!'))([^()']*)\)")
_QUOTED = re.compile(r"'([^']*)'")


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
    if match is None and CALL.search(text):
        raise ExpressionError(f"expected one quantity and nothing beside it; claims take expressions, found {text!r}")
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
    if function in SCORES:
        raise ExpressionError(
            f"{function} is a score of recorded data, of which hgorun estimate tells; this configuration is simulated, "
            "and has none"
        )
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
    "std": Kind(of_error(lambda e: float(np.std(e)))),
    "mean": Kind(of_error(lambda e: float(np.mean(e)))),
    "amplitude": Kind(of_error(half_range)),
    "integral": Kind(integral),
    "difference": Kind(of_difference(sup), names=2),
    "ni": Kind(of_difference(rms), names=2),
    "largest": Kind(largest, of_plant=True),
    "cost": Kind(of_loop(lambda loop, _: loop.cost), of="loop"),
    "effort": Kind(of_loop(lambda loop, i: loop.effort[i]), of="input"),
    "peak_input": Kind(of_loop(lambda loop, i: loop.peak_input[i]), of="input"),
    "exponent": Kind(None),
    "analysis": Kind(None, keyed=True),
}


def kinds() -> dict[str, Kind]:
    """All quantities by their names: the metrics, and what else can be measured."""
    return dict.fromkeys(all_metrics(closed=True), Kind(of_metric)) | _OTHERS


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
