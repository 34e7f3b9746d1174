"""Figures of ensembles: what is drawn are the numbers, computed naively from the members."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from drawn import luminance
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from hgorun.ensemble.collected.collected import Collected, Trajectories
from hgorun.ensemble.statistics.unmoved import said_of_hf
from hgorun.errors import ConfigError
from hgorun.figures.bands import bands, family
from hgorun.figures.data import moving_maximum
from hgorun.figures.ensemble import axis_label, limits, places
from hgorun.figures.ensembles import figures_of
from hgorun.figures.files import save
from hgorun.figures.fronts import front, words_of_lost_points
from hgorun.figures.layout import grid
from hgorun.figures.looks import family_colour
from hgorun.figures.maps import _short, heat_map
from hgorun.figures.page import STYLES, Page, on_page
from hgorun.figures.spread import against, boxes
from hgorun.figures.style import styled
from hgorun.figures.ticks import tick
from hgorun.tables.ensemble import compared, said_of_numbers

THETA, PERIOD = "observers.F.theta", "measurement.sampling.period"
THETAS, PERIODS, SEEDS = np.array([2.0, 4.0, 8.0, 16.0]), np.array([0.1, 0.2, 0.3]), np.arange(9)


def made(*, lost: bool = True) -> Collected:
    """Gains, periods and seeds; at the largest gain most members of S are lost."""
    random = np.random.default_rng(5)
    theta, period, seed = (grid.ravel() for grid in np.meshgrid(THETAS, PERIODS, SEEDS, indexing="ij"))
    size = theta.size
    noise = random.lognormal(sigma=0.2, size=(size, 2, 2))
    growing = noise * theta[:, None, None] * (1 + period[:, None, None])
    status = np.zeros((size, 2), dtype=np.int8)
    if lost:
        status[(theta == THETAS[-1]) & (seed > 2), 1] = 2
    metrics = {"hf": growing, "settling": 20 * noise / theta[:, None, None], "rmse": growing + 3}
    for values in metrics.values():
        values[status > 1] = np.inf
    time, followed = np.linspace(0, 5, 51), np.arange(0, size, 12)
    x = np.repeat(np.stack([np.sin(time), np.cos(time)], axis=-1)[None], followed.size, axis=0)
    decay = np.exp(-np.minimum(theta[followed], 5)[:, None, None, None] * time[:, None])
    xhat = x[:, None] + decay * random.normal(size=(followed.size, 2, 1, 2))
    return Collected(
        name="made",
        axes={THETA: theta, PERIOD: period, "seed": seed},
        observers=("F", "S"),
        states=("x1", "x2"),
        metrics=metrics,
        status=status,
        error=np.full(size, "", dtype=object),
        units={"time": "h", "x1": "g/L", "x2": "1"},
        families={"F": ("fhgo2", 2), "S": ("shgo", None)},
        planned=size,
        trajectories=Trajectories(member=followed, time=time, x=x, xhat=xhat),
    )


@pytest.mark.slow
def test_on_a_narrow_page_panels_stand_one_below_the_other() -> None:
    """The same panels with the same curves, half as wide."""
    pages = [dict(figures_of(made(), page=Page.named(width, "light"))) for width in ("two", "one")]
    assert pages[0].keys() == pages[1].keys() >= {"against-theta", "map-rmse", "front", "bands", "family-theta"}
    for wide, narrow in zip(pages[0].values(), pages[1].values(), strict=True):
        assert narrow.get_figwidth() == 3.5
        axes = [[ax for ax in figure.axes if ax.get_label() != "<colorbar>"] for figure in (wide, narrow)]
        drawn = [[[np.asarray(line.get_ydata()).tolist() for line in ax.lines] for ax in page] for page in axes]
        assert repr(drawn[0]) == repr(drawn[1])
        panels = [ax.get_position() for ax in axes[1]]
        assert all(upper.y0 > lower.y1 for upper, lower in pairwise(panels))
        assert all(0.4 < panel.width < 0.9 for panel in panels)


def lines(figure: Figure, panel: int, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Points of a line with a text in the legend."""
    line = next(line for line in figure.axes[panel].lines if line.get_label() == text)
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def caption(figure: Figure) -> str:
    """What stands above the legend, as one line."""
    return " ".join(figure.legends[0].get_title().get_text().split())


