"""Figures of results, drawn with matplotlib's objects: no pyplot, no global state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.config.study import Figure as FigureBlock
from hgorun.config.study import Inset, Panel
from hgorun.errors import ConfigError, printable
from hgorun.figures.actors import Actor, Simulated, cast, cast_ensembles, texts
from hgorun.figures.driven import draw_driven, draw_input
from hgorun.figures.followed import MembersData
from hgorun.figures.layout import TOP, finished, grid, time_axis
from hgorun.figures.looks import Look, looks
from hgorun.figures.members import draw_members
from hgorun.figures.names import check, names_of
from hgorun.figures.panels import draw_error, draw_magnitude, draw_output, draw_state, moving_window
from hgorun.figures.scaling import ScalingData, draw_scaling
from hgorun.figures.scene import Scene
from hgorun.figures.style import INSET, INSET_FRAME, LARGEST_NUMBER, PANEL, styled
from hgorun.figures.truths import truth_looks
from hgorun.result.data import ResultData
from hgorun.result.run_names import run_names
from hgorun.tables.typeset import paragraph, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Inches: width of a comparison, height of its rows, of a figure's panels.
_WIDTH, _ROW = 7.2, 1.8


@dataclass(frozen=True)
class _Stage:
    """A panel of a figure's block with what it shows."""

    panel: Panel
    actors: Sequence[Actor]
    results: Mapping[str, ResultData]
    ensemble: ScalingData | MembersData | None

    @property
    def span(self) -> tuple[float, float] | None:
        """The time shown."""
        if self.panel.window is not None or isinstance(self.ensemble, ScalingData):
            return self.panel.window
        if self.ensemble is not None:
            return self.ensemble.span
        return _span(list(self.results.values()))


def comparison(results: ResultData | Sequence[ResultData]) -> Figure:
    """Every state with all estimates on the left, the size of the errors on the right.

    Errors are drawn as the largest ``|xhat - x|`` in a moving window as long as the metrics' moving average,
    on a logarithmic axis: noisy errors cross zero so often that they would hide each other.

    Parameters
    ----------
    results : ResultData or sequence of ResultData
        Labels are ``name: label`` when there are several.

    Returns
    -------
    matplotlib.figure.Figure
    """
    runs = _runs(results)
    several, actors = list(runs.values()), cast(_several(results))
    states = list(dict.fromkeys(name for r in several for name in r.states))
    look = looks([actors], texts(actors, {}, with_run=len(runs) > 1))
    scene = Scene(runs, actors, look, truth_looks([list(runs)], runs))
    if any(r.recorded is not None for r in several):
        return _of_recorded(scene, several, states)
    closed = all(r.closed_loop for r in several)
    with styled():
        figure, axes = grid(2 * len(states), 2, _WIDTH, _ROW * len(states) + TOP, share=True)
        for left, right, name in zip(axes[::2], axes[1::2], states, strict=True):
            (draw_driven if closed else draw_state)(left, scene, name)
            draw_magnitude(right, scene, name)
            for ax in (left, right):
                time_axis(ax, several, _span(several))
        axes[0].set_title("driven plants" if closed else "states and estimates")
        axes[1].set_title(_magnitude_title(several))
        return finished(figure, axes, 2, several[0].title if len(several) == 1 else None, grow=True)


def _of_recorded(scene: Scene, results: Sequence[ResultData], states: Sequence[str]) -> Figure:
    """Every state with all estimates; without a truth there are no errors."""
    with styled():
        figure, axes = grid(len(states), 1, _WIDTH, _ROW * len(states) + TOP, share=True)
        for ax, name in zip(axes, states, strict=True):
            draw_state(ax, scene, name, samples=True)
            time_axis(ax, results, _span(results))
        axes[0].set_title("estimates")
        return finished(figure, axes, 1, results[0].title if len(results) == 1 else None, grow=True)


