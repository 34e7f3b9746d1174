"""Figures of several runs, insets, scaling panels, small pictures."""

import io
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from drawn import block, lines, outline
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from PIL import Image

from hgorun.errors import HgorunError, Problem
from hgorun.figures.drawing import comparison, draw
from hgorun.figures.files import save, thumbnail
from hgorun.figures.looks import family_colour
from hgorun.figures.names import RunNames, check
from hgorun.figures.scaling import ScaledObserver, ScalingData
from hgorun.figures.style import TRUTH
from hgorun.result.records.data import Measurements
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result


def made_up(kind: str, xhat: np.ndarray) -> ObserverResult:
    """An observer without states of its own."""
    return ObserverResult(type=kind, xhat=xhat, internal={}, gains={}, dimension=2)


def run(name: str, *, end: float = 10.0, step: float = 0.01, period: float = 0.5, shift: float = 0.0) -> Result:
    """A made-up run: two states, a noisy and a smooth observer."""
    t = np.arange(0, end + step / 2, step)
    x = np.column_stack([np.sin(t + shift), np.cos(t + shift)])
    noise = np.sin(40 * t)[:, None]
    observers = {
        label: made_up(kind, x + size * noise + np.exp(-2 * t)[:, None])
        for label, kind, size in (("SHGO", "shgo", 0.2), ("FHGO", "fhgo1", 0.01))
    }
    k = np.arange(0, end + period / 2, period)
    samples = Measurements(k, k[:, None], np.sin(k + shift)[:, None] + 0.1)
    units = {"time": "s"}
    return Result(
        name=name, title="made up", time=t, x=x, u=x[:, :0], y=x[:, :1], states=("x1", "x2"), inputs=(),
        outputs=("x1",), units=units, measurements=samples, observers=observers, config="", resolved="", seed=0,
    )  # fmt: skip


A, B = run("a"), run("b", end=12.0, step=0.02, period=0.25)
SHIFTED = run("c", shift=0.5)
VALUES = np.logspace(-3, -1, 5)
SCALED = ScalingData(
    "sweep",
    "x2",
    "eps",
    VALUES,
    {
        "SHGO": ScaledObserver("shgo", None, 3 * VALUES, 3.1 * VALUES),
        "FHGO II": ScaledObserver("fhgo2", 2, np.array([np.nan, 0.0, 2.0, 3.0, 5.0]), VALUES**3),
    },
)