@pytest.mark.costly
def test_medians_against_an_axis() -> None:
    members = made()
    figure = against(members, THETA, ["hf", "settling"])
    x, y = lines(figure, 2, "F")  # second row, first column
    np.testing.assert_array_equal(x, THETAS)
    naive = [np.median(members.metrics["settling"][members.axes[THETA] == t, 0, 0]) for t in THETAS]
    np.testing.assert_allclose(y, naive, rtol=1e-12)
    assert figure.axes[2].get_ylabel() == "settling time of $\\hat{x}_{1} - x_{1}$ [h]\n(log scale)"
    assert figure.axes[2].get_xlabel() == "$\\theta$ of F (log scale)"
    assert figure.axes[0].get_xscale() == "log"


@pytest.mark.costly
def test_where_most_members_are_lost_the_median_ends() -> None:
    _, y = lines(against(made(), THETA, ["rmse"]), 0, "S")
    assert np.isfinite(y).tolist() == [True, True, True, False]


@pytest.mark.costly
def test_observers_have_their_colours_of_everywhere() -> None:
    figure = against(made(), THETA, ["rmse"])
    colours = {line.get_label(): line.get_color() for line in figure.axes[0].lines}
    assert colours["F"] == family_colour("fhgo2", 2)
    assert colours["S"] == family_colour("shgo", None)


@pytest.mark.costly
def test_cells_of_a_map_are_medians() -> None:
    members = made()
    figure = heat_map(members, (THETA, PERIOD), "hf")
    mesh = next(c for c in figure.axes[0].collections if isinstance(c, QuadMesh))
    drawn = np.asarray(mesh.get_array()).reshape(len(PERIODS), len(THETAS))
    here = (members.axes[THETA] == THETAS[2]) & (members.axes[PERIOD] == PERIODS[1])
    assert drawn[1, 2] == pytest.approx(np.median(members.metrics["hf"][here, 0, 0]), rel=1e-12)
    assert len(figure.axes[0].patches) == 0
    assert len(figure.axes[1].patches) == len(PERIODS)  # hatched: S is lost at the largest gain


@pytest.mark.costly
@pytest.mark.parametrize(
    ("seeds", "said"), [(1, "each cell is a member"), (2, "median of about 2 members in each cell")]
)
def test_a_map_counts_the_cells_that_have_members(seeds: int, said: str) -> None:
    """As while a sweep goes on: of twelve cells five have members, one each, or two but for one of them."""
    members = made(lost=False)
    first = np.arange(len(members)) < 5 * len(SEEDS)
    some = members.where(first & (members.axes["seed"] < seeds) & ((np.arange(len(members)) > 0) | (seeds == 1)))
    assert len(some) == 5 * seeds - (seeds > 1)
    assert said in caption(heat_map(some, (THETA, PERIOD), "hf"))


def test_nothing_is_said_of_lost_members_where_none_is() -> None:
    assert "lost" not in caption(against(made(lost=False), THETA, ["rmse"]))


def test_fronts_join_medians_over_seeds() -> None:
    members = made().where(made().axes[PERIOD] == PERIODS[0])
    x, y = lines(front(members, "hf", "settling"), 0, "F")
    assert np.all(np.diff(x) > 0)
    assert np.all(np.diff(y) < 0)
    here = members.axes[THETA] == THETAS[0]
    assert x[0] == pytest.approx(np.median(members.metrics["hf"][here, 0, 0]), rel=1e-12)


