"""One set of axes: what is drawn in it, in which order, in which limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.figures import data
from hgorun.figures.actors import Simulated
from hgorun.figures.data import Curve
from hgorun.figures.estimated_bands import draw_bands
from hgorun.figures.recorded import FEW, draw_in_front, draw_unseen
from hgorun.figures.scene import Scene
from hgorun.figures.style import AMONG, DARK, DOTS, IN_FRONT, OTHER_MEASUREMENTS, OUTLIERS, PALE, TRACE, WIDER, WIDTHS
from hgorun.result.records.data import ResultData
from hgorun.tables.typeset import both, error_of, estimate_of, symbol, unit, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MANY = 500  # dots: more of them are smaller, so that other marks are seen among them


def draw_state(ax: Axes, scene: Scene, name: str, *, samples: bool = False) -> None:
    """A state, true and estimated."""
    own = {run: r for run, r in scene.results.items() if name in r.states}
    simulated = {run: r for run, r in own.items() if r.recorded is None}
    truths = _truths(ax, scene, {run: Curve(r.time, r.x[:, r.states.index(name)]) for run, r in simulated.items()})
    known = own if samples else {run: r for run, r in own.items() if r.recorded is not None}
    measured = _samples(ax, scene, {run: r.outputs_of(name) for run, r in known.items()})
    bands = draw_bands(ax, scene, name)
    truths += draw_unseen(ax, scene, name)
    dots = [line for line in ax.lines if line.get_linestyle() == "None" and line.get_marker() != OUTLIERS["marker"]]
    behind = [line for line in dots if line.get_zorder() in (DOTS["zorder"], AMONG["zorder"])]
    healthy, lost = _estimates(ax, scene, name, lambda actor, xhat, k: xhat)
    _limit(ax, data.with_bands(data.state_limits(truths + measured, healthy, lost), bands))
    if len(simulated) < len(own):
        draw_in_front(ax, scene, name, behind)
    ax.set_ylabel(f"${_shown(name, scene, true=bool(truths or measured))}$" + _unit(scene, name))


def _shown(name: str, scene: Scene, *, true: bool) -> str:
    """What an axis calls a state: truth and estimate, or of recorded data what was measured, else the estimate."""
    if not scene.actors:
        return symbol(name)
    if all(one.recorded is not None for one in scene.results.values()):
        return symbol(name) if true else estimate_of(name)
    return both(name)


def draw_error(ax: Axes, scene: Scene, name: str) -> None:
    """Estimates of a state minus the truth."""
    ax.axhline(0, color="black", linewidth=0.5, zorder=1)
    _limit(ax, data.error_limits(*_estimates(ax, scene, name, lambda actor, xhat, k: xhat - actor.truth[:, k])))
    ax.set_ylabel(f"${error_of(name)}$" + _unit(scene, name))


def draw_magnitude(ax: Axes, scene: Scene, name: str) -> None:
    """The largest error in a moving window, logarithmic."""
    ax.set_yscale("log")
    ax.set_ylim(1e-16, 1.0)  # stays when there is no error to show
    healthy, lost = _estimates(
        ax, scene, name, lambda actor, xhat, k: np.abs(xhat - actor.truth[:, k]), moving_maximum=True
    )
    _limit(ax, data.magnitude_limits(healthy, lost))
    ax.set_ylabel(f"$|{error_of(name)}|$" + _unit(scene, name))


def draw_output(ax: Axes, scene: Scene, name: str) -> None:
    """An output, measured and free of noise."""
    own = {run: r for run, r in scene.results.items() if name in r.outputs}
    measured = _samples(ax, scene, {run: (name,) for run in own})
    simulated = {run: r for run, r in own.items() if r.recorded is None}
    truths = _truths(ax, scene, {run: Curve(r.time, r.y[:, r.outputs.index(name)]) for run, r in simulated.items()})
    _limit(ax, data.state_limits(truths + measured, [], []))
    is_state = any(name in r.outputs_of(name) for r in own.values())
    named_alike = any(name in r.states for r in own.values()) and not is_state  # the unit is that of the state
    unit = "" if named_alike else _unit(scene, name)
    ax.set_ylabel((f"$y = {symbol(name)}$" if is_state else f"${symbol(name)}$") + unit)


def moving_window(result: ResultData) -> float:
    """Length of the moving window of :func:`draw_magnitude`: the metrics' moving average."""
    span = float(result.time[-1] - result.time[0]) if result.time.size else 0.0
    return float(result.windows.get("average") or 0.01 * span)


