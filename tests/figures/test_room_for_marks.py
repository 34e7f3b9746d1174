"""Marks at the edge of a panel: none is missing, and in a figure of bounds none lies on a curve."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from examples import chain, simulated
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from hgorun import Result
from hgorun.figures.cut_marks import mark_cuts
from hgorun.figures.page import Page
from hgorun.figures.peaking import peaking
from hgorun.figures.style import PALETTE
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.theory import Transient

STARTS = {"A": 3.4, "B": 12.9, "C": 48.2, "D": 187.0, "E": 374.0}


@pytest.fixture(scope="module")
def result() -> Result:
    found = simulated(chain(2, "-x1"), {"A": {"type": "shgo", "theta": 2}}, end=5)
    one = ObserverResult(type="shgo", xhat=found.x, internal={}, gains={}, dimension=2)
    return replace(found, observers=dict.fromkeys(STARTS, one))


def values(ax: Any) -> list[Annotation]:
    return [child for child in ax.get_children() if isinstance(child, Annotation) and child.get_text() not in "↑↓"]


@pytest.mark.parametrize("width", ["one", "two"])
def test_the_decay_that_leaves_a_panel_is_marked_above_all_errors(result: Result, width: str) -> None:
    time = result.time[:, None]
    one = Transient(("x1",), result.time, np.exp(-time), 0 * time, 0 * time, False)
    transients = {label: replace(one, nominal=start * np.exp(-0.01 * time)) for label, start in STARTS.items()}
    (ax,) = peaking(result, transients, Page.named(width, "light")).axes
    high = ax.get_ylim()[1]
    beyond = [f"{start:.3g}" for start in STARTS.values() if start > 1.1 * high]
    found = values(ax)
    assert len(beyond) > 2
    assert sorted(text.get_text() for text in found) == sorted(beyond)
    boxes = [text.get_window_extent() for text in found]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    largest = ax.transData.transform((0.0, 1.0))[1]  # of the errors
    assert all(box.y0 > largest for box in boxes)


def panel(count: int, width: float, height: float, samples: int = 0) -> tuple[Any, list[Annotation]]:
    """A panel of so many points with lines that all leave it at one place, and their marks; perhaps with samples."""
    figure = Figure(figsize=(width / 72, height / 72), dpi=72)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for k, colour in enumerate(PALETTE[:count]):
        ax.plot([0.0, 1.0], [10.0 + k, 0.0], color=colour)
    ax.plot(np.linspace(0, 1, samples), np.linspace(0.9, 0.95, samples), linestyle="none", marker="o")
    ax.set(xlim=(0, 1), ylim=(-1, 1))
    return ax, mark_cuts(ax, width, height)


def test_marks_stand_side_by_side_where_the_rows_are_full() -> None:
    ax, found = panel(10, 300.0, 120.0)
    assert sorted(text.get_text() for text in found) == sorted(str(10 + k) for k in range(10))
    boxes = [text.get_window_extent() for text in found]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    inside = ax.get_window_extent()
    assert all(inside.x0 <= box.x0 and box.x1 <= inside.x1 and box.y0 > inside.y1 / 2 for box in boxes)


def test_a_panel_too_small_for_its_marks_says_how_many_more_there_are() -> None:
    _, found = panel(10, 40.0, 40.0)
    shown = [text.get_text() for text in found]
    assert len(shown) < 10
    assert shown[-1].endswith(f", {10 - len(shown)} more")


def test_a_line_that_leaves_again_has_an_arrow_there_without_a_value() -> None:
    """One for each time, not for each point, and none where it has just left."""
    figure = Figure(figsize=(4, 1), dpi=72)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    t = np.linspace(0.0, 1.0, 501)
    heights = np.select([t < 0.1, (t > 0.13) & (t < 0.14), (t > 0.4) & (t < 0.6), t > 0.9], [5.0, 3.0, 2.0, -4.0])
    ax.plot(t, heights, color=PALETTE[0])
    ax.plot(t, -heights, color=PALETTE[1])
    ax.set(xlim=(0, 1), ylim=(-1, 1))
    assert sorted(text.get_text() for text in mark_cuts(ax, 288.0, 72.0)) == ["4", "5", "−4", "−5"]
    arrows = [child for child in ax.get_children() if isinstance(child, Annotation) and child.get_text() in "↑↓"]
    top = [one for one in arrows if one.get_text() == "↑" and one.get_color() == PALETTE[0].lower()]
    assert sorted(round(float(one.xy[0]), 2) for one in top) == [0.0, 0.13, 0.4]
    assert len(arrows) == 4 + 2 * 2  # as many of the line that is its mirror image


def test_a_line_that_is_cut_all_along_has_one_arrow() -> None:
    figure = Figure(figsize=(4, 1), dpi=72)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    t = np.linspace(0.0, 1.0, 501)
    ax.plot(t, 2 * np.sin(60 * t), color=PALETTE[0])
    ax.set(xlim=(0, 1), ylim=(-1, 1))
    mark_cuts(ax, 288.0, 72.0)
    arrows = [child.get_text() for child in ax.get_children() if isinstance(child, Annotation)]
    assert sorted(arrows) == ["2", "↑", "↓", "−2"]


@pytest.mark.parametrize("side", ["top", "bottom"])
def test_marks_hide_none_of_few_samples(side: str) -> None:
    """A first sample beside the place where a band leaves the panel is seen, and the marks of others move with it."""
    sign = 1.0 if side == "top" else -1.0
    figure = Figure(figsize=(3.0, 2.0), dpi=72)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for k, colour in enumerate(PALETTE[:2]):
        ax.fill_between([0.02, 0.03, 0.3, 1.0], [-9.0 - k] * 2 + [-0.5] * 2, [9.0 + k] * 2 + [0.5] * 2, color=colour)
    taken, y = np.array([0.07, 0.5, 0.9]), sign * np.array([0.93, 0.2, 0.0])
    ax.plot(taken, y, linestyle="none", marker="o", markersize=4)
    ax.set(xlim=(0, 1), ylim=(-1, 1))
    mark_cuts(ax, 216.0, 144.0)
    boxes = [child.get_window_extent() for child in ax.get_children() if isinstance(child, Annotation)]
    assert len(boxes) == 8
    for place in ax.transData.transform(np.column_stack([taken, y])):
        assert not any(box.x0 - 2 < place[0] < box.x1 + 2 and box.y0 < place[1] < box.y1 for box in boxes)
    nearest = [box for box in boxes if (box.y0 > 72) == (side == "bottom")]  # where nothing is in the way
    assert min(min(box.y0, 144 - box.y1) for box in nearest) < 2


def test_marks_stand_as_ever_where_samples_are_many() -> None:
    """They cover the panel, and no place is free of them."""
    (_, found), (_, among) = panel(3, 300.0, 120.0), panel(3, 300.0, 120.0, samples=200)
    assert [text.get_window_extent().bounds for text in found] == [text.get_window_extent().bounds for text in among]
