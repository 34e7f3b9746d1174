"""What stands in front, labels that fit, ticks that can be read, symbols that mean one thing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from drawn import lines
from examples import chain, simulated
from matplotlib.figure import Figure
from PIL import Image

from hgorun import Result
from hgorun.commands.tune import _names
from hgorun.explore.picture import styles_of
from hgorun.figures.bode import bode_figure
from hgorun.figures.data import Curve, behind
from hgorun.figures.drawing import comparison
from hgorun.figures.files import _colours, reduced
from hgorun.figures.peaking import peaking
from hgorun.figures.style import styled
from hgorun.figures.ticks import tick
from hgorun.figures.tuning import Tuned, tuning
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.theory import Bode, Transient
from hgorun.study.sentences import read_sentence
from hgorun.tuning.evidence import Evidence


@pytest.fixture(scope="module")
def result() -> Result:
    observers = {"A": {"type": "shgo", "theta": 2}, "B": {"type": "fhgo2", "r": 1, "theta": 3}}
    return simulated(chain(2, "-x1"), observers, end=5)


def noisy(result: Result, **sizes: tuple[float, float]) -> Result:
    """The same run with estimates of both states that go up and down by so much."""
    wave = np.where(np.arange(result.time.size) % 2, 1.0, -1.0)[:, None]
    observers = {
        label: ObserverResult(type="shgo", xhat=result.x + wave * size, internal={}, gains={}, dimension=2)
        for label, size in sizes.items()
    }
    return replace(result, observers=observers)


def from_the_back(ax: Any) -> list[str]:
    drawn = {text: line for text, line in lines(ax).items() if text in ("A", "B", "C")}
    return sorted(drawn, key=lambda text: float(drawn[text].get_zorder()))


@pytest.mark.costly
def test_a_line_that_is_much_rougher_in_a_panel_is_behind_there(result: Result) -> None:
    """Though it is smoother in all states together; lines about as rough stay, and so do their widths."""
    figure = comparison(noisy(result, A=(5.0, 0.1), B=(0.1, 2.0), C=(0.07, 1.9)))
    assert from_the_back(figure.axes[0]) == ["A", "B", "C"]
    assert from_the_back(figure.axes[2]) == ["B", "C", "A"]
    widths = [{text: line.get_linewidth() for text, line in lines(ax).items()} for ax in figure.axes[:3:2]]
    assert widths[0] == widths[1]


@pytest.mark.costly
def test_of_lines_about_as_rough_those_with_gaps_are_in_front(result: Result) -> None:
    """A solid line in front would hide a dotted one that it coincides with; one much rougher is behind both."""
    dotted = noisy(result, A=(0.1, 0.1), B=(0.14, 0.14), C=(1.0, 1.0))
    kinds = {"A": "shgo", "B": "ekf", "C": "kalman_bucy"}  # solid, dotted, solid
    observers = {label: replace(one, type=kinds[label]) for label, one in dotted.observers.items()}
    ax = comparison(replace(dotted, observers=observers)).axes[0]
    assert from_the_back(ax) == ["C", "A", "B"]
    widths = {text: line.get_linewidth() for text, line in lines(ax).items() if text in kinds}
    assert min(widths, key=lambda text: widths[text]) == "B"


@pytest.mark.costly
def test_of_two_lines_the_one_at_the_back_is_only_a_little_thicker(result: Result) -> None:
    """It may stand in front in a panel where it is the smoother one."""
    widths = [line.get_linewidth() for line in lines(comparison(result).axes[0]).values() if line.get_label() in "AB"]
    assert 1.2 < max(widths) / min(widths) < 1.5


def test_lines_in_front() -> None:
    curves = [Curve(np.arange(3.0), np.array([0.0, size, 0.0])) for size in (1.0, 1.5, 8.0, 0.4)]
    assert behind(curves) == [2, 0, 1, 3]
    assert behind(curves[:2]) == [0, 1]
    assert behind([]) == []


def test_errors_beside_bounds_and_on_a_live_page_are_drawn_from_the_roughest(result: Result) -> None:
    rough = noisy(result, A=(0.01, 0.01), B=(1.0, 1.0))
    error = np.ones((result.time.size, 2))
    bound = Transient(("x1", "x2"), result.time, error, 3 * error, 2 * error, True)
    assert from_the_back(peaking(rough, {"A": bound, "B": bound}).axes[0]) == ["B", "A"]
    assert list(styles_of(rough)) == ["B", "A"]


@pytest.mark.parametrize(("low", "high"), [(2e-4, 6.4e-3), (1.1, 99.0), (0.11, 0.9), (0.0505, 0.33), (7.9, 12.4)])
def test_a_logarithmic_axis_has_at_least_three_labels(low: float, high: float) -> None:
    with styled():
        figure = Figure()
        ax = figure.add_subplot(yscale="log", ylim=(low, high))
        tick(ax)
        figure.draw_without_rendering()
        ticks = zip(ax.get_yticklabels(), ax.get_yticks(), strict=True)
        shown = [y for label, y in ticks if low <= y <= high and label.get_text()]
    assert len(shown) >= 3
    assert np.diff(np.log(shown)).min() > 0.07 * np.log(high / low)  # 9 points of a panel of 1.8 inches
    assert max(np.log(high / shown[-1]), np.log(shown[0] / low)) < 0.4 * np.log(high / low)  # nor only at one end


@pytest.mark.costly
def test_noise_has_a_symbol_that_no_state_has(result: Result) -> None:
    data = Bode(np.logspace(-1, 1, 5), {"A": np.ones((5, 2))}, ("x1", "x2"), np.zeros(0), {})
    assert [ax.get_ylabel().partition(r" \rightarrow")[0] for ax in bode_figure(data, result).axes] == ["$v"] * 2
    named = replace(result, states=("p", "v"))
    figure = bode_figure(replace(data, states=("p", "v")), named)
    assert [ax.get_ylabel() for ax in figure.axes] == [
        r"$\mathrm{noise} \rightarrow \hat{p}$",
        r"$\mathrm{noise} \rightarrow \hat{v}$",
    ]


def tuned(label: str, gains: int) -> Tuned:
    values = np.geomspace(1.0, 4.0, 5)
    places = np.tile(values[:, None], (1, gains))
    return Tuned(
        label=label, type="shgo", filter_order=None, paths=tuple(f"observers.{label}.k{i}" for i in range(gains)),
        logarithmic=(True,) * gains, gains=places, goals=values[:, None], met=np.ones(5, dtype=bool),
        front_gains=places[:1], front=values[:1, None], half=np.array([[0.1]]), chosen=0,
    )  # fmt: skip


def test_a_long_goal_fits_beside_its_panel_and_names_no_single_observer() -> None:
    text = "rmse('SHGO', speed) + 0.1*tv('SHGO' , current)/tv('SHGO', angle) + peak('SHGO', current)"
    task = SimpleNamespace(
        label="SHGO",
        goals=((text, read_sentence(text, ("run",))),),
        gains=(),
        base=SimpleNamespace(
            blocks=SimpleNamespace(time=SimpleNamespace(unit="s")), plant=SimpleNamespace(units={"speed": "rad/s"})
        ),
    )
    (name,) = _names([cast(Evidence, SimpleNamespace(task=task))])
    assert name == "rmse(speed) + 0.1*tv(current)/tv(angle) + peak(current)"
    figure = tuning([tuned("SHGO", 1), tuned("FHGO", 1)], [name])
    for ax in figure.axes:
        box = ax.yaxis.label.get_window_extent()
        assert ax.yaxis.label.get_text().replace("\n", " ") == name
        assert box.y0 >= 0
        assert box.y1 <= figure.legends[0].get_window_extent().y0


def test_a_thin_line_keeps_its_colour_beside_wide_ones_in_a_small_picture() -> None:
    """Of sixteen colours; the usual choice would take them all for the wide one."""
    shade = np.random.default_rng(0).uniform(size=(90, 90, 1))
    wide, thin = np.array([0xE6, 0x9F, 0x00]), np.array([0xC4, 0x46, 0x01])
    points = np.rint(255 * shade + (1 - shade) * wide).astype(np.uint8)
    points[0, :5] = thin
    points[1, :5] = 255
    image = Image.fromarray(points)
    small = reduced(image, [wide / 255, thin / 255], 16)
    assert small.convert("RGB").getpixel((2, 0)) == tuple(thin)
    assert small.convert("RGB").getpixel((2, 1)) == (255, 255, 255)
    assert len(small.getcolors() or []) in range(2, 17)
    assert image.quantize(16, dither=Image.Dither.NONE).convert("RGB").getpixel((2, 0)) != tuple(thin)
    figure = Figure()
    figure.add_subplot().plot([0, 1], color="#C44601")
    assert [one.tolist() for one in _colours(figure)] == [list(thin / 255)]