def legend(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


# Runs


@pytest.mark.costly
def test_a_panel_of_one_run_shows_its_truth_measurements_and_observers() -> None:
    first, second = draw([A, B], block({"state": "x1", "run": "b", "measurements": True}, {"output": "x1"})).axes
    assert set(lines(first)) == {"true", "measured", "SHGO", "FHGO"}
    assert np.array_equal(lines(first)["true"].get_xdata(), B.time)
    assert np.array_equal(lines(first)["measured"].get_xdata(), B.measurements.time)
    assert np.array_equal(lines(first)["SHGO"].get_ydata(), B.observers["SHGO"].xhat[:, 0])
    assert set(lines(second)) == {"true", "a: measured", "b: measured"}
    markers = {lines(second)[f"{name}: measured"].get_marker() for name in "ab"}
    assert len(markers) == 2


@pytest.mark.costly
def test_each_panel_lasts_as_long_as_its_run() -> None:
    ends = [ax.get_xlim() for ax in draw([A, B], block({"state": "x1", "run": "a"}, {"error": "x1", "run": "b"})).axes]
    assert ends == [(0, 10), (0, 12)]
    shared = draw([A, B], block({"state": "x1"}, {"error": "x1"})).axes
    assert [ax.get_xlim() for ax in shared] == [(0, 12)] * 2


@pytest.mark.costly
def test_labels_say_the_run_only_where_the_figure_shows_several() -> None:
    one = draw([A, B], block({"state": "x1", "observers": ["a/SHGO"]}, {"state": "x1", "observers": ["b/FHGO"]}))
    assert legend(one) == ["true"]  # the panels' titles name them
    assert [ax.get_title(loc="left") for ax in one.axes] == ["SHGO", "FHGO"]
    both = draw([A, B], block({"state": "x1", "run": "a"}, {"state": "x1", "observers": ["b/FHGO"]}))
    assert legend(both) == ["true", "SHGO", "a: FHGO"]
    assert both.axes[1].get_title(loc="left") == "b: FHGO"
    keys = {"FHGO": "filtered", "b/FHGO": r"filtered, $T_e = 0.25$"}
    named = draw([A, B], block({"state": "x1", "observers": ["SHGO", "FHGO"]}, labels=keys))
    assert legend(named) == ["true", "a: SHGO", "filtered", "b: SHGO", r"filtered, $T_e = 0.25$"]


@pytest.mark.costly
def test_observers_of_one_text_and_look_are_one_entry() -> None:
    panels = [{"state": "x1", "observers": [f"{name}/SHGO"]} for name in "ab"]
    figure = draw([A, B], block(*panels, labels={"SHGO": "standard"}))
    assert legend(figure) == ["true", "standard"]
    looks = {(line.get_color(), line.get_linestyle()) for ax in figure.axes for line in [lines(ax)["standard"]]}
    assert looks == {(family_colour("shgo", None), "-")}


def test_a_truth_is_drawn_once_whatever_the_grids_and_lengths_of_the_runs() -> None:
    rounded = replace(B, x=B.x * (1 + 1e-9))
    ax = draw([A, rounded], block({"state": "x1"})).axes[0]
    (truth,) = (line for line in ax.lines if line.get_label() == "true")
    assert np.asarray(truth.get_xdata())[-1] == 12  # of the longer run


@pytest.mark.costly
def test_truths_that_differ_look_different_where_they_meet() -> None:
    for figure in (draw([A, SHIFTED], block({"state": "x1"})), comparison([A, SHIFTED])):
        shown = lines(figure.axes[0])
        assert legend(figure)[:2] == ["a: true", "c: true"]
        assert to_rgb(shown["a: true"].get_color()) == (0, 0, 0)
        assert to_rgb(shown["c: true"].get_color()) != (0, 0, 0)
        assert shown["c: true"].is_dashed()
    apart = draw([A, SHIFTED], block({"state": "x1", "run": "a"}, {"state": "x1", "run": "c"}))
    assert [lines(ax)["true"].get_color() for ax in apart.axes] == [TRUTH["color"]] * 2


# Panels


def test_a_magnitude_is_the_largest_error_nearby_on_a_logarithmic_axis() -> None:
    whole, part = draw(A, block({"magnitude": "x2"}, {"magnitude": "x2", "window": [5, 6], "observers": ["SHGO"]})).axes
    assert whole.get_yscale() == "log"
    assert whole.get_ylabel() == r"$|\hat{x}_{2} - x_{2}|$"
    assert whole.get_title(loc="left") == "largest error in a moving window of 0.1 s"
    error = np.abs(A.observers["SHGO"].xhat[:, 1] - A.x[:, 1])
    drawn = lines(whole)["SHGO"].get_ydata()
    assert np.array_equal(drawn, [error[max(i - 5, 0) : i + 6].max() for i in range(error.size)])
    assert lines(part)["SHGO"].get_ydata().max() < 0.3  # the transient is outside
    assert "true" not in lines(whole)


@pytest.mark.costly
def test_columns_fill_row_after_row() -> None:
    panels = [{"state": "x1"}, {"state": "x2"}, {"error": "x1"}, {"error": "x2"}, {"output": "x1"}]
    figure = draw(A, block(*panels, columns=2, width=7))
    boxes = [ax.get_position() for ax in figure.axes]
    assert len(boxes) == 5
    assert boxes[0].y0 == boxes[1].y0 > boxes[2].y0 == boxes[3].y0 > boxes[4].y0
    assert boxes[0].x0 == boxes[2].x0 == boxes[4].x0 < boxes[1].x0
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "", "", "time [s]", "time [s]"]
    shown = [any(t.get_visible() and t.get_text() for t in ax.get_xticklabels()) for ax in figure.axes]
    assert shown == [False, False, False, True, True]
    assert figure.get_figheight() == pytest.approx(3 * 2.2, abs=0.3)
    for a, b in combinations(figure.axes, 2):
        assert not outline(a).overlaps(outline(b))