def draw(
    results: ResultData | Sequence[ResultData],
    figure: FigureBlock,
    name: str = "figure",
    *,
    scalings: Mapping[int, ScalingData] | None = None,
    members: Mapping[int, MembersData] | None = None,
) -> Figure:
    """A figure of the configuration's ``figures`` block.

    Panels that show the same state in the same window have the same vertical axis. Measurements stand at the
    time of their arrival. A panel with one observer is titled with its label where panels differ.

    Parameters
    ----------
    results : ResultData or sequence of ResultData
        The runs of a file; ``ResultData.name`` is the run's name.
    figure : hgorun.config.models.Figure
    name : str
        Its key, for messages.
    scalings : mapping of int to ScalingData, optional
        What scaling panels show, by the panel's place.
    members : mapping of int to MembersData, optional
        What panels of the trajectories of ensembles show, by the panel's place.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    Problem
        When a panel names what does not exist; see :func:`hgorun.figures.names.check`.
    """
    scalings, members = scalings or {}, members or {}
    ensembles: dict[int, ScalingData | MembersData] = {**scalings, **members}
    runs = _runs(results) if results or not ensembles else {}
    check({name: figure}, names_of(list(runs.values()), scalings.values(), members.values()))
    stages = _stages(figure.panels, runs, ensembles)
    shown = [stage.actors for stage in stages]
    look = looks(shown, texts([a for group in shown for a in group], figure.labels))
    truths = truth_looks([list(stage.results) for stage in stages], runs)
    with styled():
        rows = -(-len(stages) // figure.columns)
        spans = [stage.span for stage in stages]
        share = len(set(spans)) == 1 and not scalings
        height = figure.height or PANEL * rows
        made, axes = grid(len(stages), figure.columns, figure.width, height, share=share)
        scenes = [_draw_panel(ax, stage, look, truths) for ax, stage in zip(axes, stages, strict=True)]
        _level(axes, figure.panels)
        for ax, title in zip(axes, _titles(stages, look), strict=True):
            if title:
                ax.set_title(paragraph(title, figure.width / figure.columns))
        for ax, scene, panel in zip(axes, scenes, figure.panels, strict=True):
            if panel.inset is not None and scene is not None:
                _draw_inset(ax, scene, panel, panel.inset)
        return finished(made, axes, figure.columns, figure.title, grow=figure.height is None)


def _several(results: ResultData | Sequence[ResultData]) -> list[ResultData]:
    several = [results] if isinstance(results, ResultData) else list(results)
    if not several:
        raise ValueError("a figure needs at least one result")
    for result in several:
        _require_drawable(result)
    return several


def _require_drawable(result: ResultData) -> None:
    """Axes can be divided up to some size of numbers only; of an estimate that is lost only the rest is drawn."""
    shown = {"time": result.time, "the truth": result.x, "the outputs": result.y}
    shown |= {f"the estimate of {label}": o.xhat for label, o in result.observers.items() if not o.lost}
    for what, values in shown.items():
        if not np.all(np.abs(values) <= LARGEST_NUMBER):
            raise ConfigError(
                f"{printable(result.name)}: {what} cannot be drawn: numbers beyond {LARGEST_NUMBER:g}, or none"
            )


def _runs(results: ResultData | Sequence[ResultData]) -> dict[str, ResultData]:
    several = _several(results)
    return dict(zip(run_names(several), several, strict=True))


def _stages(
    panels: Sequence[Panel], runs: Mapping[str, ResultData], ensembles: Mapping[int, ScalingData | MembersData]
) -> list[_Stage]:
    everybody = cast(list(runs.values()))
    theirs = cast_ensembles(ensembles, len(everybody))
    stages = []
    for i, panel in enumerate(panels):
        if i in ensembles:
            stages.append(_Stage(panel, [a for a in theirs[i] if a.among(panel.observers)], {}, ensembles[i]))
            continue
        if panel.scaling is not None:
            raise ValueError(f"panel {i} shows scaling, but no data were given for it")
        own = {run: r for run, r in runs.items() if panel.run in (None, run)}
        actors = [a for a in everybody if panel.output is None and a.run in own and a.among(panel.observers)]
        if panel.observers and actors:  # the truth of those picked, or everybody's
            own = {run: r for run, r in own.items() if any(a.run == run for a in actors)}
        stages.append(_Stage(panel, actors, own, None))
    return stages


def _magnitude_title(results: Sequence[ResultData]) -> str:
    windows = {f"{moving_window(r):.4g} {words(r.units.get('time', ''))}".rstrip() for r in results}
    return "largest error in a moving window" + (f" of {windows.pop()}" if len(windows) == 1 else "")


def _titles(stages: Sequence[_Stage], look: Mapping[int, Look]) -> list[str | None]:
    differ = len({tuple(a.order for a in stage.actors) for stage in stages if stage.actors}) > 1
    titles: list[str | None] = []
    said = False
    for stage in stages:
        title = stage.panel.title
        if title is None and differ and len(stage.actors) == 1:
            title = look[stage.actors[0].order].text
        if title is None and stage.panel.magnitude is not None and stage.ensemble is None and not said:
            title, said = _magnitude_title(list(stage.results.values())), True
        titles.append(title)
    return titles


def _draw_panel(
    ax: Axes, stage: _Stage, look: Mapping[int, Look], truths: Mapping[str, Mapping[str, Any]]
) -> Scene | None:
    """Draw a panel; the scene that an inset is drawn from, too."""
    panel, scene = stage.panel, None
    labels = {a.label: a.order for a in stage.actors}
    if isinstance(stage.ensemble, MembersData):
        draw_members(ax, stage.ensemble, labels, look, panel)
    elif panel.scaling is not None and stage.ensemble is not None:
        draw_scaling(ax, stage.ensemble, labels, look, panel.scaling.of, panel.scaling.axes)
    else:
        actors = [a for a in stage.actors if isinstance(a, Simulated)]
        scene = Scene(stage.results, actors, look, truths, panel.window)
        _draw_subject(ax, scene, panel)
        time_axis(ax, list(stage.results.values()), stage.span)
    if panel.limits is not None:
        ax.set_ylim(panel.limits)
    return scene


def _draw_subject(ax: Axes, scene: Scene, panel: Panel) -> None:
    if panel.error is not None or panel.magnitude is not None:
        _require_truth(scene)
    if panel.error is not None:
        draw_error(ax, scene, panel.error)
    elif panel.magnitude is not None:
        draw_magnitude(ax, scene, panel.magnitude)
    elif panel.state is not None:
        draw_state(ax, scene, panel.state, samples=panel.measurements)
    elif panel.output is not None:
        draw_output(ax, scene, panel.output)
    elif panel.driven is not None:
        draw_driven(ax, scene, panel.driven)
    elif panel.input is not None:
        draw_input(ax, scene, panel.input)


def _require_truth(scene: Scene) -> None:
    for name, result in scene.results.items():
        if result.recorded is not None:
            raise ConfigError(f"{printable(name)}: errors cannot be drawn: of recorded data no truth is known")


def _draw_inset(ax: Axes, scene: Scene, panel: Panel, inset: Inset) -> None:
    """The panel's lines once more, in the inset's window."""
    inner = ax.inset_axes(inset.place, zorder=7)
    _draw_subject(inner, replace(scene, window=inset.window), panel)
    inner.set_ylabel("")
    inner.set_xlim(inset.window)
    if inset.limits is not None:
        inner.set_ylim(inset.limits)
    inner.tick_params(which="both", **INSET)
    ax.indicate_inset_zoom(inner, **INSET_FRAME)


def _span(results: Sequence[ResultData]) -> tuple[float, float] | None:
    ends = [(float(r.time[0]), float(r.time[-1])) for r in results if r.time.size]
    return (min(a for a, _ in ends), max(b for _, b in ends)) if ends else None


def _level(axes: Sequence[Axes], panels: Sequence[Panel]) -> None:
    """The same range for panels that show the same state, so that they can be compared."""
    groups: dict[Any, list[Axes]] = {}
    for ax, panel in zip(axes, panels, strict=True):
        if panel.state is not None and panel.limits is None:
            groups.setdefault((panel.state, panel.window, panel.measurements), []).append(ax)
    for group in groups.values():
        ranges = [ax.get_ylim() for ax in group]
        for ax in group:
            ax.set_ylim(min(low for low, _ in ranges), max(high for _, high in ranges))
