"""Observers can be told apart: colours, line styles and markers."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from hgorun.figures.actors import Actor
from hgorun.figures.looks import _FAMILIES, Look, family_colour, looks
from hgorun.figures.style import DASHES, PALETTE, TRUTH
from hgorun.observers.base import OBSERVERS


def luminance(shade: str) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(shade)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def lightness(shade: str) -> float:
    """L* of CIELAB, 0 to 100; a step of 2.3 is just seen."""
    return float(116 * np.cbrt(max(luminance(shade), 0.009)) - 16)


def actors(*families: tuple[str, int | None]) -> list[Actor]:
    return [Actor(i, "run", f"{i}", kind, r) for i, (kind, r) in enumerate(families)]


def looks_of(*panels: list[Actor]) -> dict[int, Look]:
    return looks(panels, {a.order: a.label for panel in panels for a in panel})


FAMILIES: list[tuple[str, int | None]] = [
    ("shgo", None),
    ("fhgo1", 3),
    ("fhgo2", 1),
    ("fhgo2", 2),
    ("fhgo2_nuos", 2),
    ("lowpass", 1),
    ("mine", None),
]


def test_observers_differ_in_greyscale() -> None:
    """By line style or by luminance, in one panel of up to seven; all are dark enough for white paper."""
    for families in (FAMILIES, [("shgo", None)] * 7, [("mine", None)] * 7):
        for a, b in combinations(looks_of(actors(*families)).values(), 2):
            assert a.dashes != b.dashes or abs(luminance(a.colour) - luminance(b.colour)) > 0.1
    for shade in PALETTE:
        assert 1.05 / (luminance(shade) + 0.05) > 2.1
    assert TRUTH["linestyle"] not in DASHES


@pytest.mark.costly
@given(st.lists(st.lists(st.sampled_from(FAMILIES), max_size=12), min_size=1, max_size=4), st.randoms())
def test_looks_in_a_panel_are_different(panels: list[list[tuple[str, int | None]]], random: Any) -> None:
    everybody = actors(*(family for panel in panels for family in panel))
    shown = [random.sample(everybody, min(len(everybody), len(panel))) for panel in panels]
    found = looks_of(*shown)
    for panel in shown:
        own = [found[a.order] for a in panel]
        assert len({(look.colour, look.dashes) for look in own}) == len(own) or len(found) > len(PALETTE)
        if len(panel) <= len(PALETTE) and len(found) <= len(PALETTE):
            assert len({look.colour for look in own}) == len(own)


def test_35_observers_side_by_side_look_different() -> None:
    for families in ([("shgo", None)] * 35, FAMILIES * 5):
        found = looks_of(actors(*families))
        assert len({(look.colour, look.dashes) for look in found.values()}) == 35


def test_a_family_has_its_colour_in_every_figure() -> None:
    """Whoever else is shown, unless two of it meet in one panel; then the first keeps it."""
    assert family_colour("shgo", None) == family_colour("shgo_riccati", None) == family_colour("fhgo2", 0)
    assert family_colour("fhgo2", 2) == family_colour("fhgo2_nuos", 2)
    assert len({family_colour("fhgo2", r) for r in range(4)}) == 4
    assert family_colour("fhgo2", 9) in PALETTE
    for order in (FAMILIES, FAMILIES[::-1]):
        alone = [a for a in actors(*order) if (a.type, a.filter_order) != ("fhgo2_nuos", 2)]
        for actor in alone:
            assert looks_of(alone)[actor.order].colour == family_colour(actor.type, actor.filter_order)
    two = actors(("shgo", None), ("fhgo1", 3), ("shgo_riccati", None))
    meeting, apart = looks_of(two), looks_of(two[:2], two[2:])
    assert meeting[0].colour == apart[0].colour == apart[2].colour == family_colour("shgo", None)
    assert meeting[2].colour not in (meeting[0].colour, meeting[1].colour)
    assert apart[0].dashes != apart[2].dashes  # their texts differ, and the legend is one


def look_alone(kind: str, r: int | None) -> tuple[str, Any, str]:
    """Colour, line style and marker of an observer that is alone in its figure."""
    own = looks_of(actors((kind, r)))[0]
    return own.colour, own.dashes, own.marker


def test_two_figures_agree_on_every_observer() -> None:
    """Whoever stands beside it: colour, line style and marker are those that it has alone."""
    beside = [("shgo", None), ("fhgo1", 3), ("fhgo2", 1), ("fhgo2", 2), ("levant", None), ("kalman_bucy", None)]
    for order in (beside, beside[::-1]):
        found = looks_of(actors(*order))
        for actor in actors(*order):
            own = found[actor.order]
            assert (own.colour, own.dashes, own.marker) == look_alone(actor.type, actor.filter_order)


def test_no_two_families_look_alike() -> None:
    filtered = ("fhgo2", "fhgo2_nuos", "lowpass")
    kinds = [*((kind, None) for kind in OBSERVERS.load()), *((kind, r) for kind in filtered for r in (1, 2, 3))]
    known = [look_alone(*family)[:2] for family in kinds if family[0] in _FAMILIES or family[1]]
    assert len({(colour, str(dashes)) for colour, dashes in known}) == len(known)


def test_families_that_are_compared_differ() -> None:
    """In colour, and of the many in the thesis also in luminance."""
    for group in (
        [("shgo", None), ("fhgo2", 1), ("fhgo2", 2), ("fhgo2", 3)],
        [("shgo", None), ("direct", None), ("dynamic_gain", None), ("direct_dynamic", None), ("levant", None)],
        [("hgo_fd", None), ("hgo_sa", None)],
        [("reduced_sampled", None), ("deadbeat", None)],
        [
            ("shgo", None),
            ("treangle", None),
            ("low_power", None),
            *((t, r) for t in ("lowpass", "fhgo2") for r in (1, 2, 3)),
        ],
    ):
        colours = [family_colour(*family) for family in group]
        assert len(set(colours)) == len(group)
    thesis = [str(family_colour(*family)) for family in [("shgo", None), ("fhgo2", 1), ("fhgo2", 2), ("fhgo2", 3)]]
    assert min(abs(lightness(a) - lightness(b)) for a, b in combinations([*thesis, "black"], 2)) > 9