def test_an_inset_shows_the_same_lines_in_its_window() -> None:
    inset = {"window": [4, 5], "place": [0.3, 0.1, 0.4, 0.3]}
    figure = draw(
        A, block({"state": "x1", "measurements": True, "inset": inset}, {"error": "x1", "inset": {"window": [4, 5]}})
    )
    ax = figure.axes[0]
    (inner,) = ax.child_axes
    assert set(lines(inner)) == set(lines(ax))
    for label, line in lines(inner).items():
        outer = lines(ax)[label]
        assert (line.get_color(), line.get_linestyle()) == (outer.get_color(), outer.get_linestyle())
        assert set(line.get_xdata()) <= set(outer.get_xdata())
    assert inner.get_xlim() == (4, 5)
    low, high = inner.get_ylim()
    inside = (A.time >= 4) & (A.time <= 5)
    xhat = A.observers["SHGO"].xhat[inside, 0]
    assert low < xhat.min() < xhat.max() < high < 0
    assert inner.get_ylabel() == inner.get_xlabel() == ""
    frame, panel = inner.get_position(), ax.get_position()
    assert (frame.x0 - panel.x0) / panel.width == pytest.approx(0.3)
    assert frame.height / panel.height == pytest.approx(0.3)
    for axes in figure.axes:  # its tick labels are inside the panel
        box, around = outline(cast(Axes, axes.child_axes[0])), axes.get_window_extent()
        assert around.x0 < box.x0 < box.x1 < around.x1
    assert len(legend(figure)) == 4
    given = draw(A, block({"state": "x1", "inset": {**inset, "limits": [-2, 2]}})).axes[0].child_axes[0]
    assert given.get_ylim() == (-2, 2)


# Scaling


def scaling(*extra: dict[str, Any], **keys: Any) -> Any:
    panel = {"scaling": {"state": "x2", **keys.pop("of", {})}, **keys}
    return draw([A], block(panel, *extra), scalings={0: SCALED})


@pytest.mark.costly
def test_a_scaling_panel_has_points_on_the_lines_of_theory() -> None:
    figure = scaling()
    (ax,) = figure.axes
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$\varepsilon$", r"amplitude of $\hat{x}_{2} - x_{2}$")
    shown = lines(ax)
    assert legend(figure) == ["measured", "theory", "SHGO", "FHGO II"]
    points = shown["SHGO"]
    assert points.get_linestyle() == "None"
    assert np.array_equal(points.get_xydata(), np.column_stack([VALUES, 3 * VALUES]))
    assert np.array_equal(shown["FHGO II"].get_ydata(), [2, 3, 5])  # logarithmic axes have no NaN and no 0
    assert shown["SHGO"].get_marker() != shown["FHGO II"].get_marker()
    assert shown["SHGO"].get_markersize() > 1.4 * shown["FHGO II"].get_markersize()  # which would hide it
    theory = [line for line in ax.lines if line.get_label() == "_theory"]
    assert np.array_equal(theory[0].get_ydata(), 3.1 * VALUES)
    for line, kind in zip(theory, (("shgo", None), ("fhgo2", 2)), strict=True):
        assert line.get_color() == family_colour(*kind)
        assert line.get_marker() == "None"
    assert shown["SHGO"].get_color() == family_colour("shgo", None)


@pytest.mark.costly
def test_scaling_without_theory_speaks_of_none() -> None:
    bare = {label: replace(o, theory=None) for label, o in SCALED.observers.items()}
    figure = draw([A], block({"scaling": {"state": "x2", "of": "rmse"}}), scalings={0: replace(SCALED, observers=bare)})
    assert legend(figure) == ["SHGO", "FHGO II"]
    assert figure.axes[0].get_ylabel() == r"rms of $\hat{x}_{2} - x_{2}$"
    alone = scaling(observers=["sweep/FHGO II"])
    assert legend(alone) == ["measured", "theory", "FHGO II"]


