"""Members that are lost: which quantiles are infinite, what is drawn of these, and what is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from test_ensemble_figures import THETA, THETAS, caption, made

from hgorun.ensemble.collected.collected import Collected
from hgorun.figures.bands import bands as bands_along_time
from hgorun.figures.bands import family
from hgorun.figures.looks import Look, family_colour
from hgorun.figures.lost import bands, first_lost, mostly_lost, spread, within_sound, words_of_lost
from hgorun.figures.scaling import ScaledObserver, ScalingData, draw_scaling
from hgorun.figures.spread import against, boxes
from hgorun.figures.style import ENDLESS

SIZES = np.arange(1.0, 21.0)[:, None].repeat(4, axis=1)
FEW = np.arange(20)[:, None] < np.array([20, 18, 12, 6])  # of 20 members so many are left at each of four times


def lost_from(time: float, *, seeds: int) -> Collected:
    """Twenty-seven members along time, of which those with the first seeds lose S at a time."""
    members = made()
    kept = members.trajectories
    assert kept is not None
    member = np.arange(3 * len(kept.member))
    x, xhat = np.tile(kept.x, (3, 1, 1)), np.tile(kept.xhat, (3, 1, 1, 1))
    gone = member < seeds
    xhat[:seeds, 1, kept.time >= time] = np.nan
    status = members.status * 0
    status[member[gone], 1] = 2
    return replace(members, status=status, trajectories=replace(kept, member=member, x=x, xhat=xhat))


def test_sizes_that_are_lost_count_as_infinite() -> None:
    rows = spread(SIZES, FEW)
    np.testing.assert_allclose(rows[:, 0], np.quantile(SIZES[:, 0], [0.05, 0.25, 0.5, 0.75, 0.95]))
    assert np.isinf(rows).tolist() == [
        [False, False, False, False],
        [False, False, False, False],
        [False, False, False, True],
        [False, False, True, True],
        [False, True, True, True],
    ]
    assert mostly_lost(rows).tolist() == [False, False, False, True]
    assert first_lost(rows[:, [3, 3, 0, 3]]).tolist() == [True, False, False, True]


def test_estimates_that_are_lost_are_neither_above_nor_below() -> None:
    """Both ends of a band are infinite, and the median is that of the others, up or down alike."""
    values = SIZES - 7
    rows, mirrored = spread(values, FEW, signed=True), spread(-values, FEW, signed=True)
    np.testing.assert_array_equal(np.isposinf(rows[3:]), np.isneginf(rows[[1, 0]]))
    np.testing.assert_allclose(rows[2, :3], [np.median(values[:count, 0]) for count in (20, 18, 12)])
    assert np.isposinf(rows[2, 3])
    np.testing.assert_allclose(mirrored[[0, 1, 3, 4]], -rows[[4, 3, 1, 0]], rtol=1e-12)
    np.testing.assert_allclose(mirrored[2, :3], -rows[2, :3])


def test_numbers_that_axes_cannot_show_are_lost() -> None:
    assert np.isposinf(spread(np.array([1.0, 1e200, 1e200]), np.ones(3, dtype=bool))[2])


def test_a_band_leaves_its_panel_where_a_quantile_is_infinite() -> None:
    (low, high, _), (inner_low, inner_high, _) = bands(spread(SIZES, FEW), 20.0)
    assert np.isfinite(low).all()
    assert (high > 100 * SIZES.max()).tolist() == [False, True, True, True]
    assert (inner_high > 100 * SIZES.max()).tolist() == [False, False, True, True]
    assert np.isfinite(inner_low).all()


def test_a_band_without_ends_is_drawn_up_to_where_it_has_left() -> None:
    (low, high, _), _ = bands(spread(SIZES - 7, FEW, signed=True), 13.0)
    assert np.isnan(low).tolist() == np.isnan(high).tolist() == [False, False, True, True]
    assert low[1] < -1000 < 1000 < high[1]


def test_limits_follow_from_members_that_are_never_lost() -> None:
    values = np.ones((20, 3))
    values[:3, 1], values[:3, 2] = 1e30, np.nan
    rows = spread(values, np.isfinite(values))
    assert rows[4, 1] == 1e30
    assert within_sound(values, rows).max() == 1
    assert within_sound(values[:3], spread(values[:3], np.isfinite(values[:3]))).max() == 1e30


def test_a_cross_is_where_half_of_the_members_or_more_are_lost() -> None:
    members = made()
    figure = against(members, THETA, ["rmse"])
    colour = family_colour("shgo", None)
    crosses = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert [np.asarray(line.get_xdata()).tolist() for line in crosses] == [[THETAS[-1]]]
    assert crosses[0].get_color() == colour
    lost = int(np.sum(~members.sound.all(axis=1)))
    said = f"lost in {lost} of {len(members)} members and count as infinite; bands leave the panel there; ×: half or"
    assert said in caption(figure)


def with_small(factor: float) -> Collected:
    """The errors of S, which is lost in some members, are far below those of F."""
    members = made()
    lost = members.status[:, 1] > 1
    rmse = members.metrics["rmse"].copy()
    rmse[lost, 1] = np.inf
    rmse[~lost, 1] *= factor
    return replace(members, metrics={"rmse": rmse})


@pytest.mark.costly
def test_a_band_leaves_its_panel_beside_much_larger_numbers() -> None:
    for ax in against(with_small(1e-6), THETA, ["rmse"]).axes:
        paths = [path for band in ax.collections if band.get_gid() == ENDLESS for path in band.get_paths()]
        assert len(paths) == 2
        assert all(np.asarray(path.vertices)[:, 1].max() > ax.get_ylim()[1] for path in paths)


@pytest.mark.costly
@pytest.mark.parametrize("factor", [1e-6, 0.0])
def test_a_whisker_leaves_its_panel_beside_much_larger_numbers(factor: float) -> None:
    members = with_small(factor)
    for ax in boxes(members.where(members.axes[THETA] == THETAS[-1]), ["rmse"]).axes:
        highest = [np.max(line.get_ydata(), initial=0.0) for line in ax.lines]
        assert sum(y > ax.get_ylim()[1] for y in highest) == 3  # with its end and the median: most are lost


def test_a_bar_of_seeds_that_are_lost_leaves_the_panel_beside_much_larger_numbers() -> None:
    values, seeds = np.array([1.0, 2.0]), np.array([[1.0, 1.1, np.inf, np.inf], [1.0, 1.1, 1.2, 1.3]])
    small, large = (
        ScaledObserver("shgo", None, np.median(size * seeds, axis=1), spread=size * seeds) for size in (1e-7, 1.0)
    )
    data = ScalingData("run", "x1", "eps", values, {"small": small, "large": large})
    ax = Figure().add_subplot()
    draw_scaling(ax, data, {"small": 0, "large": 1}, {k: Look(str(k), "C0", "solid", "o") for k in range(2)}, "rmse")
    drawn = [np.asarray(path.vertices) for bars in ax.collections for path in bars.get_paths()]
    tops = [ends[1, 1] for ends in drawn if ends[0, 0] == 1.0]
    assert len(tops) == 4
    assert min(tops) > ax.get_ylim()[1]


def test_where_all_are_lost_no_band_leaves_the_panel() -> None:
    """Another value than those at which none is lost: there is nothing of a band there, and nothing is said of it."""
    members = made()
    status = members.status * 0
    status[members.axes[THETA] == THETAS[-1], 1] = 2
    said = caption(against(replace(members, status=status), THETA, ["rmse"]))
    assert "×: half or more are lost" in said
    assert "bands leave" not in said
    assert words_of_lost(np.ones((3, 2), dtype=bool), []) == ""


@pytest.mark.costly
@pytest.mark.parametrize(("seeds", "crossed"), [(6, []), (20, [3.0])])
def test_lost_members_along_time(seeds: int, crossed: list[float]) -> None:
    members = lost_from(2.95, seeds=seeds)
    figure = bands_along_time(members)
    for ax in figure.axes:
        crosses = [line for line in ax.lines if line.get_marker() == "x"]
        assert [at for line in crosses for at in np.asarray(line.get_xdata()).tolist()] == pytest.approx(crossed)
    said = caption(figure)
    assert f"{seeds} of 27 members and count as infinite, but not in medians of states; bands leave" in said
    assert ("×: half or more are lost from then on" in said) == bool(crossed)
    assert max(figure.axes[0].get_ylim()) < 20
    assert f"lines end where estimates are lost, in {seeds} of 27 members" in caption(family(members, "seed"))
