"""The size of estimation errors against what a run varies: simulated points on the lines of theory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hgorun.figures import lost
from hgorun.figures.looks import Look
from hgorun.figures.style import POINTS, THEORY
from hgorun.result.metrics.base import all_metrics
from hgorun.tables.typeset import error_of, symbol, unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZES = (5.6, 3.4)  # of the points at the back and at the front of several: of those on each other both are seen
_BESIDE_METRICS = {"amplitude": "amplitude of ${}$", "std": "standard deviation of ${}$"}


def measured_on(quantity: str, state: str) -> str:
    """What a quantity is of: the error of a state's estimate, or of closed loops the state."""
    metric = all_metrics(closed=True).get(quantity)
    if metric is not None and metric.closed:
        return symbol(state)
    return error_of(state)


def quantities() -> dict[str, str]:
    """What can be shown, and how the vertical axis calls it; {} is what it is measured on."""
    return _BESIDE_METRICS | {name: m.phrase or f"{name} of ${{}}$" for name, m in all_metrics(closed=True).items()}


@dataclass(frozen=True)
class ScaledObserver:
    """One observer's errors.

    Attributes
    ----------
    type : str
    filter_order : int or None
        Order of its filter, where it has one.
    measured : ndarray, shape (m,)
        From simulation, of several seeds the median; points that are not positive and finite are left out.
    theory : ndarray, shape (m,), or None
        What is predicted; NaN where nothing can be, None where that is everywhere or not asked for.
    reasons : tuple of str
        Why predictions are missing.
    spread : ndarray, shape (m, S), optional
        From simulation with each of several seeds.
    """

    type: str
    filter_order: int | None
    measured: np.ndarray
    theory: np.ndarray | None = None
    reasons: tuple[str, ...] = ()
    spread: np.ndarray | None = None


@dataclass(frozen=True)
class ScalingData:
    """What a scaling panel shows.

    Attributes
    ----------
    run, state : str
        The run with ``vary``, and the state whose error is measured.
    name : str
        What is varied.
    values : ndarray, shape (m,)
    observers : mapping of str to ScaledObserver
        By label.
    unit : str
        Of the vertical axis.
    """

    run: str
    state: str
    name: str
    values: np.ndarray
    observers: Mapping[str, ScaledObserver]
    unit: str = ""


def draw_scaling(
    ax: Axes,
    data: ScalingData,
    labels: Mapping[str, int],
    looks: Mapping[int, Look],
    quantity: str,
    axes: Literal["log", "linear"] = "log",
) -> None:
    """Points and lines.

    Parameters
    ----------
    labels : mapping of str to int
        The observers shown: their places, keys of ``looks``.
    quantity : str
        One of :func:`quantities`.
    axes : {"log", "linear"}
        Of both axes.
    """
    ax.set_xscale(axes)
    ax.set_yscale(axes)
    drawn: list[np.ndarray] = []
    shown = [data.observers[label] for label in labels]
    parts = ((one.measured, one.theory, one.spread) for one in shown)
    largest = lost.largest_of(part for several in parts for part in several if part is not None)
    sizes = np.linspace(*_SIZES, len(labels)) if len(labels) > 1 else [POINTS["markersize"]]
    for observer, order, size in zip(shown, labels.values(), sizes, strict=True):
        look = looks[order]
        if observer.theory is not None:
            drawn.append(_plot(ax, data.values, observer.theory, **{**THEORY, **_line(look)}))
        if observer.spread is not None:
            drawn += _bars(ax, data.values, observer.spread, look, largest)
        points = {**POINTS, "color": look.colour, "marker": look.marker, "label": look.text, "markersize": size}
        drawn.append(_plot(ax, data.values, observer.measured, **points))
    if any(observer.theory is not None for observer in shown):
        ax.plot([], [], **THEORY)
        ax.plot([], [], **POINTS)
    _say_lost(ax, shown)
    _limit(ax, data.values, drawn)
    ax.set_ylabel(quantities()[quantity].format(measured_on(quantity, data.state)) + unit(data.unit))
    ax.set_xlabel(f"${symbol(data.name)}$")


def _line(look: Look) -> dict[str, object]:
    return {"color": look.colour, "linestyle": look.dashes, "label": "_theory"}


def _plot(ax: Axes, x: np.ndarray, v: np.ndarray, **how: object) -> np.ndarray:
    """Draw what the axes can show, in the order of x; the values drawn."""
    shown = _can_show(ax, x) & _can_show(ax, v)
    order = np.argsort(x[shown], kind="stable")
    ax.plot(x[shown][order], v[shown][order], **how)  # type: ignore[arg-type]  # matplotlib wants each one's type
    return np.asarray(v[shown])


def _can_show(ax: Axes, numbers: np.ndarray) -> np.ndarray:
    """Which numbers the axes can show."""
    return np.asarray(np.isfinite(numbers) & ((numbers > 0) | (ax.get_xscale() == "linear")))


def _bars(ax: Axes, x: np.ndarray, spread: np.ndarray, look: Look, largest: float) -> list[np.ndarray]:
    """Where 90 % of the seeds lie, and thicker where 50 % do, up to the edge where so many are lost; the ends drawn."""
    rows = lost.spread(spread.T, ~np.isnan(spread.T))
    drawn = lost.ends(rows, largest)
    found = []
    for low, high, width in ((0, 4, 0.8), (1, 3, 2.4)):
        shown = _can_show(ax, x) & _can_show(ax, rows[low])
        how: dict[str, object] = {"color": look.colour, "linewidth": width, "alpha": 0.6, "zorder": 3}
        ax.vlines(x[shown], rows[low][shown], drawn[high][shown], **how)  # type: ignore[arg-type]  # matplotlib wants each one's type
        ends = rows[[low, high]][:, shown]
        found.append(ends[np.isfinite(ends)])
    return found


def _say_lost(ax: Axes, observers: Sequence[ScaledObserver]) -> None:
    """Say above a panel why bars of seeds have no end, where there are such."""
    spreads = [one.spread for one in observers if one.spread is not None]
    count = sum(int(np.count_nonzero(~np.isfinite(spread))) for spread in spreads)
    if count:
        total = sum(spread.size for spread in spreads)
        lost.say_above(ax, f"{count} of {total} estimates lost: they count as infinite")


def _limit(ax: Axes, values: np.ndarray, drawn: Sequence[np.ndarray]) -> None:
    for set_limits, found in (
        (ax.set_xlim, values[_can_show(ax, values)]),
        (ax.set_ylim, np.concatenate([*drawn, np.empty(0)])),
    ):
        low, high = (float(found.min()), float(found.max())) if found.size else (0.1, 1.0)
        if ax.get_xscale() == "linear":
            room = 0.06 * (high - low) or 0.1 * abs(high) or 0.1
            set_limits(low - room, high + room)
        else:
            margin = 1.6 if low == high else (high / low) ** 0.06
            set_limits(low / margin, high * margin)