def test_scaling_stands_beside_other_panels_and_alone() -> None:
    figure = scaling({"state": "x1", "observers": ["SHGO"]})
    assert [ax.get_xscale() for ax in figure.axes] == ["log", "linear"]
    assert [ax.get_xlabel() for ax in figure.axes] == [r"$\varepsilon$", "time [s]"]
    assert {"sweep: SHGO", "FHGO II"} <= set(legend(figure))
    assert figure.axes[1].get_title(loc="left") == "a: SHGO"  # which names it
    alone = draw([], block({"scaling": {"state": "x2"}, "limits": [1e-4, 1]}), scalings={0: SCALED})
    assert alone.axes[0].get_ylim() == (1e-4, 1)
    with pytest.raises(ValueError, match="panel 1"):
        draw([A], block({"scaling": {"state": "x2"}}, {"scaling": {"state": "x2"}}), scalings={0: SCALED})


def test_linear_axes_show_what_is_not_positive_and_bars_where_seeds_lie() -> None:
    spread = np.array([[0.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, np.nan, 4.0]])
    observer = ScaledObserver("shgo", None, np.array([1.0, 2.0, 4.0]), spread=spread)
    data = ScalingData("sweep", "x2", "k", np.array([-1.0, 0.0, 1.0]), {"SHGO": observer})
    panel = {"state": "x2", "of": "rmse"}
    ax = draw([], block({"scaling": {**panel, "axes": "linear"}, "limits": [-1, 5]}), scalings={0: data}).axes[0]
    points = next(line for line in ax.lines if line.get_label() == "SHGO")
    assert (ax.get_xscale(), ax.get_ylim()) == ("linear", (-1, 5))
    np.testing.assert_array_equal(points.get_xdata(), [-1, 0, 1])
    bars: Any = ax.collections
    wide, narrow = (one.get_segments() for one in bars)
    assert [segment[:, 1].tolist() for segment in narrow[:2]] == [[0.5, 1.5], [1.5, 2.5]]
    for (_, low), (_, high) in (narrow[2], wide[2]):  # of the third one is lost
        assert low < 4 < 5 < high
    free = draw([], block({"scaling": {**panel, "axes": "linear"}}), scalings={0: data}).axes[0]
    assert free.get_ylim()[1] < 5
    assert [text.get_text() for text in free.texts] == ["1 of 9 estimates lost: they count as infinite"]
    ax = draw([], block({"scaling": panel}), scalings={0: data}).axes[0]
    assert [np.asarray(line.get_xdata()).tolist() for line in ax.lines if line.get_label() == "SHGO"] == [[1.0]]


# Refusals

NAMES = {
    "a": RunNames(("x1", "x2"), ("x1",), ("SHGO", "FHGO"), (0, 10)),
    "b": RunNames(("x1", "x2", "z"), ("x1",), ("SHGO", "deadbeat"), (0, 20)),
    "mc": RunNames(("x1", "x2"), ("x1",), ("SHGO",), (0, 10), "seeds"),
    "eps": RunNames(("x1", "x2"), ("x1",), ("SHGO", "FHGO"), (0, 10), "vary"),
    "ends": RunNames(("x1",), ("x1",), ("SHGO",), (0, 10), "seeds", one_grid=False),
}
INSET: dict[str, Any] = {"window": [1, 2]}


