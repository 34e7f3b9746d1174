"""What figures of ensembles have in common: whose lines they are, what axes are called, in which order they go."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats, levels
from hgorun.ensemble.statistics.never import never
from hgorun.ensemble.statistics.unmoved import said_of_hf
from hgorun.figures.actors import Actor, texts
from hgorun.figures.looks import Look, looks
from hgorun.figures.page import NARROW, TWO
from hgorun.figures.scaling import measured_on, quantities
from hgorun.figures.style import LARGEST_NUMBER
from hgorun.result.metrics.base import unit_of
from hgorun.tables.axis_names import output_of, unit_of_axis
from hgorun.tables.typeset import TIMES, symbol, unit, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, PANEL_WIDTH = TWO, 2.4  # inches: of a figure, and of a panel at least
MOST_STATES = 6  # side by side
_BINS = 16  # of an axis with more values than can be told apart
_ROUNDINGS = 1e-9  # of numbers: what differs by less is drawn as equal
_SHORT = 24  # characters of a label beside which there is room in its line
_LOGARITHMIC = 5.0  # an axis whose values span more is logarithmic


@dataclass(frozen=True, eq=False)
class Cast:
    """The observers of an ensemble as figures show them.

    Attributes
    ----------
    members : Collected
    page : float
        Width of the page in inches; on a narrow one panels stand one below the other.
    """

    members: Collected
    page: float = WIDTH

    @cached_property
    def looks(self) -> dict[str, Look]:
        """The look of each observer, by its label."""
        members = self.members
        actors = [
            Actor(i, members.name, label, *members.families.get(label, ("", None)))
            for i, label in enumerate(members.observers)
        ]
        found = looks([actors], texts(actors, {}))
        return {actor.label: found[actor.order] for actor in actors}

    @property
    def states(self) -> tuple[str, ...]:
        """Those that a figure has room for."""
        return self.members.states[:MOST_STATES]

    def column(self, metric: str, label: str, state: str) -> tuple[Floats, NDArray[np.bool_]]:
        """A metric of an observer for every member, and whether it can be used: a time that never comes cannot."""
        i, j = self.members.observers.index(label), self.members.states.index(state)
        return self.members.metrics[metric][:, i, j], self.members.sound[:, i] & ~never(self.members, metric)[:, i, j]

    def quantity(self, metric: str, state: str) -> str:
        """What a metric of a state's error is called on an axis, with its unit."""
        return quantity_label(metric, state, self.members.units)

    @property
    def narrow(self) -> bool:
        """Whether panels stand one below the other."""
        return self.page < NARROW

    def columns(self, most: int) -> int:
        """How many panels stand side by side, of so many that belong together."""
        return 1 if self.narrow else most

    def width(self, least: float) -> float:
        """Of a figure in inches; what stands side by side needs at least so much."""
        return self.page if self.narrow else max(self.page, least)

    @property
    def width_of_states(self) -> float:
        """Of a figure with a column for every state."""
        return self.width(PANEL_WIDTH * len(self.states))


def quantity_label(metric: str, state: str, units: Mapping[str, str]) -> str:
    """What a metric of a state's error is called on an axis, with its unit.

    Parameters
    ----------
    units : mapping of str to str
        Of the states, and of ``time``.
    """
    named = quantities().get(metric, f"{words(metric)} of ${{}}$")
    return named.format(measured_on(metric, state)) + unit(unit_of(metric, state, units))


def axis_label(axis: str, units: Mapping[str, str] = MappingProxyType({})) -> str:
    r"""An axis of an ensemble as mathematics: the last part of its path, and whose it is, with its unit.

    Parameters
    ----------
    axis : str
    units : mapping of str to str
        Of ``time``, and of axes that are no times.

    Examples
    --------
    >>> axis_label("observers.FHGO.theta"), axis_label("measurement.sampling.period", {"time": "h"})
    ('$\\theta$ of FHGO', 'period [h]')
    >>> axis_label("measurement.outputs.phi.noise.0.std", {"measurement.outputs.phi.noise.0.std": "rad"})
    'std of noise of $\\phi$ [rad]'
    """
    return _named(axis) + unit(unit_of_axis(axis, units))