@pytest.mark.costly
def test_fronts_are_drawn_among_gains_alone() -> None:
    """What is no choice of the designer, such as the period, has a front for each of its values."""
    members = made(lost=False)
    figure = front(members, "hf", "settling")
    colour = family_colour("fhgo2", 2)
    joined = [
        line for line in figure.axes[0].lines if line.get_color() == colour and line.get_linestyle() not in ("None", "")
    ]
    joined = [line for line in joined if np.size(line.get_xdata())]
    assert len(joined) == len(PERIODS)
    for line, period in zip(joined, PERIODS, strict=True):
        of_period = [(members.axes[PERIOD] == period) & (members.axes[THETA] == theta) for theta in THETAS]
        allowed = [np.median(members.metrics["hf"][here, 0, 0]) for here in of_period]
        assert np.isin(np.round(np.asarray(line.get_xdata(), dtype=float), 12), np.round(allowed, 12)).all()
    assert "fronts at period [h] = 0.1; 0.2; 0.3" in caption(figure)
    fixed = replace(members, axes={"measurement.noise.0.std": members.axes[THETA], "seed": members.axes["seed"]})
    assert "front" not in [name for name, _ in figures_of(fixed)]


@pytest.mark.costly
def test_captions_say_over_what_is_pooled() -> None:
    members = made()
    assert "over all values of period [h]" in caption(against(members, THETA, ["hf"]))
    assert "over all values" not in caption(against(members.where(members.axes[PERIOD] == 0.1), THETA, ["hf"]))
    assert r"over all values of $\theta$ of F, period [h]" in caption(bands(members))
    assert "box 50 %, whiskers 90 %" in caption(boxes(members, ["hf"]))
    assert "hatched: most are lost" in caption(heat_map(members, (THETA, PERIOD), "hf"))


def test_nothing_is_drawn_where_all_are_lost() -> None:
    members = made()
    assert not list(figures_of(replace(members, status=np.full_like(members.status, 2))))


def test_boxes_tell_how_many_are_lost() -> None:
    members = made()
    figure = boxes(members.where(members.axes[THETA] == THETAS[-1]), ["hf"])
    assert [text.get_text() for text in figure.axes[0].texts] == ["18 lost"]
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["F", "S"]


def test_an_hf_that_says_nothing_is_told_where_it_is_drawn() -> None:
    members = made(lost=False)
    still = replace(members, metrics={**members.metrics, "hf": np.zeros_like(members.metrics["hf"])})
    why = "its moving mean is no longer than a step; set metrics.average"
    said = f"hf is 0 of all members, whatever their errors are: {why}"
    assert caption(front(still, "hf", "settling")).endswith(said)
    assert said not in caption(against(still, THETA, ["rmse"]))
    assert said_of_hf(still, ["rmse", "hf"]) == said
    assert said_of_hf(members, ["hf"]) == said_of_hf(still, ["rmse"]) == ""
    exact = replace(still, metrics={**still.metrics, "rmse": np.zeros_like(members.metrics["rmse"])})
    assert said_of_hf(exact, ["hf"]) == ""  # there is no error
    assert said_of_numbers(compared(still, [])) == [said]


def unsettled() -> Collected:
    """None is lost; at the smallest gain F never settles in x1, at the next one it does not in a third."""
    members = made(lost=False)
    theta, seed = members.axes[THETA], members.axes["seed"]
    settling = members.metrics["settling"].copy()
    settling[(theta == THETAS[0]) | ((theta == THETAS[1]) & (seed < 3)), 0, 0] = 40.0
    return replace(members, metrics={**members.metrics, "settling": settling}, end=40.0)