@pytest.mark.parametrize(
    ("panel", "key", "message"),
    [
        ({"magnitude": "x3"}, ["magnitude"], "no state is called 'x3'"),
        ({"state": "x1", "run": "d"}, ["run"], "no run is called 'd'. Known: a, b, mc, eps, ends"),
        ({"output": "x1", "run": "mc"}, ["output"], "no outputs"),
        ({"state": "x1", "run": "mc", "inset": INSET}, ["inset"], "has no inset"),
        ({"state": "x1", "run": "mc", "measurements": True}, ["measurements"], "has no measurements"),
        ({"state": "x1", "run": "mc", "observers": ["FHGO"]}, ["observers"], "in run 'mc'"),
        ({"state": "x1", "run": "mc", "window": [12, 13]}, ["window"], "lasts from 0 to 10"),
        ({"state": "x1", "run": "ends"}, ["run"], "no common grid"),
        ({"state": "x1", "run": "a", "members": "lines"}, ["members"], "a single run"),
        ({"state": "x1", "members": "bands"}, ["members"], "name it with run"),
        ({"scaling": {"state": "x1", "run": "eps"}, "members": "bands"}, ["members"], "median and bars"),
        ({"state": "z", "run": "a"}, ["state"], "no state in run 'a' is called 'z'"),
        ({"state": "z", "observers": ["a/SHGO"]}, ["state"], "no state is called 'z'"),
        ({"state": "x1", "observers": ["a/deadbeat"]}, ["observers"], "'a/deadbeat'. Did you mean `b/deadbeat`"),
        ({"state": "x1", "observers": ["eps/SHGO"]}, ["observers"], "no observer is called 'eps/SHGO'"),
        ({"state": "x1", "run": "a", "observers": ["b/SHGO"]}, ["observers"], "in run 'a'"),
        ({"state": "x1", "run": "a", "window": [12, 13]}, ["window"], "lasts from 0 to 10"),
        ({"magnitude": "x1", "measurements": True}, ["measurements"], "not with magnitude"),
        ({"magnitude": "x1", "limits": [0, 1]}, ["limits"], "> 0"),
        ({"scaling": {"state": "x3"}}, ["scaling", "state"], "no state in run 'eps'"),
        ({"scaling": {"state": "x1", "run": "a"}}, ["scaling", "run"], "'a' has no vary"),
        ({"scaling": {"state": "x1", "run": "epz"}}, ["scaling", "run"], "Did you mean `eps`"),
        ({"scaling": {"state": "x1", "of": "rms"}}, ["scaling", "of"], "Did you mean `rmse`"),
        ({"scaling": {"state": "x1"}, "run": "eps"}, ["run"], "inside scaling"),
        ({"scaling": {"state": "x1"}, "observers": ["deadbeat"]}, ["observers"], "in run 'eps'"),
        ({"scaling": {"state": "x1"}, "window": [0, 1]}, ["window"], "interval of time"),
        ({"scaling": {"state": "x1"}, "inset": INSET}, ["inset"], "interval of time"),
        ({"scaling": {"state": "x1"}, "limits": [-1, 1]}, ["limits"], "> 0"),
        ({"state": "x1", "inset": {"window": [2, 1]}}, ["inset", "window"], "from < to"),
        ({"state": "x1", "inset": {"window": [30, 31]}}, ["inset", "window"], "lasts from 0 to 20"),
        ({"state": "x1", "window": [4, 6], "inset": INSET}, ["inset", "window"], "the panel shows from 4 to 6"),
        ({"state": "x1", "inset": {**INSET, "limits": [1, 0]}}, ["inset", "limits"], "from < to"),
        ({"magnitude": "x1", "inset": {**INSET, "limits": [0, 1]}}, ["inset", "limits"], "> 0"),
        ({"state": "x1", "inset": {**INSET, "place": [0.7, 0.5, 0.4, 0.4]}}, ["inset", "place"], "inside it"),
        ({"state": "x1", "inset": {**INSET, "place": [0.7, 0.5, 0.05, 0.4]}}, ["inset", "place"], "0.1 wide"),
    ],
)
def test_wrong_panels_are_refused_before_any_run(panel: dict[str, Any], key: list[str], message: str) -> None:
    with pytest.raises(Problem) as caught:
        check({"f": block({"state": "x1"}, panel)}, NAMES)
    assert caught.value.path == ("figures", "f", "panels", 1, *key)
    assert message in caught.value.message


@pytest.mark.parametrize(
    "panel",
    [
        {"state": "z"},
        {"state": "z", "observers": ["SHGO"]},
        {"magnitude": "x1", "observers": ["b/deadbeat", "a/SHGO"], "inset": INSET, "limits": [1e-3, 1]},
        {"error": "x1", "run": "b", "observers": ["SHGO", "b/deadbeat"], "window": [12, 13]},
        {"scaling": {"state": "x1", "of": "hf"}, "observers": ["eps/SHGO", "FHGO"], "limits": [1e-3, 1]},
        {"scaling": {"state": "x1", "run": "eps"}, "title": "scaling"},
        {"state": "x1", "run": "mc", "members": "lines", "window": [2, 3]},
        {"magnitude": "x2", "run": "eps", "observers": ["SHGO", "eps/FHGO"]},
    ],
)
def test_right_panels_pass(panel: dict[str, Any]) -> None:
    check({"f": block(panel, labels={"SHGO": "a", "mc/SHGO": "b"})}, NAMES)


