"""Figures: what is drawn, that it can be told apart, that files are whole and repeatable."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from drawn import block, lines, outline
from examples import run
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from hgorun import ConfigError, HgorunError, Result
from hgorun.errors import Problem
from hgorun.figures.data import Curve, moving_maximum, state_limits, thinned
from hgorun.figures.drawing import comparison, draw
from hgorun.figures.files import save
from hgorun.figures.looks import family_colour
from hgorun.figures.names import RunNames, check
from hgorun.result.records.data import Measurements
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.status import OK, Verdict

CONFIG: dict[str, Any] = {
    "title": "Contois, sampled",
    "time": {"end": 6, "output_step": 0.02, "unit": "h"},
    "plant": {
        "type": "contois",
        "parameters": {"mu": 1.064, "k_c": 4.39, "s_in": 20},
        "inputs": {"D": "mu*(1 - abs(sin(t))/2)"},
        "initial": {"x1": 1.5, "x2": 15},
    },
    "measurement": {
        "sampling": {"period": 0.25},
        "noise": [{"type": "sinusoids", "terms": [{"amplitude": 0.5, "omega": 11.938}]}],
    },
    "observers": {
        "SHGO": {"type": "shgo", "theta": 1, "initial": {"x1": 1, "x2": 14}},
        "FHGO r=1": {"type": "fhgo2", "theta": 2, "r": 1, "initial": {"x1": 1, "x2": 14}},
        "FHGO r=2": {"type": "fhgo2", "theta": 2, "r": 2, "initial": {"x1": 1, "x2": 14}},
    },
    "solver": {"method": "rk4", "step": 0.01},
}
SAMPLES = 25  # 0, 0.25, ..., 6


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return run(tmp_path_factory.mktemp("figures"), CONFIG)


@pytest.fixture(scope="module")
def compared(result: Result) -> Any:
    return comparison([result])


def with_observers(result: Result, **estimates: np.ndarray) -> Result:
    """The same run with estimates of x made up; where one ends in NaN it has diverged."""
    observers = {}
    for label, xhat in estimates.items():
        lost = np.flatnonzero(~np.isfinite(xhat[:, 0]))
        verdict = Verdict("diverged", float(result.time[lost[0]])) if lost.size else OK
        observers[label] = ObserverResult(type="shgo", xhat=xhat, internal={}, gains={}, dimension=2, verdict=verdict)
    return replace(result, observers=observers)


def diverging(result: Result) -> np.ndarray:
    xhat = result.x + 1e6 * np.exp(20 * (result.time - 3))[:, None]
    xhat[result.time >= 3] = np.nan
    return xhat


# What is drawn


@pytest.mark.costly
def test_a_comparison_shows_every_state_and_its_error_for_every_observer(result: Result, compared: Any) -> None:
    assert len(compared.axes) == 4
    for i, ax in enumerate(compared.axes):
        assert set(lines(ax)) == {*result.observers, *(["true"] if i % 2 == 0 else [])}
        assert ax.get_yscale() == ("linear" if i % 2 == 0 else "log")
    assert compared.axes[0].get_ylabel() == r"$x_{1},\ \hat{x}_{1}$ [g/L]"
    assert compared.axes[3].get_ylabel() == r"$|\hat{x}_{2} - x_{2}|$ [g/L]"
    assert compared.axes[3].get_xlabel() == "time [h]"
    assert compared.legends[0].get_title().get_text() == "Contois, sampled"


@pytest.mark.costly
def test_the_truth_is_black_dashed_and_on_top(compared: Any) -> None:
    for ax in compared.axes[::2]:
        truth = lines(ax)["true"]
        assert to_rgb(truth.get_color()) == (0, 0, 0)
        assert truth.is_dashed()
        assert truth.get_zorder() > max(line.get_zorder() for k, line in lines(ax).items() if k != "true")


@pytest.mark.costly
def test_lines_are_the_data(result: Result) -> None:
    ax, errors = draw(result, block({"state": "x2"}, {"error": "x2"})).axes
    assert np.array_equal(lines(ax)["true"].get_ydata(), result.x[:, 1])
    for label, observer in result.observers.items():
        assert np.array_equal(lines(ax)[label].get_ydata(), observer.xhat[:, 1])
        assert np.array_equal(lines(errors)[label].get_ydata(), observer.xhat[:, 1] - result.x[:, 1])


@pytest.mark.costly
def test_labels_of_several_results_say_which(result: Result) -> None:
    other = replace(result, name="other", observers=dict(list(result.observers.items())[:1]))
    ax = comparison([result, other, other]).axes[0]
    assert set(lines(ax)) == {
        "true",
        *(f"experiment: {label}" for label in result.observers),
        "other: SHGO",
        "other (2): SHGO",
    }
    assert sum(line.get_label() == "true" for line in ax.lines) == 1  # the same truth is drawn once
    picked = draw([result, other], block({"state": "x1", "observers": ["other/SHGO", "FHGO r=2"]})).axes[0]
    assert set(lines(picked)) == {"true", "SHGO", "FHGO r=2"}  # each of one run only
    both = draw([result, other], block({"state": "x1", "observers": ["SHGO"]}, {"state": "x2"})).axes[0]
    assert set(lines(both)) == {"true", "experiment: SHGO", "other: SHGO"}


@pytest.mark.costly
def test_samples_are_dots_and_continuous_measurements_lines(result: Result) -> None:
    dots = lines(draw(result, block({"output": "x1"})).axes[0])["measured"]
    assert dots.get_linestyle() == "None"
    assert dots.get_marker() == "o"
    assert np.array_equal(dots.get_xdata(), result.measurements.time)
    assert len(dots.get_xdata()) == SAMPLES
    t = result.time
    dense = replace(result, measurements=Measurements(t, t[:, None], result.y))
    line = lines(draw(dense, block({"state": "x1", "measurements": True})).axes[0])["measured"]
    assert line.get_linestyle() == "-"
    mixed_t = np.concatenate([t[t <= 2], [3.0, 4.0, 5.0]])
    mixed = Measurements(mixed_t, mixed_t[:, None], np.ones((mixed_t.size, 1)))
    drawn = draw(replace(result, measurements=mixed), block({"output": "x1"})).axes[0]
    assert sorted(
        (dot.get_marker(), len(np.asarray(dot.get_xdata()))) for dot in drawn.lines if dot.get_label() == "measured"
    ) == [
        ("None", int(np.sum(t <= 2))),
        ("o", 3),
    ]


def test_missing_samples_of_an_output_are_left_out(result: Result) -> None:
    y = result.measurements.y.copy()
    y[::2] = np.nan
    partial = replace(result, measurements=replace(result.measurements, y=y))
    assert len(lines(draw(partial, block({"output": "x1"})).axes[0])["measured"].get_xdata()) == SAMPLES // 2


@pytest.mark.costly
def test_window_limits_and_titles(result: Result) -> None:
    figure = draw(
        result,
        block(
            {"state": "x1", "window": [2, 3], "limits": [0, 5], "title": r"from $t = 2$"},
            {"state": "x2", "observers": ["SHGO"]},
            title="both",
        ),
    )
    first, second = figure.axes
    assert first.get_xlim() == (2, 3)
    assert first.get_ylim() == (0, 5)
    assert second.get_xlim() == (0, 6)
    assert first.get_title(loc="left") == r"from $t = 2$"
    assert second.get_title(loc="left") == "SHGO"  # panels differ, this one shows a single observer
    shown = lines(first)["SHGO"].get_xdata()
    assert shown[0] <= 2 <= shown[1]
    assert shown[-2] <= 3 <= shown[-1]
    assert figure.legends[0].get_title().get_text() == "both"


@pytest.mark.costly
def test_panels_of_one_state_have_one_range(result: Result) -> None:
    panels = [{"state": "x1", "observers": [label]} for label in result.observers]
    figure = draw(result, block(*panels, height=6, width=5))
    assert len({ax.get_ylim() for ax in figure.axes}) == 1
    assert tuple(figure.get_size_inches()) == (5, 6)
    ticks = [bool(ax.xaxis.get_label_text()) for ax in figure.axes]
    assert ticks == [False, False, True]


@pytest.mark.costly
def test_nothing_overlaps_the_panels(result: Result) -> None:
    figure = draw(result, block({"state": "x1", "title": "a panel"}, {"error": "x2"}, title="title " * 40))
    legend = figure.legends[0].get_window_extent()
    for ax in figure.axes:
        box = outline(ax)
        assert not legend.overlaps(box)
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.x1
    assert not outline(figure.axes[0]).overlaps(outline(figure.axes[1]))


# What can be told apart


@pytest.mark.costly
def test_the_filter_order_of_a_run_decides_the_colour(result: Result) -> None:
    assert [o.filter_order for o in result.observers.values()] == [None, 1, 2]
    shown = lines(draw(result, block({"state": "x1"})).axes[0])
    assert shown["FHGO r=1"].get_color() == family_colour("fhgo2", 1)
    assert shown["FHGO r=2"].get_color() == family_colour("fhgo2", 2)


@pytest.mark.costly
def test_an_observer_keeps_its_colour(result: Result, compared: Any) -> None:
    everywhere = lines(compared.axes[0])
    for label in result.observers:
        alone = lines(draw(result, block({"state": "x1", "observers": [label]})).axes[0])[label]
        assert alone.get_color() == everywhere[label].get_color()
        assert alone.get_linestyle() == everywhere[label].get_linestyle()


# Divergence and scale


@pytest.mark.costly
def test_a_diverged_observer_is_drawn_until_then_and_crushes_nothing(result: Result, compared: Any) -> None:
    sound = {label: o.xhat for label, o in result.observers.items()}
    both = with_observers(result, **sound, lost=diverging(result))
    for a, b in zip(compared.axes, comparison(both).axes, strict=True):
        assert "lost (diverged)" in lines(b)
        height = b.get_ylim()[1] / b.get_ylim()[0] if b.get_yscale() == "log" else np.ptp(b.get_ylim())
        usual = a.get_ylim()[1] / a.get_ylim()[0] if a.get_yscale() == "log" else np.ptp(a.get_ylim())
        assert height <= 1.5 * usual
        for line in b.lines:
            assert np.all(np.isfinite(line.get_ydata()))
        assert lines(b)["lost (diverged)"].get_xdata()[-1] < 3


def test_an_estimate_that_is_undefined_at_first_is_drawn_from_where_it_is_a_number(result: Result) -> None:
    late = result.x + 0.1
    late[:5] = np.inf
    observer = ObserverResult(
        type="levant", xhat=late, internal={}, gains={}, dimension=2, verdict=Verdict("undefined", 0.0)
    )
    drawn = lines(draw(replace(result, observers={"late": observer}), block({"state": "x1"})).axes[0])
    assert drawn["late (undefined)"].get_xdata()[0] == result.time[5]


@pytest.mark.costly
def test_one_wild_estimate_does_not_hide_the_rest(result: Result) -> None:
    noise = np.sin(40 * result.time)[:, None]
    wild = with_observers(result, good=result.x + 0.01 * noise, wild=result.x + 1e5 * noise)
    state, error = draw(wild, block({"state": "x1"}, {"error": "x1"})).axes
    assert np.ptp(state.get_ylim()) < 6 * np.ptp(result.x[:, 0])
    assert np.ptp(error.get_ylim()) < 1
    low, high = state.get_ylim()
    assert low < result.x[:, 0].min()
    assert high > result.x[:, 0].max()


@pytest.mark.costly
def test_estimates_that_are_close_are_shown_whole(result: Result, compared: Any) -> None:
    low, high = compared.axes[0].get_ylim()
    for observer in result.observers.values():
        assert low < observer.xhat[:, 0].min()
        assert high > observer.xhat[:, 0].max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        lambda r: replace(r, observers={}),
        lambda r: with_observers(r, exact=r.x.copy()),
        lambda r: with_observers(r, lost=np.full_like(r.x, np.nan)),
        lambda r: replace(with_observers(r, constant=np.ones_like(r.x)), x=np.ones_like(r.x)),
        lambda r: replace(r, units={}, title="", windows={}),
    ],
    ids=["none", "exact", "lost at once", "constant", "no units"],
)
@pytest.mark.measured("lost at once")
def test_degenerate_results_are_drawn(result: Result, make: Callable[[Result], Result]) -> None:
    made = make(result)
    assert len(comparison(made).axes) == 4
    assert len(draw(made, block({"error": "x2"}, {"output": "x1"})).axes) == 2


def test_an_empty_range_has_no_limits() -> None:
    assert state_limits([], [], []) is None


# Points


@given(st.integers(1, 3000), st.integers(6, 400), st.integers(0, 2**32 - 1))
def test_thinning_keeps_extremes_ends_and_order(count: int, most: int, seed: int) -> None:
    v = np.random.default_rng(seed).standard_normal(count)
    curve = Curve(np.arange(count, dtype=float), v)
    thin = thinned(curve, most)
    assert len(thin.t) <= max(most, 6) + 2
    assert np.all(np.diff(thin.t) > 0)
    assert np.array_equal(v[thin.t.astype(int)], thin.v)
    assert (thin.t[0], thin.t[-1]) == (0, count - 1)
    assert (thin.v.min(), thin.v.max()) == (v.min(), v.max())
    if count <= most:
        assert thin is curve


@given(st.integers(1, 60), st.integers(0, 70), st.integers(0, 2**32 - 1))
def test_the_moving_maximum_is_one(count: int, points: int, seed: int) -> None:
    v = np.random.default_rng(seed).standard_normal(count)
    half = points // 2
    expected = [v[max(i - half, 0) : i + half + 1].max() for i in range(count)]
    assert np.array_equal(moving_maximum(v, points), expected)


# Words


@pytest.mark.costly
@pytest.mark.parametrize("label", ["_hidden", "true", r"$\bad{$", "a\nb", "100 % & #1", "x" * 300, "観測器"])
def test_odd_labels_reach_the_legend(result: Result, label: str) -> None:
    odd = with_observers(result, **{label: result.x + 1, "other": result.x})
    figure = draw(odd, block({"state": "x1"}))
    assert len(figure.legends[0].get_texts()) == 3


# Refusals


@pytest.mark.parametrize(
    ("panel", "key", "message"),
    [
        ({"state": "x3"}, "state", "no state is called 'x3'. Did you mean `x"),
        ({"error": "y"}, "error", "no state is called 'y'. Known: x1, x2"),
        ({"output": "x2"}, "output", "no output is called 'x2'. Did you mean `x1`?"),
        ({"state": "x1", "observers": ["SHGO", "FHGO r=3"]}, "observers", "Did you mean `FHGO r="),
        ({"output": "x1", "observers": ["SHGO"]}, "observers", "measurements: true"),
        ({"state": "x2", "measurements": True}, "measurements", "no output is the state 'x2'"),
        ({"error": "x1", "measurements": True}, "measurements", "not with error"),
        ({"state": "x1", "window": [3, 2]}, "window", "from < to"),
        ({"state": "x1", "window": [7, 8]}, "window", "lasts from 0 to 6"),
        ({"state": "x1", "limits": [1, 1]}, "limits", "from < to"),
    ],
)
def test_wrong_panels_are_refused(result: Result, panel: dict[str, Any], key: str, message: str) -> None:
    names = RunNames(result.states, result.outputs, tuple(result.observers), (0, 6))
    wrong = {"good": block({"state": "x1"}), "3.9": block({"state": "x1"}, panel)}
    with pytest.raises(Problem) as caught:
        check(wrong, {"experiment": names})
    assert caught.value.path == ("figures", "3.9", "panels", 1, key)
    assert message in caught.value.message
    with pytest.raises(Problem) as caught:
        draw(result, wrong["3.9"], "3.9")
    assert caught.value.path == ("figures", "3.9", "panels", 1, key)


@pytest.mark.parametrize("name", ["", "../x", "a/b", "a\\b", ".hidden", "a\nb"])
def test_names_that_are_no_files_are_refused(name: str) -> None:
    with pytest.raises(Problem, match="name of its file"):
        check({name: block({"state": "x1"})}, {"run": RunNames(("x1",), (), ())})


@pytest.mark.parametrize("size", [{"width": 600}, {"width": 0.1}, {"height": 0.5}, {"height": 1000}])
def test_sizes_that_cannot_be_drawn_are_refused(size: dict[str, float]) -> None:
    with pytest.raises(Problem, match="inches") as caught:
        check({"a": block({"state": "x1"}, **size)}, {"run": RunNames(("x1",), (), ())})
    assert caught.value.path == ("figures", "a", *size)


def test_nothing_to_compare() -> None:
    with pytest.raises(ValueError, match="at least one"):
        comparison([])


# Files


@pytest.mark.costly
def test_files_are_named_after_the_figure_and_nothing_else_is_left(result: Result, tmp_path: Path) -> None:
    figure = draw(result, block({"state": "x1"}))
    written = save(figure, tmp_path / "new" / "3.10", ("png", "pdf", "svg"))
    assert [p.name for p in written] == ["3.10.png", "3.10.pdf", "3.10.svg"]
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == sorted(p.name for p in written)
    png, pdf, svg = (p.read_bytes() for p in written)
    assert png.startswith(b"\x89PNG")
    assert int.from_bytes(png[16:20]) == 6 * 300
    assert pdf.startswith(b"%PDF")
    assert b"<svg" in svg
    for content in (png, pdf, svg):
        assert not re.search(rb"Date|Software|Creator|Producer|matplotlib v", content)
    assert b"/Subtype /Image" not in pdf  # nothing is rasterised
    umask = os.umask(0)
    os.umask(umask)
    assert written[0].stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.slow
def test_equal_bytes_in_another_process(result: Result, tmp_path: Path) -> None:
    """Whatever the hash seed, the clock and the user's own settings of matplotlib."""
    save(draw(result, block({"state": "x1"}, {"error": "x2"})), tmp_path / "a")
    result.save(tmp_path / "r.h5")
    code = (
        "import hgorun, sys; from hgorun.config.models import Figure;"
        "from hgorun.figures.drawing import draw; from hgorun.figures.files import save;"
        "figure = Figure.model_validate({'panels': [{'state': 'x1'}, {'error': 'x2'}]});"
        "save(draw(hgorun.read(sys.argv[1]), figure), sys.argv[2]);"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    (tmp_path / "matplotlibrc").write_text("font.size: 20\naxes.grid: False\npdf.fonttype: 3\n")
    settings = {
        "MATPLOTLIBRC": str(tmp_path / "matplotlibrc"),
        "PYTHONHASHSEED": "2",
        "SOURCE_DATE_EPOCH": "0",
    }
    subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "r.h5"), str(tmp_path / "b")],
        env={**os.environ, **settings},
        check=True,
    )
    for suffix in ("png", "pdf"):
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


