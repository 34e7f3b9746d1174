"""One observer in several runs: one colour, and the runs by line style."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from hgorun.figures.actors import Actor, texts
from hgorun.figures.layout import finished, grid
from hgorun.figures.looks import Look, looks

RUNS = ("early", "late", "third", "fourth", "fifth", "sixth")
FAMILIES: dict[str, tuple[str, int | None]] = {"fast": ("shgo", None), "slow": ("shgo", None), "filter": ("ekf", None)}


def cast(runs: Sequence[str], labels: Sequence[str] = tuple(FAMILIES)) -> list[Actor]:
    places = [(run, label) for run in runs for label in labels]
    return [Actor(i, run, label, *FAMILIES[label]) for i, (run, label) in enumerate(places)]


def apart(actors: Sequence[Actor]) -> list[list[Actor]]:
    """A panel for each run."""
    return [[a for a in actors if a.run == run] for run in dict.fromkeys(a.run for a in actors)]


def found(panels: Sequence[Sequence[Actor]], labels: dict[str, str] | None = None) -> dict[tuple[str, str], Look]:
    actors = {a.order: a for panel in panels for a in panel}
    own = looks(panels, texts(list(actors.values()), labels or {}))
    return {(a.run, a.label): own[i] for i, a in actors.items()}


def test_an_observer_has_one_colour_and_a_run_one_line_style() -> None:
    for panels in ([cast(RUNS[:2])], apart(cast(RUNS[:2])), [cast(RUNS[:5])]):
        look = found(panels)
        for label in FAMILIES:
            assert len({own.colour for (_, name), own in look.items() if name == label}) == 1
        for run in {run for run, _ in look}:
            assert len({str(own.dashes) for (name, _), own in look.items() if name == run}) == 1
        assert len({(own.colour, str(own.dashes)) for own in look.values()}) == len(look)
        assert {own.colour for own in look.values()} == {look["early", label].colour for label in FAMILIES}
        assert look["early", "fast"].dashes == "solid"


def test_one_that_a_single_run_shows_has_the_style_of_its_run() -> None:
    look = found([[*cast(RUNS[:2], ["fast"]), Actor(2, "late", "filter", "ekf", None)]])
    assert look["late", "filter"].dashes == look["late", "fast"].dashes != look["early", "fast"].dashes
    assert look["late", "filter"].colour != look["late", "fast"].colour


def test_more_runs_than_line_styles_differ_in_colour() -> None:
    look = found([cast(RUNS, ["fast"])])
    assert len({own.colour for own in look.values()}) == 6


def test_one_text_in_separate_panels_is_one_look() -> None:
    (first, second) = found(apart(cast(RUNS[:2], ["filter"])), {"filter": "EKF"}).values()
    assert (first.colour, first.dashes) == (second.colour, second.dashes)
    alone = found([cast(RUNS[:1], ["filter"])])
    assert first.dashes == alone["early", "filter"].dashes  # its family's


def test_another_family_under_the_same_label_keeps_its_own_colour() -> None:
    look = found([[Actor(0, "a", "mine", "shgo", None), Actor(1, "b", "mine", "fhgo1", 1)]])
    assert look["a", "mine"].colour != look["b", "mine"].colour


def test_one_text_twice_in_a_panel_is_two_colours() -> None:
    # the legend has a line for each colour of a text
    (first, second) = found([cast(RUNS[:2], ["fast"])], {"fast": "standard"}).values()
    assert first.colour != second.colour


@pytest.mark.costly
@pytest.mark.parametrize("count", [7, 8, 9, 11])
def test_no_entry_stands_alone_below_a_row_of_others(count: int) -> None:
    figure, (ax,) = grid(1, 1, 6.0, 3.0, share=False)
    for i in range(count):
        ax.plot([0, 1], [0, i], label=f"observer {i}")
    finished(figure, [ax], 1, None, grow=True)
    heights = [round(text.get_window_extent().y0) for text in figure.legends[0].get_texts()]
    rows = [heights.count(y) for y in sorted(set(heights), reverse=True)]
    assert sum(rows) == count
    assert len(rows) > 1
    assert min(rows) >= max(rows) - len(rows) + 1
    assert min(rows) > 1


def test_one_text_of_several_runs_is_one_look_beside_another_of_the_same_observer() -> None:
    """As with and without noise, for two periods in two panels: the legend has two entries for four runs."""
    quiet, noisy, other_quiet, other_noisy = cast(RUNS[:4], ["fast"])
    labels = {f"{run}/fast": ("z", "zn")[i % 2] for i, run in enumerate(RUNS[:4])}
    look = found([[quiet, noisy], [other_quiet, other_noisy]], labels)
    assert look["early", "fast"] == look["third", "fast"]
    assert look["late", "fast"] == look["fourth", "fast"]
    assert look["early", "fast"].colour != look["late", "fast"].colour