def test_scaling_needs_one_run_with_vary_or_its_name() -> None:
    figure = {"f": block({"scaling": {"state": "x1"}})}
    with pytest.raises(Problem, match="no run has vary") as caught:
        check(figure, {"a": NAMES["a"]})
    assert caught.value.path == ("figures", "f", "panels", 0, "scaling")
    with pytest.raises(Problem, match="several runs have vary: eps, theta"):
        check(figure, {**NAMES, "theta": NAMES["eps"]})
    with pytest.raises(Problem, match="no run has vary"):
        draw([A], figure["f"], "f")


def test_labels_are_of_observers_that_exist() -> None:
    for label in ("SHGU", "a/deadbeat"):
        with pytest.raises(Problem, match="no observer is called") as caught:
            check({"f": block({"state": "x1"}, labels={"SHGO": "one", label: "two"})}, NAMES)
        assert caught.value.path == ("figures", "f", "labels", label)


def test_columns_need_width_and_few_rows_little_height() -> None:
    panels = [{"state": "x1"}] * 6
    check({"f": block(*panels, columns=3, height=1.8)}, NAMES)
    for keys in ({"columns": 4}, {"columns": 1, "height": 1.8}):
        with pytest.raises(Problem, match="inches"):
            check({"f": block(*panels, **keys)}, NAMES)


# Files


def noisy(seed: int) -> Mapping[str, ObserverResult]:
    random = np.random.default_rng(seed)
    kinds = ("shgo", "fhgo1", "treangle", "low_power", "mine")
    return {kind: made_up(kind, A.x + random.standard_normal(A.x.shape)) for kind in kinds}


@pytest.mark.slow
def test_thumbnails_are_small_and_repeatable(tmp_path: Path) -> None:
    figure = block({"state": "x1"}, {"error": "x2"}, {"magnitude": "x2"}, title="noise")
    written = [thumbnail(draw(replace(A, observers=noisy(1)), figure), tmp_path / n / "1.2.png") for n in "ab"]
    assert [path.name for path in written] == ["1.2.png"] * 2
    first, second = (path.read_bytes() for path in written)
    assert first == second
    assert len(first) <= 40_000
    with Image.open(io.BytesIO(first)) as image:
        assert image.mode == "P"
        assert image.width in (6 * 90, 6 * 75)
        assert image.convert("RGB").getpixel((1, 1)) == (255, 255, 255)
    assert b"tEXt" not in first
    usual = thumbnail(draw(A, figure), tmp_path / "usual.png").read_bytes()
    assert int.from_bytes(usual[16:20]) == 6 * 90
    other = thumbnail(draw(replace(A, observers=noisy(2)), figure), tmp_path / "c.png")
    assert other.read_bytes() != first
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(HgorunError, match="cannot be written"):
        thumbnail(draw(A, figure), tmp_path / "file" / "1.png")


@pytest.mark.slow
def test_a_figure_drawn_twice_is_the_same_bytes(tmp_path: Path) -> None:
    """With columns, an inset, scaling and runs; saving once more, or in another format before, changes nothing."""
    figure = block(
        {"state": "x1", "inset": {"window": [4, 5]}}, {"scaling": {"state": "x2"}}, {"magnitude": "x2"}, columns=2
    )
    made = [draw([A, B], figure, scalings={1: SCALED}) for _ in range(2)]
    save(made[0], tmp_path / "a")
    save(made[0], tmp_path / "b", ("pdf", "png"))
    thumbnail(made[1], tmp_path / "small.png")
    save(made[1], tmp_path / "c")
    for suffix in ("png", "pdf"):
        contents = {(tmp_path / f"{name}.{suffix}").read_bytes() for name in "abc"}
        assert len(contents) == 1
