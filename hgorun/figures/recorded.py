"""What panels of recorded data show beside estimates and their bands: outliers, and measurements that were not used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.figures.data import without_outliers
from hgorun.figures.looks import Look
from hgorun.figures.scene import Scene
from hgorun.figures.style import AMONG, HELD_OUT, IN_FRONT, OUTLIERS, REFERENCE
from hgorun.result.records.data import ResultData
from hgorun.result.records.recorded import Unseen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D


FEW = 120  # samples in front of lines: more of them would hide these
_HIDDEN = 0.01  # of a panel's height: about half the width of a line
_LARGE = 60  # marks of what was not given in their full size: of more, each is smaller
_MANY = 200  # of these marks: more of them would hide samples and estimates


def draw_unseen(ax: Axes, scene: Scene, state: str) -> list[np.ndarray]:
    """Outliers, and measurements that no observer was given; the values of the latter that an axis is made for."""
    drawn, told = [], set()
    for run, result in scene.results.items():
        theirs = {a.label: scene.looks[a.order] for a in scene.actors if a.run == run}
        for label, one, style in _marks(result, state, theirs):
            inside = np.isfinite(one.y)
            if scene.window is not None:
                inside &= (one.taken >= scene.window[0]) & (one.taken <= scene.window[1])
            if inside.any():
                how = {**style, "label": "_" if label in told else label}
                if style["marker"] != OUTLIERS["marker"]:
                    how |= _fitting(style, int(np.count_nonzero(inside)))
                    drawn.append(without_outliers(one.y[inside]))
                ax.plot(one.taken[inside], one.y[inside], **how)
                told.add(label)
    return drawn


def _fitting(style: Mapping[str, Any], count: int) -> dict[str, Any]:
    """What changes in a mark of which there are so many: they are compared with the estimates, and are to be seen."""
    if count > _MANY:
        return AMONG
    part = min(1.0, (_LARGE / count) ** 0.5)  # all of them together cover no larger area
    return {"markersize": part * style["markersize"], "markeredgewidth": part * style["markeredgewidth"]}


def draw_in_front(ax: Axes, scene: Scene, state: str, samples: Sequence[Line2D]) -> None:
    """Some of many samples once more, in front, where the lines of estimates hide nearly all of them.

    They look as those behind, which the legend names.

    Parameters
    ----------
    samples : sequence of Line2D
        Those of recordings, as they are drawn behind the lines; the axis has its limits.
    """
    estimates = [
        (a.result.time, a.observer.xhat[:, a.result.states.index(state)])
        for a in scene.actors
        if state in a.result.states
    ]
    low, high = ax.get_ylim()
    for line in samples:
        t, y = np.array(line.get_data(), dtype=float)
        apart = [np.abs(np.interp(t, time, xhat) - y) for time, xhat in estimates]
        # of an estimate that is lost there is no line
        if t.size > FEW and apart and np.median(np.fmin.reduce(apart)) < _HIDDEN * (high - low):
            some = np.linspace(0, t.size - 1, FEW).round().astype(int)
            (again,) = ax.plot(t[some], y[some])
            again.update_from(line)
            again.set(label="_", zorder=IN_FRONT["zorder"])


def _marks(result: ResultData, state: str, looks: Mapping[str, Look]) -> list[tuple[str, Unseen, dict[str, Any]]]:
    recorded = result.recorded
    if recorded is None or state not in result.states:
        return []
    found: list[tuple[str, Unseen, dict[str, Any]]] = []
    for output in result.outputs_of(state):
        one = recorded.outputs[output]
        out = ~np.any(one.used, axis=1)
        found.append(("not used", Unseen(one.taken[out], one.y[out]), OUTLIERS))
        for k, label in enumerate(result.observers):  # what others have taken stays a dot, with a cross on it
            own = ~one.used[:, k] & ~out
            if label in looks:
                cross = {**OUTLIERS, "color": looks[label].colour, "zorder": 4.6}
                found.append((f"not used by {looks[label].text}", Unseen(one.taken[own], one.y[own]), cross))
    names = dict.fromkeys((state, *result.outputs_of(state)))  # a file may hold out a state that is no output
    for name in names:
        held_out = recorded.held_out.get(name)
        if name in recorded.reference:
            taken = [Unseen(one.taken, one.y) for one in map(recorded.outputs.get, result.outputs_of(state)) if one]
            known = [*taken, *([held_out] if held_out is not None else [])]
            found.append(("reference", _without(recorded.reference[name], known), REFERENCE))
        if held_out is not None:
            found.append(("held out", held_out, HELD_OUT))
    return found


def _without(points: Unseen, others: Sequence[Unseen]) -> Unseen:
    """Those that are not among others: the reference of an output may be its samples themselves, taken or held out."""
    known = {pair for one in others for pair in zip(one.taken.tolist(), one.y.tolist(), strict=True)}
    own = [pair not in known for pair in zip(points.taken.tolist(), points.y.tolist(), strict=True)]
    return Unseen(points.taken[own], points.y[own])
