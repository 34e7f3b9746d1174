"""Colours, line styles and markers of a figure's observers.

An observer has the look of its family in every figure of every file; only where two that look alike meet in one figure
does the second one take another. One that a figure shows of several runs has one colour in all of them, and the line
styles are those of the runs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol
from zlib import crc32

from hgorun.figures.style import DASHES, MARKERS, PALETTE, luminance

BLUE, ORANGE, GREEN, VERMILLION, SKY, PINK, OLIVE, VIOLET, BRICK, WINE = PALETTE
SOLID, LONG, DASH_DOT, DENSE, DASH_DOT_DOT = range(len(DASHES))
_STANDARD = ORANGE
# For a second observer of a family: colours that are rare in publications first.
_SPARE = (PINK, OLIVE, SKY, WINE, GREEN, BRICK, VIOLET, VERMILLION, BLUE, ORANGE)
# Families that are compared with each other differ in colour and nearly all in luminance. The standard
# observer, which is the noisy one of most comparisons, is light, and none is dark: the truth shows on them. No two
# families have both colour and line style in common.
_FAMILIES: Mapping[str, tuple[str, int]] = {
    "shgo": (_STANDARD, SOLID),
    "shgo_riccati": (_STANDARD, LONG),
    "updated": (_STANDARD, DASH_DOT),
    "dead_zone": (_STANDARD, DENSE),
    "stubborn": (_STANDARD, DASH_DOT_DOT),
    "fhgo1": (BLUE, LONG),
    "reduced_sampled": (BLUE, SOLID),
    "extended": (BLUE, DASH_DOT),
    "nested": (BLUE, DENSE),
    "treangle": (PINK, SOLID),
    "luenberger_exact": (PINK, LONG),
    "predictor_chain": (PINK, DASH_DOT),
    "low_power": (SKY, SOLID),
    "levant": (SKY, LONG),
    "savgol": (SKY, DASH_DOT),
    "spline": (SKY, DENSE),
    "integral": (VERMILLION, SOLID),
    "hgo_fd": (VERMILLION, DASH_DOT),
    "dynamic_gain": (VERMILLION, LONG),
    "deadbeat": (VERMILLION, DENSE),
    "hgo_sa": (VIOLET, SOLID),
    "direct_dynamic": (VIOLET, DASH_DOT),
    "ekf": (VIOLET, DENSE),
    "direct": (GREEN, LONG),
    "kalman_bucy": (WINE, SOLID),
    "hg_ekf": (GREEN, DASH_DOT),
    "kinetic_rate": (GREEN, DASH_DOT_DOT),
    "homogeneous": (OLIVE, LONG),
    "prescribed_time": (OLIVE, DASH_DOT),
    "cascade": (OLIVE, DENSE),
    "ukf": (WINE, LONG),
    "aekf": (WINE, DASH_DOT),
    "impulsive": (BRICK, LONG),
    "impulsive_riccati": (BRICK, SOLID),
    "piecewise": (BRICK, DENSE),
    "switched": (OLIVE, SOLID),
    "red": (PINK, DENSE),
    "hybrid_red": (WINE, DENSE),
    "filtering": (VERMILLION, DASH_DOT_DOT),
    "neso": (PINK, DASH_DOT_DOT),
    "eso": (SKY, DASH_DOT_DOT),
}
# By filter order; without a filter these are the standard observer.
_FILTERED: Mapping[str, tuple[tuple[str, int], ...]] = {
    "fhgo2": ((_STANDARD, SOLID), (BRICK, DASH_DOT), (GREEN, SOLID), (VIOLET, LONG)),
    "fhgo2_nuos": ((_STANDARD, SOLID), (BRICK, DASH_DOT_DOT), (GREEN, DENSE), (VIOLET, DASH_DOT_DOT)),
    "lowpass": ((_STANDARD, SOLID), (OLIVE, DASH_DOT_DOT), (BLUE, DASH_DOT_DOT), (WINE, DASH_DOT_DOT)),
}


class HasFamily(Protocol):
    """What the choice of a look needs to know of an observer; see :class:`hgorun.figures.actors.Actor`."""

    @property
    def order(self) -> int: ...
    @property
    def run(self) -> str: ...
    @property
    def label(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def filter_order(self) -> int | None: ...


@dataclass(frozen=True)
class Look:
    """How one observer appears.

    Attributes
    ----------
    text : str
        In the legend.
    colour : str
    dashes : linestyle
    marker : str
        Of its points, where it has points.
    """

    text: str
    colour: str
    dashes: Any
    marker: str


def family_colour(type_: str, filter_order: int | None) -> str:
    """The colour of a family of observers in all figures."""
    return _family(type_, filter_order)[0]


def _family(type_: str, filter_order: int | None) -> tuple[str, int]:
    """Colour and line style of a family; of one that we do not know they follow from its name."""
    if type_ in _FILTERED:
        known = _FILTERED[type_]
        if (filter_order or 0) < len(known):
            return known[filter_order or 0]
    elif type_ in _FAMILIES:
        return _FAMILIES[type_]
    number = crc32(f"{type_} {filter_order or ''}".encode())
    return _SPARE[number % len(_SPARE)], 1 + number // len(_SPARE) % (len(DASHES) - 1)


def _marker(type_: str, filter_order: int | None) -> int:
    """The place of a family's marker, which follows from its colour and line style."""
    colour, dashes = _family(type_, filter_order)
    return (PALETTE.index(colour) + 3 * dashes) % len(MARKERS)