@pytest.mark.costly
def test_the_users_settings_are_left_alone(result: Result, tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    with matplotlib.rc_context({"font.size": 30.0, "axes.grid": False, "svg.hashsalt": "mine"}):
        save(draw(result, block({"state": "x1"})), tmp_path / "inside", ("svg",))
        assert matplotlib.rcParams["font.size"] == 30
    assert dict(matplotlib.rcParams) == before
    save(draw(result, block({"state": "x1"})), tmp_path / "outside", ("svg",))
    assert (tmp_path / "inside.svg").read_bytes() == (tmp_path / "outside.svg").read_bytes()


def test_a_file_that_cannot_be_written_leaves_nothing(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = draw(result, block({"state": "x1"}))
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(HgorunError, match="cannot be written"):
        save(figure, tmp_path / "file" / "figure")
    with pytest.raises(ConfigError, match="Known: png, pdf, svg"):
        save(figure, tmp_path / "figure", ("png", "bmp"))

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(figure, "savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(figure, tmp_path / "figure")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("number", [1e308, -1e308, np.inf, -np.inf, np.nan])
def test_numbers_that_no_axis_holds_are_refused(number: float, result: Result) -> None:
    x = result.x.copy()
    x[1] = number
    with pytest.raises(ConfigError, match="the truth cannot be drawn"):
        comparison(replace(result, x=x))
