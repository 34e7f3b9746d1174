"""Colours, line styles and markers of a figure's observers.

An observer has the colour of its family in every figure of every file; only where two of one family meet
in one set of axes does the second one take another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from hgorun.figures.style import DASHES, MARKERS, PALETTE

BLUE, ORANGE, GREEN, VERMILLION, SKY, PINK, OLIVE, VIOLET, BRICK, WINE = PALETTE
_STANDARD = ORANGE
# For observers without a colour of their own and for a second one of a family: those rare in publications first.
_SPARE = (PINK, OLIVE, SKY, WINE, GREEN, BRICK, VIOLET, VERMILLION, BLUE, ORANGE)
# Families that are compared with each other differ in colour and nearly all in luminance. The standard
# observer, which is the noisy one of most comparisons, is light, and none is dark: the truth shows on them.
_FAMILIES = {
    "shgo": _STANDARD,
    "shgo_riccati": _STANDARD,
    "fhgo1": BLUE,
    "treangle": PINK,
    "low_power": SKY,
    "integral": VERMILLION,
    "hgo_fd": VERMILLION,
    "hgo_sa": VIOLET,
    "direct": GREEN,
    "dynamic_gain": VERMILLION,
    "direct_dynamic": VIOLET,
    "levant": SKY,
    "reduced_sampled": BLUE,
    "deadbeat": VERMILLION,
}
# By filter order; without a filter these are the standard observer.
_FILTERED = {
    "fhgo2": (_STANDARD, BRICK, GREEN, VIOLET),
    "fhgo2_nuos": (_STANDARD, BRICK, GREEN, VIOLET),
    "lowpass": (_STANDARD, OLIVE, BLUE, WINE),
}


class HasFamily(Protocol):
    """What the choice of a look needs to know of an observer; see :class:`hgorun.figures.actors.Actor`."""

    @property
    def order(self) -> int: ...
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


def family_colour(type_: str, filter_order: int | None) -> str | None:
    """The colour of a family of observers in all figures; None for families that we do not know."""
    if type_ in _FILTERED:
        known = _FILTERED[type_]
        return known[filter_order or 0] if (filter_order or 0) < len(known) else None
    return _FAMILIES.get(type_)


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
        fifty. In the figure, so far as the styles suffice, equal looks have equal texts.
    """
    colours = _colours(panels, texts)
    styles = _dashes(panels, colours, texts)
    return {
        order: Look(texts[order], colours[order], DASHES[style], MARKERS[i % len(MARKERS)])
        for i, (order, style) in enumerate(styles.items())
    }


def _colours(panels: Sequence[Sequence[HasFamily]], texts: Mapping[int, str]) -> dict[int, str]:
    actors = {a.order: a for panel in panels for a in panel}
    families = {(a.type, a.filter_order): family_colour(a.type, a.filter_order) for _, a in sorted(actors.items())}
    used = {colour for colour in families.values() if colour}
    for key, colour in families.items():
        if colour is None:
            families[key] = _first_free(used, ())
            used.add(str(families[key]))
    chosen: dict[int, str] = {}
    for order, beside in _neighbours(panels).items():
        taken = [chosen[other] for other in beside if other in chosen]
        family = (actors[order].type, actors[order].filter_order)
        twins = [chosen[o] for o in chosen if texts[o] == texts[order] and actors[o].type == family[0]]
        wanted = [colour for colour in (*twins, str(families[family])) if colour not in taken]
        chosen[order] = wanted[0] if wanted else _first_free(used, taken)
        used.add(chosen[order])
    return chosen


def _first_free(used: set[str], beside: Sequence[str]) -> str:
    """A colour that the figure does not have, or else the one rarest among those beside."""
    free = [colour for colour in _SPARE if colour not in used]
    return free[0] if free else min(_SPARE, key=beside.count)


def _dashes(
    panels: Sequence[Sequence[HasFamily]], colours: Mapping[int, str], texts: Mapping[int, str]
) -> dict[int, int]:
    """Line styles: different for observers that share a panel, solid as often as that allows."""
    chosen: dict[int, int] = {}
    for order, beside in _neighbours(panels).items():
        alike = [o for o in chosen if colours[o] == colours[order]]
        twins = {chosen[o] for o in alike if texts[o] == texts[order]}
        confused = {chosen[o] for o in alike if texts[o] != texts[order] or o in beside}
        holders = [[o for o in beside if chosen.get(o) == style] for style in range(len(DASHES))]
        gaps = [min((_gap(colours[order], colours[o]) for o in group), default=1.0) for group in holders]
        reluctance = [(s in confused, len(holders[s]), s not in twins, -gaps[s]) for s in range(len(DASHES))]
        chosen[order] = reluctance.index(min(reluctance))
    return chosen


def _gap(a: str, b: str) -> float:
    """How far two colours lie apart in greyscale."""
    shades = [[int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] for colour in (a, b)]
    greys = [0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2 for red, green, blue in shades]
    return float(abs(greys[0] - greys[1]))


def _neighbours(panels: Sequence[Sequence[HasFamily]]) -> dict[int, set[int]]:
    """Who shares a panel with whom, in the order of their places."""
    found: dict[int, set[int]] = {}
    for panel in panels:
        orders = {a.order for a in panel}
        for order in orders:
            found.setdefault(order, set()).update(orders - {order})
    return dict(sorted(found.items()))