def _named(axis: str) -> str:
    parts = axis.split(".")
    name, output = parts[-1], output_of(axis)
    whose = f" of ${symbol(output)}$" if output else ""
    if name in TIMES:
        return name + whose
    if name == axis and len(name) > 2:
        return words(name)
    shown = f"${symbol(name)}$" if name.isascii() and name.replace("_", "").isalnum() else words(name)
    if parts[0] == "observers" and len(parts) > 2 and parts[1] != "*":
        return f"{shown} of {words(parts[1])}"
    if parts[0] == "measurement" and "noise" in parts:
        return f"{shown if name.isascii() and len(name) < 2 else words(name)} of noise{whose}"
    return f"{words(name)}{whose}" if whose else shown


def headed(members: Collected, text: str, metrics: Collection[str] = ()) -> str:
    """The title of a figure: whose members it shows, and what is said of them and of the metrics that are drawn."""
    said = "; ".join(filter(None, (text, said_of_hf(members, metrics))))
    return ": ".join(part for part in (members.title or members.name, said) if part)


def pooled_over(members: Collected, drawn: Sequence[str]) -> str:
    """What is said of axes that were chosen, and that a figure shows together; nothing where there are none.

    Parameters
    ----------
    drawn : sequence of str
        Axes that the figure tells apart.
    """
    names = [axis_label(axis, members.units) for axis in members.grid if axis not in drawn]
    return f", over all values of {', '.join(names)}" if names else ""


def places(values: NDArray[Any]) -> tuple[Floats, NDArray[np.int64]]:
    """Where the members stand on an axis, and which of those places is whose.

    Numbers stand at their values, or, where there are too many, in bins with equally many members at their median;
    texts stand side by side.
    """
    known = levels(values)
    if values.dtype.kind not in "iuf":
        return np.arange(len(known), dtype=float), np.array([known.index(v) for v in values.tolist()], dtype=np.int64)
    if len(known) <= 4 * _BINS:
        return np.array(known, dtype=float), np.searchsorted(np.array(known), values)
    edges = np.quantile(values, np.linspace(0, 1, _BINS + 1)[1:-1])
    # where many members have one value, some bins are empty
    bins, whose = np.unique(np.searchsorted(edges, values, side="right"), return_inverse=True)
    return np.array([float(np.median(values[whose == k])) for k in range(bins.size)]), whose


def spans_much(values: Sequence[float] | Floats) -> bool:
    """Whether numbers are positive and span much, so that a logarithmic axis shows them best."""
    found = np.asarray(values, dtype=float)
    found = found[np.isfinite(found) & (np.abs(found) <= LARGEST_NUMBER)]
    return bool(found.size and found.min() > 0 and found.max() > _LOGARITHMIC * found.min())


def scale_axis(ax: Axes, which: str, values: Sequence[float] | Floats) -> bool:
    """A logarithmic axis where numbers are positive and span much, and whether it is one; see :func:`logarithmic`."""
    if found := spans_much(values):
        logarithmic(ax, which)
    return found


def logarithmic(ax: Axes, which: str) -> None:
    """A logarithmic axis, whose label says so: beside linear ones it would be read as these.

    It has its label already.
    """
    if which == "x":
        ax.set_xscale("log")
        ax.set_xlabel(said_logarithmic(ax.get_xlabel(), _SHORT))
    else:
        ax.set_yscale("log")
        ax.set_ylabel(said_logarithmic(ax.get_ylabel()))


def said_logarithmic(label: str, short: int = 0) -> str:
    """The label of an axis, or of a scale of colours, that is logarithmic: in one line where it is so short."""
    between = " " if len(label) < short else "\n"
    return f"{label}{between}(log scale)"


def limits(low: float, high: float, *, logarithmic: bool, margin: float = 0.06) -> tuple[float, float]:
    """A range with some room at both ends."""
    if logarithmic:
        ratio = (high / low) ** margin if high > low else 1.5
        return low / ratio, high * ratio
    wide = high - low > _ROUNDINGS * max(abs(low), abs(high))
    room = margin * (high - low) if wide else 0.1 * abs(high) or 0.1
    return low - room, high + room


def drawable(values: Floats) -> Floats:
    """What axes can show; NaN for the rest."""
    return np.where(np.abs(values) <= LARGEST_NUMBER, values, math.nan)