def test_times_that_never_come_are_no_points() -> None:
    members = unsettled()
    figure = against(members, THETA, ["settling"])
    colour = family_colour("fhgo2", 2)
    lines = [line for line in figure.axes[0].lines if line.get_color() == colour]
    crosses = [np.asarray(line.get_xdata()).tolist() for line in lines if line.get_marker() == "x"]
    assert crosses == [[THETAS[0]]]
    (median,) = (np.asarray(line.get_ydata(), dtype=float) for line in lines if line.get_marker() != "x")
    assert np.isnan(median).tolist() == [True, False, False, False]
    assert figure.axes[0].get_ylim()[1] < 40
    said = caption(figure)
    assert "estimates never settle in 36 of 108 members; their times count as infinite; bands leave the panel" in said
    assert "×: half or more never settle" in said
    assert "never" not in caption(against(members, THETA, ["hf"]))
    assert words_of_lost_points(members, ("hf", "settling")) == (
        "; there is no point where half or more of its members never settle"
    )
    assert words_of_lost_points(made(), ("hf", "settling")).endswith("half or more of its members are lost")
    assert not words_of_lost_points(made(lost=False), ("hf", "settling"))
    theta, seed = members.axes[THETA], members.axes["seed"]
    settling = members.metrics["settling"].copy()
    settling[theta == THETAS[0]] = 1.0
    settling[(theta == THETAS[0]) & (seed < 3), 0, 0] = 40.0
    status = members.status.copy()
    status[(theta == THETAS[0]) & (seed >= 7), 0] = 2
    some = replace(members, status=status, metrics={**members.metrics, "settling": settling})
    assert words_of_lost_points(some, ("hf", "settling")).endswith(
        "half or more of its members are lost or never settle"
    )
    assert not words_of_lost_points(some, ("hf",))


def test_boxes_and_maps_tell_of_times_that_never_come() -> None:
    members = unsettled()
    figure = boxes(members.where(members.axes[THETA] == THETAS[1]), ["settling", "hf"])
    assert [[text.get_text() for text in ax.texts] for ax in figure.axes[:4]] == [["9 never"], [], [], []]
    assert "; above a box how many members never settle: they count as infinite" in caption(figure)
    assert "above a box" not in caption(boxes(members, ["hf"]))
    assert "how many members are lost: they count" in caption(boxes(made(), ["hf"]))
    figure = heat_map(members, (THETA, PERIOD), "settling")
    assert len(figure.axes[0].patches) == len(PERIODS)
    assert "hatched: most never settle" in caption(figure)


@pytest.mark.costly
def test_a_front_has_no_point_where_half_never_settle() -> None:
    figure = front(unsettled(), "hf", "settling")
    x = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in figure.axes[0].lines])
    y = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in figure.axes[0].lines])
    seen = np.isfinite(x) & np.isfinite(y)
    assert y[seen].max() < 40
    assert "half or more of its members never settle" in caption(figure)


@pytest.mark.costly
@pytest.mark.parametrize(
    "draw", [lambda members: boxes(members, ["hf", "rmse"]), lambda members: against(members, THETA, ["hf", "rmse"])]
)
def test_panels_of_a_metric_are_logarithmic_together(draw: Callable[[Collected], Figure]) -> None:
    """Where one of them spans much, and all numbers can be shown so."""
    members = made(lost=False)
    narrow = members.metrics["rmse"] / 1e3 + 1
    wide = np.concatenate(
        [narrow[..., :1], np.geomspace(1, 100, len(members))[:, None, None] * narrow[..., 1:]], axis=-1
    )
    crossing = wide - 2.0
    for hf, scale in ((wide, "log"), (crossing, "linear")):
        figure = draw(replace(members, metrics={"hf": hf, "rmse": narrow}))
        assert [ax.get_yscale() for ax in figure.axes] == [scale, scale, "linear", "linear"]


@pytest.mark.costly
def test_bands_along_time() -> None:
    members = made()
    figure = bands(members)
    kept = members.trajectories
    assert kept is not None
    _, median = lines(figure, 0, "F")
    np.testing.assert_allclose(median, np.median(kept.xhat[:, 0, :, 0], axis=0), rtol=1e-12)
    _, error = lines(figure, 1, "F")  # of 51 points a window of a hundredth is the point itself
    assert figure.axes[1].get_title(loc="left") == "largest error in a moving window of 0.05 h"
    np.testing.assert_allclose(error, np.median(np.abs(kept.xhat - kept.x[:, None])[:, 0, :, 0], axis=0), rtol=1e-12)


