"""Figures of results, drawn with matplotlib's objects: no pyplot, no global state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from hgorun.config.study import Figure as FigureBlock
from hgorun.config.study import Panel
from hgorun.errors import ConfigError, printable
from hgorun.figures.actors import Simulated, cast, texts
from hgorun.figures.driven import draw_driven, draw_input
from hgorun.figures.followed import MembersData
from hgorun.figures.insets import draw_inset, make_room
from hgorun.figures.layout import TOP, finished, grid, time_axis
from hgorun.figures.looks import Look, looks
from hgorun.figures.members import draw_members
from hgorun.figures.names import check, names_of
from hgorun.figures.page import LIGHT, NARROW, Page, on_page
from hgorun.figures.panels import draw_error, draw_magnitude, draw_output, draw_state, window_words
from hgorun.figures.scaling import ScalingData, draw_scaling
from hgorun.figures.scene import Scene
from hgorun.figures.stages import Stage, runs_of, several_of, span_of, stages_of, titles_of
from hgorun.figures.style import PANEL, styled
from hgorun.figures.truths import truth_looks
from hgorun.result.records.data import ResultData
from hgorun.tables.typeset import paragraph

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW = 1.8  # inches: height of a comparison's rows


def comparison(results: ResultData | Sequence[ResultData], page: Page = LIGHT) -> Figure:
    """Every state with all estimates on the left, the size of the errors on the right.

    Errors are drawn as the largest ``|xhat - x|`` in a moving window as long as the metrics' moving average,
    on a logarithmic axis: noisy errors cross zero so often that they would hide each other. What a panel cuts off is
    marked at its edge, with the value.

    Parameters
    ----------
    results : ResultData or sequence of ResultData
        Labels are ``name: label`` when there are several.
    page : Page
        On a narrow one the errors of a state stand below it.

    Returns
    -------
    matplotlib.figure.Figure
    """
    runs = runs_of(results)
    several, actors = list(runs.values()), cast(several_of(results))
    states = list(dict.fromkeys(name for r in several for name in r.states))
    look = looks([actors], texts(actors, {}, with_run=len(runs) > 1))
    scene = Scene(runs, actors, look, truth_looks([list(runs)], runs))
    if any(r.recorded is not None for r in several):
        return _of_recorded(scene, several, states, page)
    closed = all(r.closed_loop for r in several)
    columns = 1 if page.width < NARROW else 2
    with styled():
        count = 2 * len(states)
        figure, axes = grid(count, columns, page.width, _ROW * (count // columns) + TOP, share=True)
        for left, right, name in zip(axes[::2], axes[1::2], states, strict=True):
            (draw_driven if closed else draw_state)(left, scene, name)
            draw_magnitude(right, scene, name)
            for ax in (left, right):
                time_axis(ax, several, span_of(several))
        titled = axes if columns == 1 else axes[:2]  # below each other each has its own, else the columns have
        for ax in titled[::2]:
            ax.set_title("driven plants" if closed else "states and estimates")
        for ax in titled[1::2]:
            ax.set_title(paragraph(window_words("error", several), page.width / columns))
        title = several[0].title if len(several) == 1 else None
        return on_page(finished(figure, axes, columns, title, grow=True, cuts=True, order=scene.texts), page.style)


def _of_recorded(scene: Scene, results: Sequence[ResultData], states: Sequence[str], page: Page) -> Figure:
    """Every state with all estimates; without a truth there are no errors."""
    with styled():
        figure, axes = grid(len(states), 1, page.width, _ROW * len(states) + TOP, share=True)
        for ax, name in zip(axes, states, strict=True):
            draw_state(ax, scene, name, samples=True)
            time_axis(ax, results, span_of(results))
        axes[0].set_title("estimates")
        title = results[0].title if len(results) == 1 else None
        return on_page(finished(figure, axes, 1, title, grow=True, cuts=True, order=scene.texts), page.style)


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
    runs = runs_of(results) if results or not ensembles else {}
    check({name: figure}, names_of(list(runs.values()), scalings.values(), members.values()))
    stages = stages_of(figure.panels, runs, ensembles)
    shown = [stage.actors for stage in stages]
    look = looks(shown, texts([a for group in shown for a in group], figure.labels))
    truths = truth_looks([list(stage.results) for stage in stages], runs)
    with styled():
        rows = -(-len(stages) // figure.columns)
        spans = [stage.span for stage in stages]
        share = len(set(spans)) == 1 and not scalings
        height = figure.height or PANEL * rows
        made, axes = grid(len(stages), figure.columns, figure.width, height, share=share)
        scenes = [_draw_panel(ax, stage, look, truths, figure.style) for ax, stage in zip(axes, stages, strict=True)]
        places = [
            make_room(ax, panel.inset, free=panel.limits is None) if panel.inset is not None else None
            for ax, panel in zip(axes, figure.panels, strict=True)
        ]
        _level(axes, figure.panels)
        for ax, title in zip(axes, titles_of(stages, look), strict=True):
            if title:
                ax.set_title(paragraph(title, figure.width / figure.columns))
        for ax, scene, panel, place in zip(axes, scenes, figure.panels, places, strict=True):
            if panel.inset is not None and place is not None and scene is not None:
                detail = replace(scene, window=panel.inset.window)
                draw_inset(ax, panel.inset, place, partial(_draw_subject, scene=detail, panel=panel))
        order = [look[place].text for place in sorted(look)]
        whole = finished(made, axes, figure.columns, figure.title, grow=figure.height is None, cuts=True, order=order)
        return on_page(whole, figure.style)


def _draw_panel(
    ax: Axes, stage: Stage, look: Mapping[int, Look], truths: Mapping[str, Mapping[str, Any]], style: str
) -> Scene | None:
    """Draw a panel; the scene that an inset is drawn from, too."""
    panel, scene = stage.panel, None
    labels = {a.label: a.order for a in stage.actors}
    if isinstance(stage.ensemble, MembersData):
        draw_members(ax, stage.ensemble, labels, look, panel, style)
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
            raise ConfigError(f"{printable(name)}: errors cannot be drawn: the truth of recorded data is not known")


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