def looks(panels: Sequence[Sequence[HasFamily]], texts: Mapping[int, str]) -> dict[int, Look]:
    """The looks of all observers of a figure, by their places.

    Parameters
    ----------
    panels : sequence of sequence of observers
        Those that share a set of axes.
    texts : mapping of int to str
        Their texts in the legend.

    Returns
    -------
    dict of int to Look
        In a panel, colours differ for up to ten observers, line styles for up to five, and looks for up to
        fifty. In the figure, so far as the styles suffice, equal looks have equal texts. An observer of up to five
        runs has one colour, and these runs, if texts tell them apart, have one line style each.
    """
    firsts = _firsts(panels, texts)
    colours = _colours(panels, texts, firsts)
    styles = _dashes(panels, colours, texts, firsts)
    markers = _markers(panels)
    return {
        order: Look(texts[order], colours[order], DASHES[style], MARKERS[markers[order]])
        for order, style in styles.items()
    }


def _actors(panels: Sequence[Sequence[HasFamily]]) -> dict[int, HasFamily]:
    return {a.order: a for panel in panels for a in panel}


def _colours(
    panels: Sequence[Sequence[HasFamily]], texts: Mapping[int, str], firsts: Mapping[int, int]
) -> dict[int, str]:
    actors = _actors(panels)
    families = {a.order: (a.type, a.filter_order) for a in actors.values()}
    used = {family_colour(*family) for family in families.values()}
    said: dict[int, set[str]] = {}
    for order, first in firsts.items():
        said.setdefault(first, set()).add(texts[order])
    chosen: dict[int, str] = {}
    for order, beside in _neighbours([[actors[firsts[a.order]] for a in panel] for panel in panels]).items():
        taken = [chosen[other] for other in beside if other in chosen]
        twins = [chosen[o] for o in chosen if said[o] & said[order] and families[o][0] == families[order][0]]
        wanted = [colour for colour in (*twins, family_colour(*families[order])) if colour not in taken]
        chosen[order] = wanted[0] if wanted else _first_free(used, taken)
        used.add(chosen[order])
    return {order: chosen[first] for order, first in firsts.items()}