def test_limits_of_bands_follow_from_observers_that_are_not_lost_in_all_members() -> None:
    """S swings to 1e9 and is lost; F has errors below 4, which are to be seen."""
    members = made()
    assert members.trajectories is not None
    xhat = members.trajectories.xhat.copy()
    xhat[:, 1] = 1e9 * (-1.0) ** np.arange(51)[:, None]
    xhat[:, 1, 30:] = np.nan
    states, errors, *_ = bands(replace(members, trajectories=replace(members.trajectories, xhat=xhat))).axes
    assert max(np.abs(states.get_ylim())) < 20
    assert errors.get_ylim()[1] < 20
    xhat[:, 0] = xhat[:, 1]
    errors = bands(replace(members, trajectories=replace(members.trajectories, xhat=xhat))).axes[1]
    assert errors.get_ylim()[1] > 1e8


@pytest.mark.costly
def test_few_members_are_lines_and_not_quantiles() -> None:
    members = made()
    kept = members.trajectories
    assert kept is not None
    few = replace(members, trajectories=replace(kept, member=kept.member[:5], x=kept.x[:5], xhat=kept.xhat[:5]))
    x, xhat = np.tile(kept.x, (3, 1, 1)), np.tile(kept.xhat, (3, 1, 1, 1))
    many = replace(members, trajectories=replace(kept, member=np.tile(kept.member, 3), x=x, xhat=xhat))
    for one, fills in ((many, True), (few, False)):
        figure = bands(one)
        assert bool(figure.axes[0].collections) == fills
        assert ("90 %" in caption(figure)) == fills
    assert "5 members, and their median" in caption(figure)
    own = [line for line in figure.axes[0].lines if line.get_color() == family_colour("fhgo2", 2)]
    assert len(own) == 6


