"""Several outliers among the first samples, beside polynomials through the others: a chain passes along them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import inline
from recordings import recording, signal, source
from scipy.integrate import solve_ivp

from hgorun.estimate.completed import completed
from hgorun.estimate.prepared import prepare_estimate
from hgorun.estimate.start.starting import fit_of

STD, GATE, PERIOD = 0.01, 5.0, 0.1
Outliers = dict[int, float]


def measured(count: int, outliers: Outliers, bend: float = 0.0) -> np.ndarray:
    """1 - 2 t + bend t^2 with noise, some of it off by standard deviations."""
    t = PERIOD * np.arange(count)
    y = 1 - 2 * t + bend * t**2 + STD * np.random.default_rng(0).standard_normal(count)
    for k, size in outliers.items():
        y[k] += STD * size
    return y


def start_of(y: np.ndarray, states: int, first_samples: int, gate: float | None = GATE) -> list[float]:
    """Where an observer of a chain of so many integrators begins."""
    names = "abc"[:states]
    chain = dict(zip(names, [*names[1:], "0"], strict=True))
    plant = {key: value for key, value in inline(chain, "a").items() if key != "initial"}
    config = {"plant": plant, "observers": {"o": {"type": "shgo", "theta": 2}}, "solver": {"step": 0.01}}
    log = recording(signal("a", PERIOD * np.arange(y.size), y, std=STD, gate=gate))
    start = completed(source(config), replace(log, first_samples=first_samples), "start", "").observers["o"].initial
    return [start[name] for name in names]


def through(y: np.ndarray, states: int, left: Outliers) -> list[float]:
    """The polynomial that passes nearest to all but some."""
    kept = np.setdiff1d(np.arange(y.size), list(left))
    factors = [1.0, 1.0, 2.0]
    return [float(f * c) for f, c in zip(factors, np.polyfit(PERIOD * kept, y[kept], states - 1)[::-1], strict=False)]


@pytest.mark.parametrize(
    ("states", "count", "outliers"),
    [
        (2, 6, {0: 100.0, 1: 100.0}),
        (2, 6, {0: 1000.0, 1: -60.0}),
        (2, 6, {1: 60.0, 2: 60.0}),
        (2, 6, {0: 50.0, 5: 60.0}),
        (2, 6, {0: 15.0, 1: 15.0}),
        (2, 6, {0: 15.0, 1: -15.0}),
        (2, 6, {1: -20.0, 2: 25.0}),
        (3, 8, {0: 100.0, 1: 100.0}),
        (3, 8, {0: 200.0, 1: -200.0, 2: 200.0}),
        (3, 8, {2: 300.0, 3: 300.0, 7: 100.0}),
        (2, 12, {0: 50.0, 1: 50.0, 2: 50.0, 3: 50.0}),
    ],
)
def test_several_outliers_are_left_out_where_more_than_half_agree(states: int, count: int, outliers: Outliers) -> None:
    """Also where they are the first ones, and agree with each other: a fit of sizes passes through these."""
    y = measured(count, outliers)
    np.testing.assert_allclose(start_of(y, states, count), through(y, states, outliers), rtol=0, atol=1e-7)


@pytest.mark.parametrize(("count", "bend"), [*((6, bend) for bend in (0.5, 1, 2, 3, 4, 8, -16)), (16, 4.0)])
def test_what_a_model_lacks_is_no_outlier(count: int, bend: float) -> None:
    """It grows from sample to sample, so that some are beyond their gates and none is far beyond."""
    y = measured(count, {}, bend)
    assert start_of(y, 2, count) == start_of(y, 2, count, gate=None)


@pytest.mark.parametrize("count", [3, 6])
def test_four_alike_that_agree_with_each_other_do_not_agree_with_what_follows(count: int) -> None:
    outliers = dict.fromkeys(range(4), 100.0)
    y = measured(20, outliers)
    np.testing.assert_allclose(start_of(y, 2, count), through(y[: 4 + count], 2, outliers), rtol=0, atol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_slopes_at_a_fit_through_outliers_may_say_little(seed: int) -> None:
    """Two of six samples of a swing, of which two samples are a third."""
    t, random = 0.8 * np.arange(6), np.random.default_rng(seed)
    swing = solve_ivp(lambda _, x: [x[1], -np.sin(x[0]) - 0.1 * x[1]], (0, t[-1]), [1.0, -0.5], t_eval=t, rtol=1e-10)
    y = swing.y[0] + 0.02 * random.standard_normal(t.size)
    y[2:4] += 2.0
    plant = {key: x for key, x in inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a").items() if key != "initial"}
    config = {"plant": plant, "observers": {"o": {"type": "shgo", "theta": 1}}, "solver": {"step": 0.05}}
    log = replace(recording(signal("a", t, y, std=0.02, gate=GATE)), first_samples=6)
    start = completed(source(config), log, "start", "").observers["o"].initial
    assert (start["a"], start["b"]) == pytest.approx((1.0, -0.5), abs=0.1)


def test_where_half_disagree_nothing_is_left_out() -> None:
    y = measured(6, {0: 100.0, 1: 130.0, 2: 90.0})
    assert start_of(y, 2, 6) == start_of(y, 2, 6, gate=None)


def test_where_half_of_the_first_ones_disagree_more_are_looked_at() -> None:
    """And a fit to three is one to the three that follow."""
    outliers = {0: 100.0, 1: 130.0, 2: 90.0}
    y = measured(20, outliers)
    np.testing.assert_allclose(start_of(y, 2, 3), through(y[:6], 2, outliers), rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("states", "count", "outliers"),
    [
        (2, 6, {0: 100.0, 1: 130.0, 2: 90.0}),
        (2, 8, {0: 100.0, 1: 130.0, 2: 90.0, 3: 110.0}),
        (2, 8, {0: -100.0, 2: 130.0, 4: 90.0, 6: 110.0}),
        (2, 12, {0: 100.0, 2: -130.0, 4: 90.0, 6: -110.0, 8: 120.0, 10: -60.0}),
        (3, 8, {0: 200.0, 1: -250.0, 2: 200.0, 3: 300.0}),
    ],
)
def test_beside_any_number_of_first_ones_twice_as_many_are_looked_at(
    states: int, count: int, outliers: Outliers
) -> None:
    y = measured(4 * count, outliers)
    used = y[: count + len(outliers)]
    np.testing.assert_allclose(start_of(y, states, count), through(used, states, outliers), rtol=0, atol=1e-7)


def test_more_are_not_looked_at_where_they_do_not_agree_either() -> None:
    outliers = {0: 100.0, 1: 130.0, 2: 90.0}
    y = measured(24, outliers | {k: 200.0 * (k - 6) for k in range(6, 12)})
    assert start_of(y, 2, 6) == start_of(y[:6], 2, 6)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_pendulum_with_much_more_friction_loses_no_sample(seed: int) -> None:
    """Its first swing is far from that of the model; only two samples before a rest at once look like outliers."""
    t, random = 1.25 * np.arange(40), np.random.default_rng(seed)
    swing = solve_ivp(lambda _, x: [x[1], -np.sin(x[0]) - 1.1 * x[1]], (0, t[-1]), random.uniform(-1, 1, 2), t_eval=t)
    y = swing.y[0] + 0.02 * random.standard_normal(t.size)
    plant = {key: x for key, x in inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a").items() if key != "initial"}
    config = {"plant": plant, "observers": {"o": {"type": "shgo", "theta": 0.5}}, "solver": {"step": 0.05}}
    start = (
        completed(source(config), recording(signal("a", t, y, std=0.02, gate=GATE)), "start", "").observers["o"].initial
    )
    assert start == {"a": y[0]}


@pytest.mark.parametrize("seed", range(3))
def test_a_fit_that_is_nearest_only_beside_it_does_not_cost_a_good_sample(seed: int) -> None:
    """A pendulum that goes round: from rest the fit to all slips by a turn, and without one sample it is right."""
    t, random = 0.1 * np.arange(30), np.random.default_rng(seed)
    swing = solve_ivp(lambda _, x: [x[1], -np.sin(x[0]) - 0.02 * x[1]], (0, t[-1]), [3.1, 4.0], t_eval=t, rtol=1e-10)
    y = (swing.y[0] + 0.03 * random.standard_normal(t.size) + np.pi) % (2 * np.pi) - np.pi
    plant = {key: x for key, x in inline({"a": "b", "b": "-sin(a) - 0.02*b"}, "a").items() if key != "initial"}
    plant["output"] = {"y": {"value": "a", "period": "2*pi"}}
    config = {"plant": plant, "observers": {"o": {"type": "shgo", "theta": 3}}, "solver": {"step": 0.05}}
    log = recording(signal("y", t, y, std=0.03, gate=GATE))
    prepared = prepare_estimate(completed(source(config), replace(log, first_samples=10), "start", ""), log)
    found = fit_of(prepared, 10)
    assert found is not None
    assert found.x == pytest.approx([3.1, 4.0], abs=0.1)
    assert not any(left.size for left in found.left)


@pytest.mark.parametrize(("count", "outputs"), [(1, 1), (6, 1), (6, 2)])
def test_a_start_beside_an_outlier_is_no_turn_away(count: int, outputs: int) -> None:
    """The fit begins at the outlier, which lies behind the end of the range of an angle."""
    t, random = 0.1 * np.arange(12), np.random.default_rng(0)
    y = 3.0 + 0.3 * (1 - np.exp(-0.3 * t)) / 0.3 + STD * random.standard_normal(t.size)
    y[0] += 100 * STD
    plant = {key: x for key, x in inline({"a": "b", "b": "-0.3*b"}, "a").items() if key != "initial"}
    names = ["y", "z"][:outputs]
    plant["output"] = {name: {"value": "a", "period": "2*pi"} for name in names}
    config = {"plant": plant, "observers": {"o": {"type": "ekf", "Q": {"b": 1}}}, "solver": {"step": 0.05}}
    wrapped = (y + np.pi) % (2 * np.pi) - np.pi
    signals = [signal(name, t, wrapped, std=STD, gate=GATE) for name in names]
    log = replace(recording(*signals), first_samples=count)
    start = completed(source(config), log, "start", "").observers["o"].initial
    assert start["a"] == pytest.approx(3.0, abs=5 * STD)


@pytest.mark.parametrize(("names", "expected"), [(("y", "z"), -2.0), (("z", "y"), -2.0 + 2 * np.pi)])
@pytest.mark.parametrize("guess", [-2.0, 4.28])
def test_the_first_output_of_an_angle_says_which_turn_it_is(
    names: tuple[str, str], expected: float, guess: float
) -> None:
    t = 0.1 * np.arange(12)
    angle = -2.0 + 0.3 * t + STD * np.random.default_rng(0).standard_normal(t.size)
    values = {"y": angle, "z": angle % (2 * np.pi)}
    plant = {key: x for key, x in inline({"a": "b", "b": "0"}, "a").items() if key != "initial"}
    plant |= {"output": {name: {"value": "a", "period": "2*pi"} for name in names}, "initial": {"a": guess}}
    config = {"plant": plant, "observers": {"o": {"type": "ekf", "Q": {"b": 1}}}, "solver": {"step": 0.05}}
    log = replace(recording(*(signal(name, t, values[name], std=STD) for name in names)), first_samples=10)
    start = completed(source(config), log, "start", "").observers["o"].initial
    assert start["a"] == pytest.approx(expected, abs=0.05)
