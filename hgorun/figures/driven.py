"""Panels of closed loops: what each observer makes of the plant that it drives, beside state feedback."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hgorun.errors import ConfigError, printable
from hgorun.figures import data
from hgorun.figures.actors import Simulated
from hgorun.figures.data import Curve
from hgorun.figures.panels import lines_of
from hgorun.figures.scene import Scene
from hgorun.figures.style import STATE_FEEDBACK
from hgorun.result.records.closed import ClosedLoop
from hgorun.result.records.data import PLANT, ResultData
from hgorun.tables.typeset import symbol, unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_driven(ax: Axes, scene: Scene, name: str) -> None:
    """A state of the plants that the observers drive."""
    _draw(ax, scene, lambda result: result.states, name, lambda loop, k: loop.x[:, k])
    ax.set_ylabel(f"${symbol(name)}$" + unit(_unit_of(scene, name)))


def draw_input(ax: Axes, scene: Scene, name: str) -> None:
    """An input as each observer sets it."""
    _draw(ax, scene, lambda result: result.inputs, name, lambda loop, k: loop.u[:, k])
    ax.set_ylabel(f"${symbol(name)}$" + unit(_unit_of(scene, name)))


def _unit_of(scene: Scene, name: str) -> str:
    return next((r.units[name] for r in scene.results.values() if r.units.get(name)), "")


def _draw(
    ax: Axes,
    scene: Scene,
    names: Callable[[ResultData], tuple[str, ...]],
    name: str,
    of: Callable[[ClosedLoop, int], np.ndarray],
) -> None:
    references = []
    for run, result in scene.results.items():
        if not result.closed_loop:
            raise ConfigError(f"{printable(run)}: it has no controller, and no plants that observers drive")
        if name in names(result):
            values = of(result.closed_loop[PLANT], names(result).index(name))
            curve = data.inside(Curve(result.time, values), scene.window)
            ax.plot(*data.thinned(curve), **{**scene.truths[run], "label": STATE_FEEDBACK})
            references.append(curve.v)

    def driven(actor: Simulated) -> np.ndarray | None:
        known = names(actor.result)
        return of(actor.result.closed_loop[actor.label], known.index(name)) if name in known else None

    healthy, lost = lines_of(ax, scene, driven)
    limits = data.state_limits(references, healthy, lost)
    if limits is not None:
        ax.set_ylim(limits)