def _firsts(panels: Sequence[Sequence[HasFamily]], texts: Mapping[int, str]) -> dict[int, int]:
    """Where every observer stands first: its own place, or that in an earlier run.

    Of more runs in one panel than there are line styles, and with one text for two of them in the figure, whose legend
    has it once, each has its own.
    """
    alike: dict[tuple[str, str, int | None], list[int]] = {}
    for order, actor in sorted(_actors(panels).items()):
        alike.setdefault((actor.label, actor.type, actor.filter_order), []).append(order)
    one_colour = {
        orders[0]: len({texts[order] for order in orders}) == len(orders)
        and all(sum(a.order in orders for a in panel) <= len(DASHES) for panel in panels)
        for orders in alike.values()
    }
    return {order: orders[0] if one_colour[orders[0]] else order for orders in alike.values() for order in orders}


def _styles_of_runs(actors: Mapping[int, HasFamily], firsts: Mapping[int, int]) -> dict[str, int]:
    """The line styles of runs that show one observer; none of too many runs."""
    count = Counter(firsts.values())
    several = [order for order, first in sorted(firsts.items()) if count[first] > 1]
    runs = list(dict.fromkeys(actors[o].run for o in several))
    return {run: style for style, run in enumerate(runs)} if len(runs) <= len(DASHES) else {}


def _first_free(used: set[str], beside: Sequence[str]) -> str:
    """A colour that the figure does not have, or else the one rarest among those beside."""
    free = [colour for colour in _SPARE if colour not in used]
    return free[0] if free else min(_SPARE, key=beside.count)


def _dashes(
    panels: Sequence[Sequence[HasFamily]],
    colours: Mapping[int, str],
    texts: Mapping[int, str],
    firsts: Mapping[int, int],
) -> dict[int, int]:
    """Line styles: the run's or the family's own, unless one of the same colour has it that is to be told from it.

    Those without the colour of their family take one that is rare beside them.
    """
    actors = _actors(panels)
    runs = _styles_of_runs(actors, firsts)
    chosen: dict[int, int] = {}
    for order, beside in _neighbours(panels).items():
        colour, own = _family(actors[order].type, actors[order].filter_order)
        own = runs.get(actors[order].run, own)
        at_home = colours[order] == colour or actors[order].run in runs
        alike = [o for o in chosen if colours[o] == colours[order]]
        twins = {chosen[o] for o in alike if texts[o] == texts[order]}
        confused = {chosen[o] for o in alike if texts[o] != texts[order] or o in beside}
        holders = [[o for o in beside if chosen.get(o) == style] for style in range(len(DASHES))]
        gaps = [min((_gap(colours[order], colours[o]) for o in group), default=1.0) for group in holders]
        reluctance = [
            (s in confused, at_home and s != own, len(holders[s]), s not in twins, -gaps[s]) for s in range(len(DASHES))
        ]
        chosen[order] = reluctance.index(min(reluctance))
    return chosen


def _markers(panels: Sequence[Sequence[HasFamily]]) -> dict[int, int]:
    """Places of markers: the family's own, or the next one that no other of the family has beside it."""
    families = {order: (a.type, a.filter_order) for order, a in _actors(panels).items()}
    chosen: dict[int, int] = {}
    for order, beside in _neighbours(panels).items():
        own = _marker(*families[order])
        taken = [chosen[o] for o in beside if o in chosen and families[o] == families[order]]
        chosen[order] = min(range(len(MARKERS)), key=lambda m: (taken.count(m), (m - own) % len(MARKERS)))
    return chosen


def _gap(a: str, b: str) -> float:
    """How far two colours lie apart in greyscale."""
    shades = [[int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] for colour in (a, b)]
    return abs(luminance(*shades[0]) - luminance(*shades[1]))


def _neighbours(panels: Sequence[Sequence[HasFamily]]) -> dict[int, set[int]]:
    """Who shares a panel with whom, in the order of their places."""
    found: dict[int, set[int]] = {}
    for panel in panels:
        orders = {a.order for a in panel}
        for order in orders:
            found.setdefault(order, set()).update(orders - {order})
    return dict(sorted(found.items()))
