"""One set of axes: what is drawn in it, in which order, in which limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.figures import data
from hgorun.figures.actors import Actor
from hgorun.figures.data import Curve
from hgorun.figures.style import DOTS, TRACE, TRUTH
from hgorun.figures.typeset import symbol, unit
from hgorun.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Window = tuple[float, float] | None


@dataclass(frozen=True)
class Scene:
    """What a panel draws from.

    Attributes
    ----------
    results : sequence of Result
        Whose truth and measurements are shown.
    actors : sequence of Actor
        The observers shown.
    dashes : mapping of int to linestyle
        By the observers' place.
    window : (from, to) or None
    """

    results: Sequence[Result]
    actors: Sequence[Actor]
    dashes: Mapping[int, Any]
    window: Window = None


def draw_state(ax: Axes, scene: Scene, name: str, *, samples: bool = False) -> None:
    """A state, true and estimated."""
    own = [r for r in scene.results if name in r.states]
    truths = _distinct([data.inside(Curve(r.time, r.x[:, r.states.index(name)]), scene.window) for r in own])
    measured = _samples(ax, scene, name) if samples else []
    healthy, lost = _estimates(ax, scene, name, lambda xhat, x: xhat)
    _truth(ax, truths)
    _limit(ax, data.state_limits([c.v for c in truths] + measured, healthy, lost))
    both = rf"${symbol(name)},\ {symbol(name, hat=True)}$" if scene.actors else f"${symbol(name)}$"
    ax.set_ylabel(both + _unit(scene, name))


def draw_error(ax: Axes, scene: Scene, name: str) -> None:
    """Estimates of a state minus the truth."""
    ax.axhline(0, color="black", linewidth=0.5, zorder=1)
    _limit(ax, data.error_limits(*_estimates(ax, scene, name, np.subtract)))
    ax.set_ylabel(f"${symbol(name, hat=True)} - {symbol(name)}$" + _unit(scene, name))


def draw_magnitude(ax: Axes, scene: Scene, name: str) -> None:
    """The largest error in a moving window, logarithmic."""
    ax.set_yscale("log")
    ax.set_ylim(1e-16, 1.0)  # stays when there is no error to show
    healthy, lost = _estimates(ax, scene, name, lambda xhat, x: np.abs(xhat - x), moving_maximum=True)
    _limit(ax, data.magnitude_limits(healthy, lost))
    ax.set_ylabel(f"$|{symbol(name, hat=True)} - {symbol(name)}|$" + _unit(scene, name))


def draw_output(ax: Axes, scene: Scene, name: str) -> None:
    """An output, measured and free of noise."""
    own = [r for r in scene.results if name in r.outputs]
    measured = _samples(ax, scene, name)
    truths = _distinct([data.inside(Curve(r.time, r.y[:, r.outputs.index(name)]), scene.window) for r in own])
    _truth(ax, truths)
    _limit(ax, data.state_limits([c.v for c in truths] + measured, [], []))
    is_state = any(name in r.states for r in own)
    ax.set_ylabel((f"$y = {symbol(name)}$" if is_state else f"${symbol(name)}$") + _unit(scene, name))


def moving_window(result: Result) -> float:
    """Length of the moving window of :func:`draw_magnitude`: the metrics' moving average."""
    span = float(result.time[-1] - result.time[0]) if result.time.size else 0.0
    return float(result.windows.get("average") or 0.01 * span)


def _estimates(
    ax: Axes,
    scene: Scene,
    name: str,
    of: Callable[[np.ndarray, np.ndarray], np.ndarray],
    *,
    moving_maximum: bool = False,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Draw all observers, the roughest at the back.

    Returns
    -------
    tuple of list of ndarray
        The values drawn of sound and of diverged observers.
    """
    drawn: list[tuple[float, Actor, Curve]] = []
    for actor in scene.actors:
        result = actor.result
        if name not in result.states:
            continue
        column = result.states.index(name)
        curve = data.finite(result.time, of(actor.observer.xhat[:, column], result.x[:, column]))
        if moving_maximum and len(result.time) > 1:
            step = float(result.time[1] - result.time[0])
            curve = data.moving_maximum(curve, round(moving_window(result) / step))
        curve = data.inside(curve, scene.window)
        drawn.append((float(np.abs(np.diff(curve.v)).sum()), actor, curve))
    ranks = {id(actor): rank for rank, (_, actor, _) in enumerate(sorted(drawn, key=lambda d: -d[0]))}
    for _, actor, curve in drawn:
        _line(
            ax,
            curve,
            color=actor.colour,
            linestyle=scene.dashes[actor.order],
            label=actor.text,
            zorder=3 + ranks[id(actor)] / (len(drawn) + 1),
        )
    healthy = [c.v for _, actor, c in drawn if actor.observer.diverged_at is None]
    return healthy, [c.v for _, actor, c in drawn if actor.observer.diverged_at is not None]


def _samples(ax: Axes, scene: Scene, name: str) -> list[np.ndarray]:
    """Measurements at their arrival: dots, or a line where there is one at every point of the output grid."""
    drawn = []
    for result in scene.results:
        if name not in result.outputs:
            continue
        t, y = result.measurements.time, result.measurements.y[:, result.outputs.index(name)]
        known = np.isfinite(y)
        if scene.window is not None:
            known &= (t >= scene.window[0]) & (t <= scene.window[1])
        t, y = t[known], y[known]
        dense = _dense(t, result.time)
        for piece in np.split(np.arange(t.size), np.flatnonzero(np.diff(dense)) + 1):
            if piece.size and dense[piece[0]]:
                _line(ax, Curve(t[piece], y[piece]), **TRACE)
        if not np.all(dense):
            ax.plot(t[~dense], y[~dense], **DOTS)
        drawn.append(y)
    return drawn


def _dense(t: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Which of the times lie as close to a neighbour as the points of the output grid."""
    if t.size < 2 or grid.size < 2:
        return np.zeros(t.size, dtype=bool)
    close = np.diff(t) <= 1.001 * (grid[1] - grid[0])
    return np.asarray(np.concatenate([close[:1], close]) | np.concatenate([close, close[-1:]]))


def _distinct(curves: Sequence[Curve]) -> list[Curve]:
    """Truths of several runs, the same one once."""
    found: list[Curve] = []
    for curve in curves:
        if not any(np.array_equal(curve.t, c.t) and np.array_equal(curve.v, c.v) for c in found):
            found.append(curve)
    return found


def _truth(ax: Axes, curves: Sequence[Curve]) -> None:
    for curve in curves:
        _line(ax, curve, **TRUTH)


def _line(ax: Axes, curve: Curve, **how: Any) -> None:
    ax.plot(*data.thinned(curve), **how)


def _limit(ax: Axes, limits: tuple[float, float] | None) -> None:
    if limits is not None:
        ax.set_ylim(limits)


def _unit(scene: Scene, name: str) -> str:
    return unit(next((r.units[name] for r in scene.results if r.units.get(name)), ""))
