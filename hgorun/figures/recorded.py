"""What panels of recorded data show beside estimates: bands, outliers, and measurements that were not used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.figures.scene import Scene
from hgorun.figures.style import HELD_OUT, OUTLIERS, REFERENCE
from hgorun.result.data import ResultData
from hgorun.result.recorded import Unseen

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_bands(ax: Axes, scene: Scene, state: str) -> list[np.ndarray]:
    """The band of every estimate that has one; nothing that a panel has to be wide enough for."""
    for actor in scene.actors:
        assessed, result = actor.observer.assessed, actor.result
        if assessed is None or state not in result.states:
            continue
        k = result.states.index(state)
        lower, upper = assessed.lower[:, k], assessed.upper[:, k]
        if np.any(np.isfinite(lower)):
            colour = scene.looks[actor.order].colour
            ax.fill_between(result.time, lower, upper, color=colour, alpha=0.18, linewidth=0, zorder=1.2)
    return []


def draw_unseen(ax: Axes, scene: Scene, state: str) -> list[np.ndarray]:
    """Outliers, and measurements that no observer was given; the values of the latter."""
    drawn, told = [], set()
    for result in scene.results.values():
        for label, one, style in _marks(result, state):
            inside = np.isfinite(one.y)
            if scene.window is not None:
                inside &= (one.taken >= scene.window[0]) & (one.taken <= scene.window[1])
            if inside.any():
                text = {} if label in told else {"label": label}
                told.add(label)
                ax.plot(one.taken[inside], one.y[inside], **{**style, **text})
                if style is not OUTLIERS:
                    drawn.append(one.y[inside])
    return drawn


def _marks(result: ResultData, state: str) -> list[tuple[str, Unseen, dict[str, Any]]]:
    recorded = result.recorded
    if recorded is None or state not in result.states:
        return []
    found: list[tuple[str, Unseen, dict[str, Any]]] = []
    for output in result.outputs_of(state):
        one = recorded.outputs[output]
        out = ~np.any(one.used, axis=1)
        found.append(("not used", Unseen(one.taken[out], one.y[out]), OUTLIERS))
    names = dict.fromkeys((state, *result.outputs_of(state)))  # a file may hold out a state that is no output
    for label, unseen, style in (
        ("reference", recorded.reference, REFERENCE),
        ("held out", recorded.held_out, HELD_OUT),
    ):
        found.extend((label, unseen[name], style) for name in names if name in unseen)
    return found
