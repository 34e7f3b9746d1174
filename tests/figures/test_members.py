"""Panels of the trajectories of ensembles: which lines and bands, in which colours, in which limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawn import luminance

from hgorun.config.study import Figure
from hgorun.ensemble.collected.collected import Collected, Trajectories
from hgorun.figures.drawing import draw
from hgorun.figures.followed import MembersData
from hgorun.figures.page import STYLES

TIME = np.linspace(0.0, 10.0, 101)
LABELS = ("S", "F")


def data(values: list[float], seeds: int = 1, *, run: str = "gains", truths: int = 1) -> MembersData:
    """Members that are a truth plus what is varied, for S with a seed's own part; their truths may differ."""
    size = len(values) * seeds
    varied = np.repeat(np.array(values), seeds)
    x = np.sin(TIME)[None] + (np.arange(float(size)) * (truths > 1))[:, None]
    xhat = np.stack([x + varied[:, None] + 0.01 * np.arange(size)[:, None], x + 1.0], axis=1)
    members = Collected(
        name=run,
        axes={"k": varied},
        observers=LABELS,
        states=("x1",),
        metrics={},
        status=np.zeros((size, 2), dtype=np.int8),
        error=np.full(size, "", dtype=object),
        units={"x1": "m", "time": "s"},
        families={"S": ("shgo", None), "F": ("fhgo1", 1)},
        trajectories=Trajectories(member=np.arange(size), time=TIME, x=x[..., None], xhat=xhat[..., None]),
    )
    kind = "vary" if seeds == 1 else "seeds and vary" if len(values) > 1 else "seeds"
    return MembersData(run, kind, members, "k" if len(values) > 1 else "", varied)


def drawn(panel: dict[str, Any], of: MembersData) -> Any:
    figure = draw([], Figure.model_validate({"panels": [{"run": of.run, **panel}]}), members={0: of})
    (ax,) = figure.axes
    return ax


@pytest.mark.costly
@pytest.mark.parametrize("style", STYLES)
def test_colours_of_values_are_told_apart_on_every_page(style: str) -> None:
    """By their luminances, which rise; on a dark page each is seen, and the legend has the same ones."""
    of = data([1.0, 2.0, 4.0, 8.0])
    panel = {"run": of.run, "error": "x1", "observers": ["S"]}
    figure = draw([], Figure.model_validate({"style": style, "panels": [panel]}), members={0: of})
    lines = [line for line in figure.axes[0].lines if str(line.get_label()).startswith("$k")]
    light = [luminance(line.get_color()) for line in lines]
    assert len(light) == 4
    assert np.all(np.diff(light) > 0.02)
    if style == "dark":
        page = luminance(figure.get_facecolor())
        assert (min(light) + 0.05) / (page + 0.05) > 3
    handles = figure.legends[0].get_lines()
    assert [handle.get_color() for handle in handles] == [line.get_color() for line in lines]


@pytest.mark.parametrize("error", ["error", "magnitude"])
def test_lost_members_are_counted_and_their_bands_have_no_end(error: str) -> None:
    """Nor does a mark at the edge give a number for it."""
    of = data([0.0], seeds=21, run="mc")
    assert of.members.trajectories is not None
    of.members.trajectories.xhat[:4, 0, 50:] = np.nan
    of.members.status[:4, 0] = 2
    ax = drawn({error: "x1", "observers": ["S"]}, of)
    said = [text.get_text() for text in ax.texts]
    assert said[0] == "4 of 21 members lost"
    assert "∞ (band)" in said[1:]
    assert not any(text.endswith("e3 (band)") for text in said)
    kept = drawn({error: "x1", "observers": ["F"]}, of)
    assert not any("lost" in text.get_text() for text in kept.texts)


def named(ax: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def test_of_one_observer_each_value_has_its_colour_and_name() -> None:
    ax = drawn({"state": "x1", "observers": ["S"]}, data([1.0, 2.0, 4.0]))
    lines = named(ax)
    assert list(lines) == ["$k = 1$", "$k = 2$", "$k = 4$", "true"]
    assert len({lines[name].get_color() for name in list(lines)[:3]}) == 3
    np.testing.assert_array_equal(lines["$k = 4$"].get_ydata(), np.sin(TIME) + 4.0 + 0.02)
    assert (ax.get_xlabel(), ax.get_xlim()) == ("time [s]", (0.0, 10.0))


def test_of_many_values_the_ends_are_named() -> None:
    values = [float(k) for k in range(1, 12)]
    ax = drawn({"error": "x1", "observers": ["S"], "members": "lines"}, data(values, seeds=2))
    assert list(named(ax)) == ["$k = 1$", "$k = 11$"]
    assert len(ax.lines) == 22 + 1  # and zero


def test_of_several_observers_each_has_its_own_colour() -> None:
    ax = drawn({"error": "x1"}, data([1.0, 2.0]))
    assert list(named(ax)) == ["S", "F"]
    colours = [line.get_color() for line in ax.lines[1:]]
    assert colours[0] == colours[1] != colours[2] == colours[3]


def test_seeds_are_bands() -> None:
    of = data([0.0], seeds=21, run="mc")
    ax = drawn({"error": "x1", "observers": ["S"]}, of)
    np.testing.assert_allclose(named(ax)["S"].get_ydata(), 0.10)  # the median of 0, 0.01, ..., 0.20
    wide, narrow = (path.get_paths()[0].vertices[:, 1] for path in ax.collections)
    assert (wide.min(), wide.max()) == pytest.approx((0.01, 0.19))
    assert (narrow.min(), narrow.max()) == pytest.approx((0.05, 0.15))
    as_lines = drawn({"magnitude": "x1", "observers": ["S"], "members": "lines"}, of)
    assert (len(as_lines.lines), as_lines.get_yscale()) == (21, "log")


@pytest.mark.parametrize(("members", "lines"), [("lines", 20), ("bands", 1)])
def test_truths_that_differ(members: str, lines: int) -> None:
    """Each of them, or their median, which is told."""
    ax = drawn({"state": "x1", "observers": ["F"], "members": members}, data([0.0], seeds=20, truths=2))
    black = [line for line in ax.lines if line.get_color() == "black"]
    assert len(black) == lines
    assert ("true (median)" in named(ax)) == (members == "bands")


def test_a_window_decides_the_limits() -> None:
    of = data([1.0, 2.0])
    assert of.members.trajectories is not None
    of.members.trajectories.xhat[:, 0, TIME < 5] += 1e3
    ax = drawn({"error": "x1", "observers": ["S"], "window": [6, 8]}, of)
    assert ax.get_xlim() == (6, 8)
    assert ax.get_ylim()[1] < 3
