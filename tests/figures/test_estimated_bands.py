"""Bands of estimates of recordings: their teeth and hairs, what should lie in them, and the samples beside them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drawn import lines
from examples import chain, simulated
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.patches import Rectangle

from hgorun import Result
from hgorun.figures.actors import cast
from hgorun.figures.drawing import comparison
from hgorun.figures.estimated_bands import _kinds, _of_samples, without_hairs
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.recorded import Assessed, Recorded, RecordedOutput, Unseen
from hgorun.result.records.status import Verdict


def saw(period: float, end: float = 20.0, step: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """A width that grows from 1 to 2 in a period and jumps back."""
    t = np.arange(0.0, end, step)
    return t, 1.0 + np.mod(t + 1e-9, period) / period


def test_a_band_between_sparse_samples_is_left_alone() -> None:
    t, width = saw(0.5)
    assert np.array_equal(without_hairs(t, width, 20 / 60), width)


def test_tips_that_are_close_are_joined() -> None:
    t, width = saw(0.1)
    found = without_hairs(t, width, 20 / 60)
    inner = (t > 0.1) & (t < 19.9)
    assert found[inner] == pytest.approx(np.full(np.count_nonzero(inner), width.max()))


def test_hairs_at_held_out_samples_are_joined_over_smaller_teeth() -> None:
    """Every fifth sample is held out: there the band grows on."""
    t, width = saw(0.05, step=0.005)
    held_out = np.mod(t + 1e-9, 0.25) < 0.05
    width[held_out] += 2.0
    found = without_hairs(t, width, 20 / 60)
    inner = (t > 0.25) & (t < 19.7)
    assert found[inner].min() > 3.8
    few = without_hairs(t, width, 0.12)  # the teeth are joined, and the hairs stay
    assert few[inner].min() == pytest.approx(1.9, abs=0.11)
    assert few.max() == width.max()


def test_where_there_is_no_band_there_is_none() -> None:
    t, width = saw(0.1)
    width[500:700] = np.nan
    found = without_hairs(t, width, 1.0)
    assert np.array_equal(np.isnan(found), np.isnan(width))
    assert np.isnan(without_hairs(t, np.full(t.size, np.nan), 1.0)).all()


@given(st.lists(st.integers(0, 5), max_size=40), st.floats(0.0, 50.0))
def test_a_band_grows_no_narrower_and_no_wider_than_its_tips(widths: list[int], narrowest: float) -> None:
    width = np.array(widths, dtype=float)
    found = without_hairs(np.arange(width.size, dtype=float), width, narrowest)
    assert np.all(found >= width)
    assert found.max(initial=0) == width.max(initial=0)
    assert np.array_equal(without_hairs(np.arange(width.size, dtype=float), found, narrowest), found)


@pytest.fixture(scope="module")
def result() -> Result:
    """A recording with samples of x1, of which some are held out: K knows P, and R is a tenth."""
    run = simulated(chain(2, "-x1"), {"B": {"type": "shgo", "theta": 2}, "K": {"type": "shgo", "theta": 3}}, end=5)
    t, n = run.time, len(run.states)
    P = np.broadcast_to(0.04 * np.eye(n), (t.size, n, n))
    half = 1.959963984540054 * 0.2
    plain = ObserverResult(type="shgo", xhat=run.x + 0.01, internal={}, gains={}, dimension=2)
    of_residuals = Assessed(plain.xhat - 0.5, plain.xhat + np.array([0.5, np.nan]), {"x2": "nothing measures it"}, {})
    of_residuals.lower[:, 1] = np.nan
    of_covariance = Assessed(run.x - half, run.x + half, {}, {})
    observers = {
        "K": replace(plain, xhat=run.x, internal={"P": P}, assessed=of_covariance),
        "B": replace(plain, assessed=of_residuals),
    }
    taken = t[::20]
    y = run.x[::20, 0] + 0.1
    innovation = np.column_stack([np.full(y.size, 0.1), np.full(y.size, 0.09)])
    nis = np.column_stack([innovation[:, 0] ** 2 / (0.04 + 0.1), np.full(y.size, np.nan)])
    one = RecordedOutput(taken, taken, y, np.ones((y.size, 2), dtype=bool), innovation, nis)
    held_out = {"x1": Unseen(t[10:200:20], run.x[10:200:20, 0])}
    return replace(run, observers=observers, recorded=Recorded({"x1": one}, held_out), measures={"x1": "x1"})


def legend(result: Any) -> list[str]:
    return [text.get_text() for text in comparison(result).legends[0].get_texts()]


def bands(ax: Any) -> list[float]:
    """The height of every band at the start."""
    corners = [np.asarray(one.get_paths()[0].vertices) for one in ax.collections if isinstance(one, PolyCollection)]
    return [float(np.ptp(points[points[:, 0] == 0.0, 1])) for points in corners]


def test_the_legend_is_in_order_and_says_what_bands_are_of(result: Result) -> None:
    assert legend(result) == [
        "measured",
        "held out",
        "K",
        "B",
        "95 % of the true state (K)",
        "95 % of samples (B)",
        "95 % of samples (K)",
    ]
    two_runs = legend([result, replace(result, name="other", states=("x1", "z"))])
    assert two_runs[-3:] == legend(result)[-3:]
    alone = replace(result, observers={"B": result.observers["B"]})
    assert legend(alone)[-2:] == ["B", "95 % of samples"]


def test_bands_have_the_colours_of_their_observers_in_the_legend(result: Result) -> None:
    """One patch of several bands has all their colours; a dotted band has a dotted line."""
    figure = comparison(result)
    drawn = {label: lines(figure.axes[0])[label].get_color() for label in "KB"}
    assert drawn["K"] != drawn["B"]
    handles: dict[str, Any] = dict(zip(legend(result), figure.legends[0].legend_handles, strict=True))
    for text, label in (("the true state (K)", "K"), ("samples (B)", "B")):
        assert to_hex(handles[f"95 % of {text}"].get_edgecolor()) == drawn[label].lower()
    assert handles["95 % of samples (K)"].get_color() == drawn["K"]
    assert handles["95 % of samples (K)"].get_linestyle() == "--"
    both = comparison(replace(result, observers={label: result.observers["B"] for label in "KB"}))
    patches: list[Any] = both.legends[0].findobj(Rectangle)
    shown = [to_hex(one.get_edgecolor()) for one in patches if one is not both.legends[0].get_frame()]
    assert shown == [lines(both.axes[0])[label].get_color().lower() for label in "KB"]


@pytest.mark.parametrize(
    ("kind", "missing", "said"),
    [
        ("kalman_bucy", slice(10, 37), "the true state, fewer in gaps"),
        ("kalman_bucy", slice(40, None), "the true state, fewer in gaps"),  # the run goes on
        ("kalman_bucy", slice(5, 7), "the true state"),
        ("ekf", slice(10, 37), "the true state"),
        ("of_another_package", slice(10, 37), "the true state"),
    ],
)
def test_what_holds_of_steady_samples_alone_is_said_where_some_are_missing(
    result: Result, kind: str, missing: slice, said: str
) -> None:
    """The covariance of a filter of continuous measurements does not know that none come."""
    assert result.recorded is not None
    t, numbers = result.time, np.full((result.time.size, 2), 0.1)
    used = np.ones(numbers.shape, dtype=bool)
    used[missing, 0] = False
    one = RecordedOutput(t, t, result.x[:, 0], used, numbers, numbers)
    recorded = replace(result.recorded, outputs={"x1": one})
    observers = {**result.observers, "K": replace(result.observers["K"], type=kind)}
    scene: Any = SimpleNamespace(actors=cast([replace(result, recorded=recorded, observers=observers)]))
    assert {what: [actor.label for actor in who] for what, who in _kinds(scene).items()} == {
        said: ["K"],
        "samples": ["B"],  # which used them all
    }


def test_the_legend_says_so_and_whose_band_of_samples_is_drawn(result: Result) -> None:
    K = replace(result.observers["K"], type="kalman_bucy")
    assert result.recorded is not None
    one = result.recorded.outputs["x1"]
    early = replace(one, taken=0.1 * one.taken, available=0.1 * one.available)  # behind them nothing is measured
    recorded = replace(result.recorded, outputs={"x1": early})
    found = legend(replace(result, recorded=recorded, observers={**result.observers, "K": K}))
    ends = ["the true state, fewer in gaps (K)", "samples, fewer in gaps (B)", "samples, fewer in gaps (K)"]
    assert found[-3:] == [f"95 % of {end}" for end in ends]


def test_beside_held_out_samples_stands_the_band_of_samples(result: Result) -> None:
    """+- 1.96 sqrt(P + R) beside +- 1.96 sqrt(P)."""
    of_x1, of_x2 = comparison(result).axes
    assert bands(of_x1) == pytest.approx([3.92 * 0.2, 1.0, 3.92 * 0.14**0.5], rel=1e-3)
    assert bands(of_x2) == pytest.approx([3.92 * 0.2], rel=1e-3)
    assert result.recorded is not None
    nothing_held_out = replace(result, recorded=replace(result.recorded, held_out={}))
    assert len(bands(comparison(nothing_held_out).axes[0])) == 2


def test_the_band_of_samples_is_about_the_estimate_at_all_times(result: Result) -> None:
    """Of two samples, and beyond the last: the estimate between them is no straight line."""
    actor = cast([result])[0]
    assert result.recorded is not None
    one = result.recorded.outputs["x1"]
    few = [0, 1]
    sparse = replace(
        one, taken=one.taken[few], y=one.y[few], used=one.used[few], innovation=one.innovation[few], nis=one.nis[few]
    )
    recorded = replace(result.recorded, outputs={"x1": sparse})
    found = _of_samples(replace(actor, result=replace(result, recorded=recorded)), "x1", "x1")
    assert found is not None
    t, lower, upper = found
    assert np.array_equal(t, result.time)
    np.testing.assert_allclose((lower + upper) / 2, result.x[:, 0], atol=1e-12)
    np.testing.assert_allclose(upper - lower, 2 * 1.959963984540054 * np.sqrt(0.04 + 0.1))
    unknown = replace(result.recorded, outputs={"x1": replace(one, nis=np.full_like(one.nis, np.nan))})
    assert _of_samples(replace(actor, result=replace(result, recorded=unknown)), "x1", "x1") is None


def test_a_covariance_of_which_the_band_is_not_made_says_nothing(result: Result) -> None:
    other = replace(result.observers["K"], internal={"P": 2 * result.observers["K"].internal["P"]})
    assert "95 % of samples" in legend(replace(result, observers={"K": other}))


def test_many_samples_under_a_line_are_seen_in_front_of_it(result: Result) -> None:
    """A part of them, which look as all do; none where they lie beside the line anyway."""
    t = np.linspace(0, 5, 3000)

    def in_front(noise: float, lost: bool = False) -> int:
        y = np.interp(t, result.time, result.x[:, 0]) + noise * (-1.0) ** np.arange(t.size)
        used = np.ones((t.size, 2), dtype=bool)
        one = RecordedOutput(t, t, y, used, np.zeros((t.size, 2)), np.full((t.size, 2), np.nan))
        observers = dict(result.observers)
        if lost:
            gone = np.where(result.time[:, None] < 1, result.x, np.nan)
            first = next(iter(observers))
            observers[first] = replace(observers[first], xhat=gone, verdict=Verdict("diverged", 1.0))
        ax = comparison(replace(result, observers=observers, recorded=Recorded({"x1": one}))).axes[0]
        behind = lines(ax)["measured"]
        assert behind.get_xdata().size == t.size
        found = [line for line in ax.lines if line.get_marker() == "o" and line.get_zorder() > 4]
        assert all(look(line) == look(behind) for line in found)
        return sum(np.size(line.get_xdata()) for line in found)

    def look(line: Any) -> list[Any]:
        return [line.get_color(), line.get_markersize(), line.get_markeredgewidth(), line.get_linestyle()]

    assert in_front(1e-4) == in_front(1e-4, lost=True) == 120
    assert in_front(0.3) == 0