def test_a_map_names_both_ends_of_its_axes() -> None:
    members = made()
    wide = replace(members, axes={THETA: np.arange(108.0) % 12, PERIOD: np.arange(108.0) // 12})
    shown = [label.get_text() for label in heat_map(wide, (THETA, PERIOD), "hf").axes[2].get_xticklabels()]
    assert (shown[0], shown[-1]) == ("0", "11")


def test_a_map_writes_numbers_as_axes_do() -> None:
    theta, period = (grid.ravel() for grid in np.meshgrid([50.0, 125.0, 200.0], [2e-5, 1e-3, 0.25], indexing="ij"))
    members = made()
    wide = replace(members, axes={THETA: np.tile(theta, 12), PERIOD: np.tile(period, 12)})
    axes = heat_map(wide, (THETA, PERIOD), "hf").axes
    assert [label.get_text() for label in axes[2].get_xticklabels()] == ["50", "125", "200"]
    assert [label.get_text() for label in axes[2].get_yticklabels()] == [r"$2 \times 10^{-5}$", "0.001", "0.25"]


@pytest.mark.costly
def test_labels_of_bars_do_not_touch() -> None:
    """Those of the rows, also where a metric has a long name."""
    members = replace(made(), units={"x1": "g/L", "x2": "g/L"})
    figure = heat_map(members, (THETA, PERIOD), "hf")
    bars = [ax for ax in figure.axes if ax.get_label() == "<colorbar>"]
    upper, lower = (bar.yaxis.label.get_window_extent() for bar in bars)
    assert upper.y0 - lower.y1 > 0.2 * figure.dpi


@pytest.mark.costly
def test_what_stands_on_colours_of_a_scale_is_read_on_every_page() -> None:
    """By the contrast that WCAG 2.2 asks of text, 4.5:1; the cells keep the colours of their bar."""
    for style in STYLES:
        ax = on_page(heat_map(made(), (THETA, PERIOD), "hf"), style).axes[0]
        mesh = next(c for c in ax.collections if isinstance(c, QuadMesh))
        found = {text.get_position(): text.get_color() for text in ax.texts}
        assert len(found) == len(PERIODS) * len(THETAS)
        for (row, column), value in np.ndenumerate(np.asarray(mesh.get_array()).reshape(len(PERIODS), len(THETAS))):
            here, text = (luminance(c) for c in (mesh.to_rgba(value), found[column + 0.5, row + 0.5]))
            assert (max(here, text) + 0.05) / (min(here, text) + 0.05) > 4.5


@pytest.mark.costly
def test_lines_of_a_family_have_the_colours_of_its_bar_on_every_page() -> None:
    for style in STYLES:
        figure = on_page(family(made(), THETA, page=Page(style=style)), style)
        bar = next(c for c in figure.axes[-1].collections if isinstance(c, QuadMesh))
        own = {to_hex(colour) for colour in bar.cmap(np.arange(len(THETAS)))}
        drawn = {to_hex(line.get_color()) for line in figure.axes[0].lines if line.get_label() != "true"}
        assert drawn == own
        if style == "dark":
            page = luminance(figure.get_facecolor())
            assert all((luminance(colour) + 0.05) / (page + 0.05) > 3 for colour in own)


@pytest.mark.costly
def test_a_family_has_a_line_for_every_member_that_was_kept() -> None:
    members = made()
    kept = members.trajectories
    assert kept is not None
    figure = family(members, THETA, observers=("F",))
    own = [line for line in figure.axes[0].lines if line.get_label() != "true"]
    assert len(own) == len(kept.member)
    assert len({line.get_color() for line in own}) == len(THETAS)
    assert figure.axes[-1].get_ylabel() == "$\\theta$ of F"  # the scale of colours


def test_trajectories_that_were_not_kept_are_not_drawn() -> None:
    with pytest.raises(ConfigError, match="no trajectories"):
        bands(replace(made(), trajectories=None))


@pytest.mark.measured
@pytest.mark.slow
def test_an_ensemble_has_the_figures_that_it_has_numbers_for(tmp_path: Path) -> None:
    members = made()
    names = [name for name, _ in figures_of(members)]
    assert names == [
        "against-theta", "against-period", "map-rmse", "map-hf", "front", "bands", "family-theta", "family-period"
    ]  # fmt: skip
    seeds = members.where((members.axes[THETA] == 2) & (members.axes[PERIOD] == 0.1))
    assert [name for name, _ in figures_of(replace(seeds, trajectories=None))] == ["boxes"]
    (name, figure), *_ = figures_of(seeds)
    assert save(figure, tmp_path / name, ["png"])[0].stat().st_size > 10_000


def test_text_on_an_axis_stands_side_by_side() -> None:
    members = made()
    kinds = np.where(members.axes[THETA] > 3, "fhgo2", "shgo").astype(object)
    figure = against(replace(members, axes={"observers.F.type": kinds}), "observers.F.type", ["rmse"])
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["shgo", "fhgo2"]


def test_many_values_are_put_into_bins() -> None:
    values = np.random.default_rng(0).random(1000)
    at, whose = places(values)
    assert len(at) == 16
    assert np.ptp(np.bincount(whose)) <= 1
    assert np.all(np.diff(at) > 0)


@pytest.mark.parametrize("high", [False, True])
def test_every_bin_has_members_also_where_many_have_one_value(high: bool) -> None:
    """The smallest or the largest, such as a limit that many draws are cut at."""
    values = np.random.default_rng(0).random(1000)
    values = np.minimum(values, 0.7) if high else np.maximum(values, 0.3)
    at, whose = places(values)
    counts = np.bincount(whose)
    assert len(at) == counts.size
    assert counts.min() > 0
    assert counts.max() >= 300
    assert np.all(np.diff(at) > 0)


def test_names_of_axes() -> None:
    assert axis_label("seed") == "seed"
    assert axis_label("observers.*.theta") == "$\\theta$"
    assert axis_label("measurement.noise.0.std") == "std of noise"
    assert axis_label("measurement.noise.0.std", {"time": "s", "measurement.noise.0.std": "m"}) == "std of noise [m]"
    of_phi = "measurement.outputs.phi"
    assert axis_label(f"{of_phi}.noise.0.std", {f"{of_phi}.noise.0.std": "rad"}) == r"std of noise of $\phi$ [rad]"
    assert axis_label(f"{of_phi}.delay", {"time": "h"}) == r"delay of $\phi$ [h]"
    assert axis_label(f"{of_phi}.sampling.dropout") == r"dropout of $\phi$"
    assert axis_label("measurement.phases.0.outputs.y1.sampling.period") == "period of $y_{1}$"
    assert axis_label("plant.parameters.mu_max") == "$\\mu_{\\mathrm{max}}$"


def test_numbers_in_cells_have_two_digits() -> None:
    values = (0.2, 1.0, 27.4, 10.0, 123.4, 0.0069999, 1e-7, 1e5, 0.0, 99.4, 99.6, -99.5, 9999.4, 9999.6)
    shown = ["0.20", "1.0", "27", "10", "123", "0.0070", "", "", "0.0", "99", "100", "-100", "9999", ""]
    assert [_short(value) for value in values] == shown


def test_the_largest_error_nearby_leaves_out_what_is_lost() -> None:
    values = np.array([[1.0, 5.0, 2.0, np.nan, np.inf], [0.0, 0.0, 0.0, 0.0, 3.0]])
    expected = [[5.0, 5.0, 5.0, np.nan, np.inf], [0.0, 0.0, 0.0, 3.0, 3.0]]
    np.testing.assert_array_equal(moving_maximum(values, 2), expected)
    np.testing.assert_array_equal(moving_maximum(values, 1), values)
    assert moving_maximum(values[:, :0], 3).shape == (2, 0)


def test_what_differs_by_roundings_is_drawn_as_equal_and_nothing_is_added_in_a_corner() -> None:
    assert limits(100.0, 100.0 + 1e-9, logarithmic=False) == pytest.approx((90, 110))
    with styled():
        figure, (ax,) = grid(1, 1, 3.0, 2.0, share=False)
        ax.set_ylim(limits(100.0002, 100.0009, logarithmic=False))
        tick(ax)
        figure.draw_without_rendering()
    assert ax.yaxis.get_offset_text().get_text() == ""
    assert "100.0004" in [label.get_text() for label in ax.get_yticklabels()]


@pytest.mark.costly
@pytest.mark.parametrize(
    "draw",
    [
        lambda members: against(members, THETA, ["hf"]),
        lambda members: boxes(members, ["hf"]),
        lambda members: front(members, "hf", "settling"),
        lambda members: heat_map(members, (THETA, PERIOD), "hf"),
        bands,
    ],
    ids=["against", "boxes", "front", "map", "bands"],
)
def test_logarithmic_axes_and_scales_of_colours_say_so_and_others_do_not(draw: Callable[[Collected], Figure]) -> None:
    scales = [
        (label, scale)
        for ax in draw(made(lost=False)).axes
        for label, scale in ((ax.get_xlabel(), ax.get_xscale()), (ax.get_ylabel(), ax.get_yscale()))
        if label
    ]
    assert "log" in [scale for _, scale in scales]
    assert ["(log scale)" in label for label, _ in scales] == [scale == "log" for _, scale in scales]


@pytest.mark.costly
def test_figures_name_their_ensemble_and_boxes_their_scales() -> None:
    """A metric has one scale in all panels."""
    members = made(lost=False)
    figure = boxes(members, ["hf", "rmse"])
    assert [ax.get_yscale() for ax in figure.axes] == ["log", "log", "log", "log"]
    narrow = {name: values if name == "hf" else 3 + 0.01 * values for name, values in members.metrics.items()}
    figure = boxes(replace(members, metrics=narrow), ["hf", "rmse"])
    assert [ax.get_yscale() for ax in figure.axes] == ["log", "log", "linear", "linear"]
    assert ["(log scale)" in ax.get_ylabel() for ax in figure.axes] == [True, True, False, False]
    assert caption(figure).startswith("made: median, box 50 %, whiskers 90 % of 108 members")
    titled = replace(members, title="Gains of F")
    assert caption(boxes(titled, ["hf"])).startswith("Gains of F: median")
    assert caption(family(members, THETA)) == "made"