def points_in_window(result: ResultData) -> int:
    """How many steps of the output grid :func:`moving_window` has."""
    return round(moving_window(result) / float(result.time[1] - result.time[0])) if result.time.size > 1 else 0


def window_words(what: str, results: Sequence[ResultData]) -> str:
    """``largest error in a moving window of 0.08 s``; without the length where results differ in it."""
    windows = {f"{moving_window(r):.4g} {words(r.units.get('time', ''))}".rstrip() for r in results}
    return f"largest {what} in a moving window" + (f" of {windows.pop()}" if len(windows) == 1 else "")


def _estimates(
    ax: Axes,
    scene: Scene,
    name: str,
    of: Callable[[Simulated, np.ndarray, int], np.ndarray],
    *,
    moving_maximum: bool = False,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Draw all observers, the roughest at the back.

    Returns
    -------
    tuple of list of ndarray
        The values drawn of sound and of diverged observers.
    """

    def values(actor: Simulated) -> np.ndarray | None:
        if name not in actor.result.states or name in actor.observer.unestimated:
            return None
        column = actor.result.states.index(name)
        return of(actor, actor.observer.xhat[:, column], column)

    return lines_of(ax, scene, values, moving_maximum=moving_maximum)


def lines_of(
    ax: Axes, scene: Scene, values: Callable[[Simulated], np.ndarray | None], *, moving_maximum: bool = False
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Draw a line for each observer, the roughest at the back; ``values`` are None for those without.

    Lines in front are thinner, so that one behind them is seen where both coincide; an observer's is as thick in every
    panel. One that is much rougher here than another one stands behind it here. One that would be a block of colour is
    pale, with its mean in it.

    Returns
    -------
    tuple of list of ndarray
        The values drawn of sound and of diverged observers.
    """
    drawn: list[tuple[Simulated, Curve]] = []
    for actor in scene.actors:
        result, own = actor.result, values(actor)
        if own is None:
            continue
        curve = data.finite(result.time, own)
        if moving_maximum:
            curve = curve._replace(v=data.moving_maximum(curve.v, points_in_window(result)))
        curve = data.inside(curve, scene.window)
        drawn.append((actor, curve))
    count = len(scene.actors)
    widths = np.linspace(min(WIDTHS[0], WIDTHS[1] + WIDER * (count - 1)), WIDTHS[1], count) if count > 1 else [1.0]
    back = sorted(range(len(drawn)), key=lambda k: scene.ranks[drawn[k][0].order])
    place = data.behind([drawn[k][1] for k in back])
    front = {drawn[back[k]][0].order: i for i, k in enumerate(place)}
    for actor, curve in drawn:
        look, rank = scene.looks[actor.order], scene.ranks[actor.order]
        how: dict[str, Any] = {"color": look.colour, "zorder": 3 + front[actor.order] / (count + 1)}
        mean = data.mean_of_block(curve)
        if mean is not None:
            _line(ax, curve, **how, alpha=PALE, linewidth=0.6)
        _line(ax, mean or curve, **how, linestyle=look.dashes, label=look.text, linewidth=widths[rank])
    healthy = [c.v for actor, c in drawn if not actor.observer.lost]
    return healthy, [c.v for actor, c in drawn if actor.observer.lost]


def _samples(ax: Axes, scene: Scene, outputs: Mapping[str, Sequence[str]]) -> list[np.ndarray]:
    """Measurements: dots, or a line where a simulation has one at every point of the output grid.

    Parameters
    ----------
    outputs : mapping of str to sequence of str
        Of every run.
    """
    own: dict[tuple[str, str], tuple[Curve, np.ndarray]] = {}
    for run, name in ((run, name) for run, names in outputs.items() for name in names):
        result = scene.results[run]
        t, y = _measured(result, name)
        known = np.isfinite(y)
        if scene.window is not None:
            known &= (t >= scene.window[0]) & (t <= scene.window[1])
        curve = Curve(t[known], y[known])
        if not any(np.array_equal(curve.t, c.t) and np.array_equal(curve.v, c.v) for c, _ in own.values()):
            recorded = result.recorded is not None  # whose samples stand for themselves, with outliers among them
            own[run, name] = curve, np.zeros(curve.t.size, dtype=bool) if recorded else _dense(curve.t, result.time)
    several = len({name for _, name in own}) > 1
    for i, ((run, name), (curve, dense)) in enumerate(own.items()):
        light, dark, marker = OTHER_MEASUREMENTS[i % len(OTHER_MEASUREMENTS)]
        whose = ", ".join([words(run)] * (len({run for run, _ in own}) > 1) + [words(name)] * several)
        text: dict[str, Any] = {"label": f"{whose}: measured"} if whose else {}
        for piece in np.split(np.arange(curve.t.size), np.flatnonzero(np.diff(dense)) + 1):
            if piece.size and dense[piece[0]]:
                _line(ax, Curve(curve.t[piece], curve.v[piece]), **{**TRACE, "color": light, **text})
        if not np.all(dense):
            count = np.count_nonzero(~dense)
            recorded = scene.results[run].recorded is not None
            size = {} if count <= (2 * FEW if recorded else _MANY) else {"markersize": 1.5}
            if recorded and count <= FEW:
                size, dark = IN_FRONT, DARK
            ax.plot(curve.t[~dense], curve.v[~dense], **{**DOTS, "color": dark, "marker": marker, **size, **text})
    recorded_too = {run for run, r in scene.results.items() if r.recorded is not None}
    return [data.without_outliers(c.v) if run in recorded_too else c.v for (run, _), (c, _) in own.items()]


def _measured(result: ResultData, output: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of an output's measurements: recorded ones when they were taken, simulated at their arrival."""
    if result.recorded is not None:
        one = result.recorded.outputs[output]
        order = np.argsort(one.taken, kind="stable")
        order = order[np.any(one.used, axis=1)[order]]  # others have a mark of their own
        return one.taken[order], one.y[order]
    return result.measurements.time, result.measurements.y[:, result.outputs.index(output)]


def _dense(t: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Which of the times lie as close to a neighbour as the points of the output grid."""
    if t.size < 2 or grid.size < 2:
        return np.zeros(t.size, dtype=bool)
    close = np.diff(t) <= 1.001 * (grid[1] - grid[0])
    return np.asarray(np.concatenate([close[:1], close]) | np.concatenate([close, close[-1:]]))


def _truths(ax: Axes, scene: Scene, curves: Mapping[str, Curve]) -> list[np.ndarray]:
    """Draw the truths of the runs, of equal ones the longest; the values drawn."""
    longest: dict[str, tuple[str, Curve]] = {}
    for run, curve in curves.items():
        text = str(scene.truths[run]["label"])
        if text not in longest or np.ptp(curve.t) > np.ptp(longest[text][1].t):
            longest[text] = run, data.inside(curve, scene.window)
    for run, curve in longest.values():
        _line(ax, curve, **scene.truths[run])
    return [curve.v for _, curve in longest.values()]


def _line(ax: Axes, curve: Curve, **how: Any) -> None:
    ax.plot(*data.thinned(curve), **how)


def _limit(ax: Axes, limits: tuple[float, float] | None) -> None:
    if limits is not None:
        ax.set_ylim(limits)


def _unit(scene: Scene, name: str) -> str:
    return unit(next((r.units[name] for r in scene.results.values() if r.units.get(name)), ""))
