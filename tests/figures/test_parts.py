"""Parts of figures alone: truths that are one, measurements, panels of what a run does not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import chain, inline, simulated
from matplotlib.figure import Figure
from matplotlib.text import Text

from hgorun import Result
from hgorun.figures import data
from hgorun.figures.bode import bode_figure
from hgorun.figures.data import Curve
from hgorun.figures.drawing import comparison
from hgorun.figures.page import Page
from hgorun.figures.panels import _dense
from hgorun.figures.peaking import peaking
from hgorun.figures.style import TRUTH
from hgorun.figures.truths import truth_looks
from hgorun.result.records.recorded import Recorded
from hgorun.result.records.theory import Bode, Transient


@pytest.fixture(scope="module")
def result() -> Result:
    return simulated(chain(2, "-x1"), {"A": {"type": "shgo", "theta": 2}, "B": {"type": "shgo", "theta": 3}})


def moved(result: Result, by: float) -> Result:
    return replace(result, x=result.x + by)


def test_runs_of_one_truth_share_its_line(result: Result) -> None:
    assert truth_looks([["a", "b"]], {"a": result, "b": result}) == {"a": TRUTH, "b": TRUTH}
    near = truth_looks([["a", "b"]], {"a": result, "b": moved(result, 1e-5)})
    assert near == {"a": TRUTH, "b": TRUTH}


def test_truths_that_can_be_told_apart_have_names(result: Result) -> None:
    found = truth_looks([["a", "b"]], {"a": result, "b": moved(result, 0.5)})
    assert [look["label"] for look in found.values()] == ["a: true", "b: true"]
    assert truth_looks([["a"], ["b"]], {"a": result, "b": moved(result, 0.5)}) == {"a": TRUTH, "b": TRUTH}


def test_truths_of_other_states_or_other_times_are_others(result: Result) -> None:
    renamed = replace(result, states=("p", "q"))
    later = replace(result, time=result.time + 100)
    for other in (renamed, later):
        assert len({look["label"] for look in truth_looks([["a", "b"]], {"a": result, "b": other}).values()}) == 2


def test_a_recording_has_no_truth_that_could_be_told_from_another(result: Result) -> None:
    recorded = replace(result, x=result.x[:, :0], recorded=Recorded({}))
    for results in ({"a": result, "b": recorded}, {"b": recorded, "a": result}, {"a": recorded, "b": recorded}):
        assert truth_looks([["a", "b"]], results) == {"a": TRUTH, "b": TRUTH}
    found = truth_looks([["a", "b", "c"]], {"a": result, "b": recorded, "c": moved(result, 0.5)})
    assert [found[run]["label"] for run in "ac"] == ["a: true", "c: true"]


def test_states_of_runs_that_have_others(result: Result) -> None:
    """A panel shows the observers of the runs that have its state."""
    other = replace(simulated(inline({"z": "-z"}, "z"), {"C": {"type": "shgo", "theta": 2}}), name="other")
    figure = comparison([replace(result, name="one"), other])
    labels = [{text for line in ax.lines if not (text := str(line.get_label())).startswith("_")} for ax in figure.axes]
    of_x = [shown for ax, shown in zip(figure.axes, labels, strict=True) if "x_" in ax.get_ylabel()]
    of_z = [shown for ax, shown in zip(figure.axes, labels, strict=True) if "z" in ax.get_ylabel()]
    assert of_x
    assert of_z
    assert not any("C" in name for shown in of_x for name in shown)
    assert all(any("C" in name for name in shown) for shown in of_z)


@pytest.mark.parametrize(
    ("t", "grid", "dense"),
    [
        ([], [0, 1], []),
        ([0.5], [0, 1], [False]),
        ([0, 1, 2], [0], [False] * 3),
        ([0, 1, 2], [0, 1, 2], [True] * 3),
        ([0, 3, 4, 9], [0, 1, 2], [False, True, True, False]),
    ],
)
def test_samples_that_are_as_dense_as_the_grid_are_a_line(t: list[float], grid: list[float], dense: list[bool]) -> None:
    assert _dense(np.array(t, dtype=float), np.array(grid, dtype=float)).tolist() == dense


def bounded(names: tuple[str, ...], time: np.ndarray) -> Transient:
    error = np.exp(-np.outer(time, np.ones(len(names))))
    return Transient(names, time, error, 3 * error, 2 * error, True)


def test_peaking_of_observers_in_different_coordinates(result: Result) -> None:
    """A row for every coordinate, and in it the observers that have it."""
    transients = {"A": bounded(("x1", "x2"), result.time), "B": bounded(("z1",), result.time)}
    figure = peaking(result, transients)
    drawn = [[line.get_label() for line in ax.lines] for ax in figure.axes]
    assert drawn == [["A", "_A: bound"], ["A", "_A: bound"], ["B", "_B: bound", "bound of the theorem"]]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["A", "B", "bound of the theorem"]


def words_of(figure: Figure) -> str:
    return " ".join(text.get_text() for text in figure.findobj(Text)).replace("\n", " ")


def test_observers_that_the_figure_of_bounds_leaves_out_are_named(result: Result) -> None:
    both = {label: bounded(("x1", "x2"), result.time) for label in ("A", "B")}
    assert "not drawn" not in words_of(peaking(result, both))
    assert "not drawn, having no bound: B" in words_of(peaking(result, {"A": both["A"]}))


@pytest.mark.costly
@pytest.mark.parametrize(("width", "titled"), [("two", 2), ("one", 4)])
def test_panels_below_each_other_have_titles_of_their_own(result: Result, width: str, titled: int) -> None:
    titles = [ax.get_title(loc="left") or ax.get_title() for ax in comparison(result, Page.named(width, "dark")).axes]
    assert len(titles) == 4
    assert [t for t in titles if t][::2] == ["states and estimates"] * (titled // 2)
    assert len([t for t in titles if t]) == titled


def test_a_panel_holds_a_band_that_takes_little_room() -> None:
    limits = (0.0, 10.0)
    assert data.with_bands(limits, []) == limits
    assert data.with_bands(limits, [np.array([1.0, 9.0])]) == limits
    assert data.with_bands(limits, [np.array([-2.0, 12.0]), np.zeros(0)]) == pytest.approx((-2.2, 12.2))
    assert data.with_bands(limits, [np.array([-2.6, 11.0])]) == pytest.approx((0.0, 11.2))  # cut below, with a mark
    assert data.with_bands(None, [np.array([1.0])]) is None


def test_a_response_that_is_zero_has_no_limits_of_its_own(result: Result) -> None:
    omega = np.logspace(-1, 1, 5)
    none = np.column_stack([np.ones(5), np.zeros(5)])
    figure = bode_figure(Bode(omega, {"A": none}, result.states, np.zeros(0), {}), result)
    assert isinstance(figure, Figure)
    low, high = figure.axes[0].get_ylim()
    assert low < 1 < high == 2
    assert figure.axes[1].get_xlim() == pytest.approx((0.1, 10))


def test_noise_that_would_be_a_block_is_pale_with_its_mean_in_it() -> None:
    """A sine with ten thousand periods has the mean of what is slow below it; one with ten is a line as before."""
    t = np.linspace(0.0, 1.0, 100_001)
    slow = t**2
    mean = data.mean_of_block(Curve(t, slow + 0.2 * np.sin(2 * np.pi * 10_000 * t + 0.3)))
    assert mean is not None
    assert np.abs(mean.v - mean.t**2).max() < 0.01
    assert data.mean_of_block(Curve(t, slow + 0.2 * np.sin(2 * np.pi * 10 * t))) is None
    assert data.mean_of_block(Curve(t, slow + 0.002 * np.sin(2 * np.pi * 10_000 * t))) is None  # thin
    assert data.mean_of_block(Curve(t[::100], slow[::100])) is None
    assert data.mean_of_block(Curve(t[:0], t[:0])) is None


@pytest.mark.parametrize("size", [3200, 3599, 8001, 8399])
def test_the_mean_of_a_block_reaches_its_end(size: int) -> None:
    """Of whatever number of points."""
    t = np.linspace(0.0, 1.0, size)
    mean = data.mean_of_block(Curve(t, t + 0.1 * (-1.0) ** np.arange(size)))
    assert mean is not None
    assert mean.t[-1] > 1.0 - 2.0 / 400
    assert len(mean.t) < 450
    assert np.max(np.abs(mean.v - mean.t)) < 0.02


@pytest.mark.costly
def test_what_coincides_with_the_line_in_front_is_seen_behind_it(result: Result) -> None:
    figure = comparison(result)
    lines = [line for line in figure.axes[0].lines if line.get_label() in ("A", "B")]
    back, front = sorted(lines, key=lambda line: line.get_zorder())
    assert back.get_linewidth() > 1.3 * front.get_linewidth()
    for ax in figure.axes:  # an observer's line is as thick everywhere
        for line in ax.lines:
            if line.get_label() in ("A", "B"):
                alike = back if line.get_label() == back.get_label() else front
                assert line.get_linewidth() == alike.get_linewidth()


@pytest.mark.parametrize("size", [1, 2, 3, 100, 101, 6001])
def test_limits_follow_from_quantiles(size: int) -> None:
    """Those of numpy, to the last bit."""
    v = np.random.default_rng(size).normal(0.0, 3.0, size)
    spread, positive = data.Spread.of(v), data.Size.of(np.abs(v))
    assert spread is not None
    assert positive is not None
    assert (spread.start, spread.low, spread.high) == (v[0], min(v), max(v))
    assert spread.central == tuple(np.quantile(v, (0.01, 0.99)))
    assert positive.usual == np.quantile(np.abs(v), 0.01)
