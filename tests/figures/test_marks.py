"""What figures say of themselves: peaks that are cut, legends that fit, insets beside the data, dark pages."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from drawn import block, lines, luminance
from examples import chain, simulated
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from hgorun import ConfigError, Result
from hgorun.figures.bode import bode_figure
from hgorun.figures.cuts import cuts, further_cuts
from hgorun.figures.data import without_outliers
from hgorun.figures.drawing import comparison, draw
from hgorun.figures.page import Page, dark
from hgorun.figures.style import PALETTE, styled
from hgorun.figures.ticks import tick
from hgorun.figures.tuning import Tuned, tuning
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.recorded import Recorded, RecordedOutput, Unseen
from hgorun.result.records.theory import Bode


@pytest.fixture(scope="module")
def result() -> Result:
    return simulated(chain(2, "-x1"), {"A": {"type": "shgo", "theta": 2}, "B": {"type": "shgo", "theta": 3}}, end=5)


def with_estimates(result: Result, **errors: np.ndarray) -> Result:
    """The same run with estimates whose errors, equal for all states, are given."""
    observers = {
        label: ObserverResult(type="shgo", xhat=result.x + e[:, None], internal={}, gains={}, dimension=2)
        for label, e in errors.items()
    }
    return replace(result, observers=observers)


def marks(ax: Any) -> list[str]:
    """The values written at the edges, without their arrows."""
    texts = [child.get_text() for child in ax.get_children() if isinstance(child, Annotation)]
    return [text for text in texts if text not in "↑↓"]


@pytest.mark.costly
def test_a_peak_that_is_cut_has_an_arrow_with_its_value(result: Result) -> None:
    t = result.time
    peaking = with_estimates(
        result, small=0.1 * np.exp(-t), peak=1234.5 * np.exp(-50 * t), dip=-777.0 * np.exp(-50 * t)
    )
    whole, *_ = comparison(peaking).axes
    assert lines(whole)["peak"].get_ydata().max() > whole.get_ylim()[1]
    assert marks(whole) == ["1.24e3" if f"{1235.0:.3g}" == "1.24e+03" else "1.23e3", "−776"]
    assert not marks(comparison(with_estimates(result, small=0.1 * np.exp(-t))).axes[0])


def test_a_band_that_is_cut_has_an_arrow_with_its_value() -> None:
    """Where the line in it stays inside; what lies outside of the time that is shown does not count."""
    figure = Figure()
    ax = figure.add_subplot()
    t = np.linspace(0.0, 2.0, 201)
    ax.plot(t, 0.1 * t, color="#0072B2")
    ax.fill_between(t, -t, 3.0 * t, color="#0072B2", alpha=0.2, linewidth=0)
    ax.fill_between(t, 0.2 * t, 0.3 * t, color="#E69F00", alpha=0.2, linewidth=0)
    ax.set(xlim=(0, 1), ylim=(-2, 2))
    assert [(one.side, one.text, one.colour) for one in cuts(ax)] == [("top", "3 (band)", "#0072b2")]
    ax.plot(t, 2.5 * t, color="#0072B2")  # what is estimated says more than how uncertain it is
    assert [(one.side, one.text, one.colour) for one in cuts(ax)] == [("top", "2.5", "#0072b2")]


@pytest.mark.parametrize(
    ("offset", "furthest"), [(300.0, {"top": "350", "bottom": "240"}), (-300.0, {"top": "−250", "bottom": "−360"})]
)
def test_the_furthest_is_that_beyond_the_edge_where_zero_is_far(offset: float, furthest: dict[str, str]) -> None:
    """Temperatures in kelvin, and their negatives: two lines of one colour, each of which leaves the panel twice."""
    ax = Figure().add_subplot()
    t = np.arange(9.0)
    ax.plot(t, offset + np.array([0.0, 20.0, 0.0, -20.0, 0.0, 30.0, 0.0, -40.0, 0.0]), color="C0")
    ax.plot(t + 0.5, offset + np.array([0.0, 50.0, 0.0, -60.0, 0.0, 15.0, 0.0, -15.0, 0.0]), color="C0")
    ax.set(xlim=(0, 9), ylim=(offset - 10, offset + 10))
    found = cuts(ax)
    assert {one.side: one.text for one in found} == furthest
    others = [(one.side, one.value - offset) for one in further_cuts(ax, found, 0.01)]
    assert [value for side, value in others if side == "top"] == [30.0, 20.0, 15.0]
    assert [value for side, value in others if side == "bottom"] == [-40.0, -20.0, -15.0]


@pytest.mark.costly
def test_every_panel_with_limits_of_its_own_says_what_it_leaves_out(result: Result) -> None:
    shown = with_estimates(result, A=np.full(result.time.size, 0.5), B=np.where(result.time < 1, 3.0, 0.0))
    state, error, early = draw(
        shown,
        block(
            {"state": "x1", "limits": [-10, 10]},
            {"error": "x1", "limits": [-1, 1]},
            {"error": "x1", "limits": [-1, 1], "window": [2, 4]},
        ),
    ).axes
    assert [marks(ax) for ax in (state, error, early)] == [[], ["3"], []]  # outside its time nothing is cut


def test_values_at_an_edge_do_not_hide_each_other(result: Result) -> None:
    t = result.time
    peaks = {f"o{k}": (100.0 + 10 * k) * np.exp(-30 * t) for k in range(5)}
    figure = comparison(with_estimates(result, small=0.01 * np.cos(t), **peaks))
    found = [one for one in figure.axes[0].get_children() if isinstance(one, Annotation) and one.get_text() not in "↑↓"]
    assert len(found) == 5
    boxes = [one.get_window_extent() for one in found]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    inside = figure.axes[0].get_window_extent()
    assert all(inside.x0 <= box.x0 and box.x1 <= inside.x1 for box in boxes)


@pytest.mark.costly
@pytest.mark.parametrize(("width", "count"), [(3.5, 9), (7.2, 9)])
def test_legends_stay_inside_their_figure(result: Result, width: float, count: int) -> None:
    errors = {f"a rather long name of observer number {k}": np.sin(result.time + k) for k in range(count)}
    figure = comparison(with_estimates(result, **errors), Page(width))
    (legend,) = figure.legends
    extent = legend.get_window_extent()
    assert extent.x0 >= 0
    assert extent.x1 <= figure.bbox.x1
    assert extent.y1 <= figure.bbox.y1 + 1
    assert len(legend.get_texts()) == count + 1
    assert figure.get_figwidth() == width


@pytest.mark.costly
def test_figures_for_one_column_have_their_panels_below_each_other(result: Result) -> None:
    narrow = comparison(result, Page.named("one", "light"))
    assert len({round(ax.get_position().x0, 2) for ax in narrow.axes}) == 1
    assert min(float(text.get_fontsize()) for text in narrow.axes[0].get_yticklabels()) >= 8
    assert draw(result, block({"state": "x1"}, width="one")).get_figwidth() == 3.5
    for wrong in (("three", "light"), ("one", "pink")):
        with pytest.raises(ConfigError, match="expected one of"):
            Page.named(*wrong)


def hidden(figure: Figure) -> int:
    """Points of the lines of the first panel that lie below its inset."""
    ax = figure.axes[0]
    box = ax.child_axes[0].get_window_extent()
    found = 0
    for line in ax.lines:
        x, y = ax.transData.transform(line.get_xydata()).T
        found += int(np.sum((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)))
    return found


@pytest.mark.costly
@pytest.mark.parametrize("shape", ["rising", "falling", "everywhere"])
def test_an_inset_covers_no_data(result: Result, shape: str) -> None:
    t = result.time
    x = {"rising": t, "falling": -t, "everywhere": np.sin(20 * t)}[shape]
    own = replace(result, x=np.column_stack([x, x]))
    panel: dict[str, Any] = {"state": "x1", "inset": {"window": [2, 2.5]}}
    assert hidden(draw(with_estimates(own, A=0.01 * np.cos(t)), block(panel))) == 0


# The page


def test_everything_on_a_dark_page_stands_out(result: Result) -> None:
    """By the contrast that WCAG 2.2 asks of graphics, 3:1, and of text, 4.5:1."""
    figure = draw(
        result,
        block({"state": "x1", "measurements": True, "inset": {"window": [1, 2]}}, {"error": "x1"}, style="dark"),
    )
    page = luminance(figure.get_facecolor())
    assert page < 0.02
    for ax in figure.axes:
        assert luminance(ax.get_facecolor()) == pytest.approx(page)
        for line in lines(ax).values():
            assert (luminance(line.get_color()) + 0.05) / (page + 0.05) > 3
        for text in (ax.xaxis.label, ax.yaxis.label, *ax.get_xticklabels(), *figure.legends[0].get_texts()):
            assert (luminance(text.get_color()) + 0.05) / (page + 0.05) > 4.5


def test_colours_of_a_dark_page() -> None:
    assert luminance(dark("black")) > 0.8
    assert luminance(dark("white")) < 0.02
    assert dark((0.0, 0.0, 0.0, 0.3))[3] == 0.3
    assert len({dark(colour) for colour in PALETTE}) == len(PALETTE)
    assert to_rgb(dark(PALETTE[4])[:3]) == pytest.approx(to_rgb(PALETTE[4]), abs=1e-6)  # light enough as it is


# Single kinds of figures


def test_the_frequencies_of_the_noise_are_named_once(result: Result) -> None:
    data = Bode(np.logspace(-1, 1, 5), {"A": np.ones((5, 2))}, result.states, np.array([2.0, 3.0]), {})
    figure = bode_figure(data, result)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["noise of this run", "A"]


def test_units_of_a_gain(result: Result) -> None:
    data = Bode(np.logspace(-1, 1, 5), {"A": np.ones((5, 2))}, result.states, np.zeros(0), {})
    known = replace(result, units={"x1": "m", "x2": "m/s", result.outputs[0]: "m"})
    assert [ax.get_ylabel().partition(" [")[2] for ax in bode_figure(data, known).axes] == ["", "(m/s)/m]"]


def test_a_knee_that_is_beaten_on_held_out_seeds_is_hollow() -> None:
    def drawn(chosen: int) -> Any:
        front = np.array([[1.0, 3.0], [2.0, 2.0], [2.5, 2.5], [3.0, 1.0]])  # the third is beaten by the second
        gains, met = np.ones((4, 1)), np.array([True, True, True, False])
        found = Tuned(
            label="A", type="shgo", filter_order=None, paths=("observers.A.theta",), logarithmic=(True,), gains=gains,
            goals=front, met=met, front_gains=gains, front=front, half=0.1 * front, chosen=chosen,
        )  # fmt: skip
        ax = tuning([found], ["a", "b"]).axes[0]
        return next(line for line in ax.lines if line.get_marker() == "*")

    assert drawn(1).get_markerfacecolor() == drawn(1).get_color()
    assert drawn(2).get_markerfacecolor() == "white"


def test_a_front_of_one_point_is_shown_with_what_was_tried() -> None:
    """And the interval of the knee is drawn once."""
    goals = np.array([[1.0, 3.0], [2.0, 5.0], [4.0, 9.0], [6.0, 11.0], [900.0, 900.0]])
    found = Tuned(
        label="A", type="shgo", filter_order=None, paths=("observers.A.theta",), logarithmic=(True,),
        gains=np.ones((5, 1)), goals=goals, met=np.ones(5, dtype=bool), front_gains=np.ones((1, 1)),
        front=goals[:1] + 0.01, half=np.array([[0.1, 0.2]]), chosen=0,
    )  # fmt: skip
    ax = tuning([found], ["a", "b"]).axes[0]
    for values, (low, high) in zip(goals.T, (ax.get_xlim(), ax.get_ylim()), strict=True):
        assert low < values[0]
        assert values[3] < high < values[4]
    intervals = [one for one in ax.collections if isinstance(one, LineCollection)]
    bars = [part for one in intervals for part in one.get_segments() if len(part)]
    assert len(bars) == 2


def test_the_interval_of_the_best_is_in_front_of_its_mark() -> None:
    values = np.array([[1.0], [2.0]])
    found = Tuned(
        label="A", type="shgo", filter_order=None, paths=("observers.A.theta",), logarithmic=(True,), gains=values,
        goals=values, met=np.array([True, True]), front_gains=values[:1], front=values[:1], half=np.array([[1e-3]]),
        chosen=0,
    )  # fmt: skip
    ax = tuning([found], ["a"]).axes[0]
    star = next(line for line in ax.lines if line.get_marker() == "*")
    caps = [line for line in ax.lines if line.get_marker() == "_"]
    assert len(caps) == 2
    assert all(cap.get_zorder() > star.get_zorder() for cap in caps)
    assert all(cap.get_markersize() > 0.8 * star.get_markersize() for cap in caps)


def recorded(result: Result, used: np.ndarray) -> Result:
    """The run as an estimate of a recording, whose samples the observers have used or not."""
    t = result.time[::5]
    nothing = np.full((t.size, used.shape[1]), np.nan)
    one = RecordedOutput(t, t, np.cos(t), used, nothing, nothing)
    return replace(result, recorded=Recorded({result.outputs[0]: one}, {}, {}), measures={result.outputs[0]: "x1"})


@pytest.mark.costly
def test_samples_that_one_of_two_observers_left_out_say_whose(result: Result) -> None:
    count = result.time[::5].size
    used = np.ones((count, 2), dtype=bool)
    used[1, 0] = used[2, :] = False
    ax = comparison(recorded(result, used)).axes[0]
    drawn = lines(ax)
    assert drawn["measured"].get_xdata().size == count - 1
    assert drawn["not used"].get_xdata().size == 1
    assert drawn["not used by A"].get_xdata().size == 1
    assert drawn["measured"].get_zorder() > max(drawn[label].get_zorder() for label in "AB")
    assert ax.get_ylabel().startswith("$x_{1}$")  # there is no truth beside what was measured
    assert drawn["not used by A"].get_color() == drawn["A"].get_color()
    assert "not used by B" not in drawn


@pytest.mark.costly
@pytest.mark.parametrize(
    ("count", "expected"),
    [(3, {"held out": 3}), (2, {"held out": 2, "reference": 1}), (0, {"reference": 3})],
)
def test_points_that_are_held_out_and_the_reference_are_drawn_once(
    result: Result, count: int, expected: dict[str, int]
) -> None:
    """A file that is held out may stand in the column that is the reference."""
    one = recorded(result, np.ones((result.time[::5].size, 2), dtype=bool))
    assert one.recorded is not None
    points = Unseen(np.array([0.2, 0.5, 0.8]), np.array([0.1, 0.4, 0.2]))
    held_out = Unseen(points.taken[:count], points.y[:count])
    more = replace(one.recorded, held_out={"x1": held_out}, reference={"x1": points})
    drawn = lines(comparison(replace(one, recorded=more)).axes[0])
    assert {name: drawn[name].get_xdata().size for name in ("held out", "reference") if name in drawn} == expected


def test_samples_that_are_the_reference_too_are_drawn_once(result: Result) -> None:
    """They would lie on the crosses of those that an observer has not taken."""
    one = recorded(result, np.ones((result.time[::5].size, 2), dtype=bool))
    assert one.recorded is not None
    taken = one.recorded.outputs["x1"]
    points = Unseen(np.append(taken.taken, 0.77), np.append(taken.y, 0.5))
    drawn = lines(comparison(replace(one, recorded=replace(one.recorded, reference={"x1": points}))).axes[0])
    assert drawn["reference"].get_xdata().tolist() == [0.77]
    assert drawn["measured"].get_xdata().size == taken.taken.size


@pytest.mark.parametrize(("count", "many"), [(60, False), (400, True)])
def test_many_held_out_samples_hide_no_estimate_and_an_outlier_sets_no_limits(
    result: Result, count: int, many: bool
) -> None:
    one = recorded(result, np.ones((result.time[::5].size, 2), dtype=bool))
    assert one.recorded is not None
    taken = np.linspace(0, 5, count)
    y = np.cos(taken)
    y[count // 2] = 9.0
    more = replace(one.recorded, held_out={"x1": Unseen(taken, y)})
    ax = comparison(replace(one, recorded=more)).axes[0]
    drawn = lines(ax)
    assert drawn["held out"].get_xdata().size == count
    assert (drawn["held out"].get_zorder() < drawn["A"].get_zorder()) == many
    assert (ax.get_ylim()[1] < 3) == many
    assert marks(ax) == (["9"] if many else [])


@pytest.mark.parametrize(("held_out", "part"), [(60, 1.0), (113, 0.729), (200, 0.548)])
def test_held_out_samples_lie_on_those_used_and_cover_no_larger_area(
    result: Result, held_out: int, part: float
) -> None:
    """Every fifth sample of a log: the score is of these."""
    one = recorded(result, np.ones((result.time[::5].size, 2), dtype=bool))
    assert one.recorded is not None
    t = np.linspace(0, 5, 4 * held_out)
    used = RecordedOutput(t, t, np.cos(t), np.ones((t.size, 2), dtype=bool), *[np.full((t.size, 2), np.nan)] * 2)
    points = Unseen(t[2::4], np.cos(t[2::4]))
    more = replace(one.recorded, outputs={"x1": used}, held_out={"x1": points})
    drawn = lines(comparison(replace(one, recorded=more)).axes[0])
    assert drawn["measured"].get_zorder() < min(drawn[label].get_zorder() for label in "AB")
    assert drawn["held out"].get_zorder() > max(drawn[label].get_zorder() for label in "AB")
    assert drawn["held out"].get_markersize() == pytest.approx(3.4 * part, rel=1e-3)
    assert drawn["held out"].get_markersize() > drawn["measured"].get_markersize()


def test_of_few_recorded_values_all_set_limits() -> None:
    few = np.array([1.0, 2.0, 1.0, 9.0])
    assert without_outliers(few).tolist() == few.tolist()
    assert not without_outliers(few[:0]).size


def test_two_estimates_compared_name_their_samples_once(result: Result) -> None:
    used = np.ones((result.time[::5].size, 2), dtype=bool)
    used[3, :] = used[4, 0] = False
    one = recorded(result, used)
    figure = comparison([one, replace(one, name="other")])
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(set(texts)) == len(texts)
    assert sorted(set(texts) - {"measured", "not used"}) == sorted(
        [f"{run}: {label}" for run in ("test", "other") for label in ("A", "B")]
        + ["not used by test: A", "not used by other: A"]
    )


def test_settings_of_matplotlib_are_those_of_nine_points() -> None:
    import matplotlib

    with styled():
        assert matplotlib.rcParams["font.size"] == 9


@pytest.mark.costly
def test_an_error_that_stays_is_not_cut_beside_a_smaller_one_but_a_transient_is(result: Result) -> None:
    t = result.time
    small, steady, transient = 0.04 * np.cos(9 * t), 2.0 * np.cos(9 * t), 2.0 * np.exp(-9 * t)
    stays = draw(with_estimates(result, small=small, large=steady), block({"error": "x1"})).axes[0]
    low, high = stays.get_ylim()
    assert low < -1.9
    assert high > 1.9
    assert marks(stays) == []
    ends = draw(with_estimates(result, small=small, large=transient), block({"error": "x1"})).axes[0]
    assert ends.get_ylim()[1] < 0.5
    assert marks(ends) == ["2"]


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (2.0, 6.0, ["2", "3", "4", "5", "6"]),
        (5.5, 9.5, ["6", "7", "8", "9"]),
        (4.1, 5.3, ["4.2", "4.4", "4.6", "4.8", "5.0", "5.2"]),
    ],
)
def test_a_short_logarithmic_axis_has_labels_enough(low: float, high: float, labels: list[str]) -> None:
    figure = Figure()
    ax = figure.add_subplot()
    ax.set(xscale="log", xlim=(low, high))
    tick(ax)
    figure.draw_without_rendering()
    shown = [one.get_text() for one in ax.get_xticklabels() if low <= one.get_position()[0] <= high]
    assert shown == labels
