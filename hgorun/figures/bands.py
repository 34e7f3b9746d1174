"""Trajectories of many members: how they are spread at every time, or all of them coloured by what differs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats, Trajectories, levels, shown
from hgorun.errors import ConfigError
from hgorun.figures.data import (
    MAX_POINTS,
    Curve,
    finite,
    magnitude_limits,
    mean_of_block,
    moving_maximum,
    state_limits,
    thinned,
)
from hgorun.figures.ensemble import WIDTH, Cast, axis_label, drawable, headed, logarithmic, pooled_over
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.looks import Look
from hgorun.figures.lost import (
    draw_bands,
    draw_crosses,
    drawn_median,
    first_lost,
    largest_of,
    spread,
    within_sound,
    words_of_lost,
)
from hgorun.figures.page import AS_IT_IS, LIGHT, Page
from hgorun.figures.style import PALE, TRUTH, styled
from hgorun.tables.typeset import both, error_of, paragraph, time_unit, unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW = 1.8
_WINDOW = 0.01  # of the time that is shown: errors are the largest in it
POINTS = 1_000  # of a band, along time
_PARTS = 100  # in which medians are looked at: a comb is pale, with its mean in it
_FEWEST = 20  # members whose quantiles are drawn: of fewer there is no 5 %
_SCALES = {"light": (0.0, 0.92), "dark": (0.36, 1.0)}  # what of the scale of colours is seen on a page
_TICKS = 8  # of a scale of colours


def bands(members: Collected, *, width: float = WIDTH) -> Figure:
    """Every state on the left, the size of the errors on the right: medians, 50 % and 90 % of the members at each time.

    A size is the largest in a moving window: errors pass zero so often that bands would be a mesh of dips. Of fewer
    than twenty members each has a line of its own in place of quantiles.

    Parameters
    ----------
    members : Collected
    width : float
        Of the page in inches; on a narrow one panels stand one below the other.

    Raises
    ------
    ConfigError
        When no trajectories were kept.
    """
    cast, kept = Cast(members, width), _kept(members)
    looks = list(cast.looks.values())
    step = max(len(kept.time) // POINTS, 1)
    time = kept.time[::step]
    one_truth = bool(np.all(kept.x == kept.x[:1]))
    sound = np.isfinite(kept.xhat).all(axis=(2, 3)).any(axis=0)
    sound = np.asarray(
        sound if sound.any() else ~sound
    )  # limits follow from observers of which some member is not lost
    with styled():
        count, columns = 2 * len(cast.states), cast.columns(2)
        figure, axes = grid(count, columns, cast.width(WIDTH), _ROW * (count // columns) + TOP, share=True)
        for j, (state, left, right) in enumerate(zip(cast.states, axes[::2], axes[1::2], strict=True)):
            truth, xhat = kept.x[:, ::step, j], kept.xhat[:, :, ::step, j].swapaxes(0, 1)
            errors = np.abs(kept.xhat[..., j].swapaxes(0, 1) - kept.x[..., j])
            largest = moving_maximum(errors, round(_WINDOW * len(kept.time)))[..., ::step]
            estimates = banded(left, time, list(xhat), looks, signed=True, beside=[truth])
            sizes = banded(right, time, list(largest), looks, signed=False)
            left.plot(*thinned(Curve(time, truth[0] if one_truth else np.median(truth, axis=0))), **truth_of(one_truth))
            left.set_ylim(state_limits([truth[np.isfinite(truth)]], *_parted(estimates, sound)) or (0, 1))
            measured_in = unit(members.units.get(state, ""))
            left.set_ylabel(f"${both(state)}$" + measured_in)
            right.set_ylabel(f"$|{error_of(state)}|$" + measured_in)
            logarithmic(right, "y")
            right.set_ylim(magnitude_limits(*_parted(sizes, sound)) or (0.1, 1))
            for ax in (left, right):
                _time_axis(ax, members, kept)
        titled = axes[1::2] if cast.narrow else axes[1:2]
        for ax in titled:
            length = f"{_WINDOW * (kept.time[-1] - kept.time[0]):.3g} {time_unit(members.units)}".rstrip()
            ax.set_title(paragraph(f"largest error in a moving window of {length}", figure.get_figwidth() / columns))
        count = len(kept.member)
        title = (
            f"{count} members, and their median" if count < _FEWEST else f"medians, 50 % and 90 % of {count} members"
        )
        title += f" at each time{pooled_over(members, [])}{words_of_lost_along(members, step)}"
        return finished(figure, axes, columns, headed(members, title), grow=True)


def _parted(several: Sequence[Floats], sound: NDArray[np.bool_]) -> tuple[list[Floats], list[Floats]]:
    """The values of observers of which some member is not lost, and of the others."""
    parts = [[values for values, one in zip(several, sound, strict=True) if one == kind] for kind in (True, False)]
    return parts[0], parts[1]


def _kept(members: Collected) -> Trajectories:
    kept = members.trajectories
    if kept is None or not kept.member.size:
        raise ConfigError(
            f"{members.name}: no trajectories were kept of these members; see keep: {{trajectories: ...}}"
        )
    return kept


def truth_of(one: bool) -> dict[str, Any]:
    """How the truth is drawn: that of all members, or else their median."""
    return TRUTH if one else {**TRUTH, "label": "true (median)"}


def _time_axis(ax: Axes, members: Collected, kept: Trajectories) -> None:
    ax.set_xlim(float(kept.time[0]), float(kept.time[-1]))
    ax.set_xlabel("time" + unit(members.units.get("time", "")))


def words_of_lost_along(members: Collected, step: int) -> str:
    """What is said of lost members along time, of which every so many points are drawn."""
    kept = _kept(members)
    sound = np.asarray(np.isfinite(kept.xhat[:, :, ::step]).all(axis=-1))
    groups = [sound[:, i] for i in range(sound.shape[1])]
    return words_of_lost(members.sound[kept.member], groups, along=True, as_lines=len(sound) < _FEWEST)


def banded(
    ax: Axes,
    time: Floats,
    several: Sequence[Floats],
    looks: Sequence[Look],
    *,
    signed: bool,
    beside: Sequence[Floats] = (),
) -> list[Floats]:
    """Draw the median and the bands of members at each time; of fewer than twenty a line each in place of bands.

    A cross is at the time from which on at least half of them are lost.

    Parameters
    ----------
    several : sequence of ndarray, shape (K, Nt)
        The values of each observer.
    looks : sequence of Look
        Of the observers, by whose places crosses of one are told from those of others.
    signed : bool
        Whether values are estimates or errors, and not sizes of errors.
    beside : sequence of ndarray
        What else the panel shows.

    Returns
    -------
    list of ndarray
        For each observer what the limits of an axis follow from.
    """
    found = [spread(values, np.isfinite(values), signed=signed) for values in several]
    largest = largest_of([*found, *beside])
    for order, (values, rows, look) in enumerate(zip(several, found, looks, strict=True)):
        if len(values) < _FEWEST:
            for one in values:
                ax.plot(time, drawable(one), color=look.colour, linewidth=0.6, alpha=0.4, label="_", zorder=2)
        else:
            draw_bands(ax, time, rows, look, largest)
        median = Curve(time, drawn_median(rows))
        mean = mean_of_block(finite(*median), _PARTS)
        if mean is not None:
            ax.plot(*median, color=look.colour, linewidth=0.6, alpha=PALE, label="_", zorder=3)
        ax.plot(*(mean or median), color=look.colour, linestyle=look.dashes, label=look.text, zorder=3)
        draw_crosses(ax, time[first_lost(rows)], look, order)
    return [within_sound(values, rows) for values, rows in zip(several, found, strict=True)]


def family(
    members: Collected, axis: str, *, observers: tuple[str, ...] = (), error: bool = False, page: Page = LIGHT
) -> Figure:
    """The estimates of every member that was kept, in one panel for each state and observer, coloured by an axis.

    Parameters
    ----------
    members : Collected
    axis : str
        What tells the members apart.
    observers : tuple of str
        Which; by default those whose estimates differ from member to member.
    error : bool
        Draw the estimate minus the truth.
    page : Page
        What it is drawn for; on a narrow one panels stand one below the other.

    Raises
    ------
    ConfigError
        When no trajectories were kept.
    """
    cast, kept = Cast(members, page.width), _kept(members)
    shown_ones = observers or _different(members, kept)
    values = members.axes[axis][kept.member]
    with styled():
        each = len(shown_ones)
        columns, count = cast.columns(each), len(cast.states) * each
        figure, axes = grid(count, columns, cast.width(3.0 * each), 2.0 * (count // columns) + TOP, share=True)
        colours = _colours(values, _SCALES[page.style])
        for k, ax in enumerate(axes):
            state, label = cast.states[k // each], shown_ones[k % each]
            i, j = members.observers.index(label), members.states.index(state)
            drawn = _family(ax, kept, i, j, values, colours, error=error)
            truth = kept.x[:, :, j]
            if not error:
                for one in truth[:1] if np.all(truth == truth[:1]) else truth:
                    ax.plot(*thinned(Curve(kept.time, one)), **TRUTH)
            ax.set_ylim(state_limits([] if error else [truth[np.isfinite(truth)]], drawn, []) or (0, 1))
            ax.set_ylabel(f"${error_of(state) if error else both(state)}$" + unit(members.units.get(state, "")))
            if (k < columns or cast.narrow) and len(members.observers) > 1:
                ax.set_title(cast.looks[label].text, loc="center")
            _time_axis(ax, members, kept)
        _level(axes, each)
        _scale(figure, axes, axis_label(axis, members.units), colours, aspect=60 if cast.narrow else 30)
        lost = int(np.sum(~members.sound[kept.member].all(axis=1)))
        title = f"lines end where estimates are lost, in {lost} of {len(kept.member)} members" if lost else ""
        return finished(figure, axes, columns, headed(members, title), grow=True)


def _level(axes: list[Axes], each: int) -> None:
    """One range for the panels of a state."""
    for start in range(0, len(axes), each):
        row = axes[start : start + each]
        ends = [ax.get_ylim() for ax in row]
        for ax in row:
            ax.set_ylim(min(low for low, _ in ends), max(high for _, high in ends))


def _different(members: Collected, kept: Trajectories) -> tuple[str, ...]:
    """Observers whose estimates differ from member to member; all where none does."""
    found = [
        label
        for i, label in enumerate(members.observers)
        if not np.array_equal(kept.xhat[:, i], np.broadcast_to(kept.xhat[:1, i], kept.xhat[:, i].shape), equal_nan=True)
    ]
    return tuple(found or members.observers)


def _family(
    ax: Axes, kept: Trajectories, i: int, j: int, values: Any, colours: dict[Any, Any], *, error: bool
) -> list[Floats]:
    """Draw the members, the roughest at the back; what is drawn."""
    curves = []
    for k, value in enumerate(values.tolist()):
        xhat = kept.xhat[k, i, :, j]
        shown_values = drawable(xhat - kept.x[k, :, j] if error else xhat)
        known = np.isfinite(shown_values)
        curves.append((Curve(kept.time[known], shown_values[known]), colours[value]))
    curves.sort(key=lambda one: -float(np.abs(np.diff(one[0].v)).sum()))
    for curve, colour in curves:
        ax.plot(*thinned(curve, MAX_POINTS // 2), color=colour, linewidth=0.8, label="_", zorder=3, gid=AS_IT_IS)
    return [curve.v for curve, _ in curves]


def _colours(values: Any, part: tuple[float, float]) -> dict[Any, Any]:
    """A colour for each value, from dark to light, on a part of the scale."""
    import matplotlib

    known, scale, (low, high) = levels(values), matplotlib.colormaps["viridis"], part
    return {v: scale(low + (high - low) * i / max(len(known) - 1, 1)) for i, v in enumerate(known)}


def _scale(figure: Figure, axes: list[Axes], label: str, colours: dict[Any, Any], *, aspect: float) -> None:
    """What the colours mean, on a bar that is so many times as high as wide."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap

    known = list(colours)
    norm = BoundaryNorm(np.arange(len(known) + 1) - 0.5, len(known))
    scale = ScalarMappable(norm, ListedColormap(list(colours.values())))
    every = -(-len(known) // _TICKS)
    bar = figure.colorbar(scale, ax=axes, pad=0.02, aspect=aspect, ticks=range(0, len(known), every))
    bar.ax.set_yticklabels([shown(v) for v in known[::every]])
    bar.ax.tick_params(which="both", length=0)
    bar.ax.minorticks_off()
    bar.set_label(label)
