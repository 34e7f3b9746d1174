"""Statistics of ensembles against numpy and scipy, used naively on the raw members."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from collected_files import write
from scipy import stats

from hgorun.ensemble.collected.collected import Collected
from hgorun.ensemble.collected.reading import read
from hgorun.ensemble.statistics.inference import holm
from hgorun.ensemble.statistics.points import points, thinned
from hgorun.ensemble.statistics.statistics import quantiles, statistics

SEEDS, OBSERVERS, STATES = 40, ("F", "S", "T"), ("x1", "x2")
DIVERGED, FAILED, INACCURATE = 2, 4, 1


@pytest.fixture(scope="module")
def raw() -> tuple[np.ndarray, np.ndarray]:
    """Metrics (theta, seed, observer, state) with noise in common, and statuses with failures among them."""
    random = np.random.default_rng(3)
    common = random.lognormal(size=(2, SEEDS, 1, 2))
    values = common + 0.05 * random.random((2, SEEDS, 3, 2)) + np.array([0.0, 0.05, 1.0])[:, None]
    status = np.zeros((2, SEEDS, 3), dtype=np.int8)
    status[0, 5, 1], status[1, 7, 1], status[0, 9, 2], status[0, 10, 0] = DIVERGED, FAILED, DIVERGED, INACCURATE
    values[np.isin(status, (DIVERGED, FAILED))] = np.inf
    return values, status


@pytest.fixture(scope="module")
def members(raw: tuple[np.ndarray, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Collected:
    path = tmp_path_factory.mktemp("statistics") / "made.sweep.h5"
    axes = {"theta": [2.0, 3.0], "seed": range(SEEDS)}
    return read(write(path, axes, {"rmse": raw[0]}, observers=OBSERVERS, states=STATES, status=raw[1]))


@pytest.fixture(scope="module")
def draws(members: Collected) -> Collected:
    """The same numbers, as if all members differed in their seeds alone."""
    return replace(members, axes={"seed": np.arange(2 * SEEDS)})


def test_what_was_chosen_is_not_taken_for_chance(members: Collected) -> None:
    """Neither a grid nor draws that members share make intervals; each value alone does."""
    found = statistics(members)
    assert (found.pooled, found.independent) == (("theta",), False)
    assert all(np.isnan([s.sem, *s.ci95]).all() and np.isfinite(s.mean) for s in found.summaries.values())
    assert all(np.isnan([d.p, d.p_holm, *d.ci95]).all() and not d.significant for d in found.differences)
    for _, part in points(members, ["theta"]):
        assert statistics(part).independent
        assert all(np.isfinite(s.ci95).all() for s in statistics(part).summaries.values())
    drawn = replace(members, random=frozenset({"theta"}))
    assert (drawn.grid, drawn.shared) == ((), ("theta", "seed"))
    own = np.random.default_rng(1).random(2 * SEEDS)
    apart = replace(members, axes={"theta": own, "seed": np.arange(2 * SEEDS)}, random=frozenset({"theta"}))
    assert statistics(apart).independent


def test_summaries(raw: tuple[np.ndarray, np.ndarray], draws: Collected) -> None:
    found = statistics(draws)
    values, status = (part.reshape(2 * SEEDS, *part.shape[2:]) for part in raw)
    for i, label in enumerate(OBSERVERS):
        sound = status[:, i] <= INACCURATE
        assert found.failed(label) == int(np.sum(~sound))
        for j, state in enumerate(STATES):
            summary = found.summaries[label, "rmse", state]
            good = values[sound, i, j]
            assert summary.n == len(good)
            assert summary.mean == pytest.approx(np.mean(good), rel=1e-13)
            assert summary.sem == pytest.approx(stats.sem(good), rel=1e-12)
            low, high = stats.t.interval(0.95, len(good) - 1, loc=np.mean(good), scale=stats.sem(good))
            assert summary.ci95 == pytest.approx((low, high), rel=1e-12)
            for name, q in {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}.items():
                assert getattr(summary, name) == pytest.approx(np.quantile(values[:, i, j], q), rel=1e-12)
    assert found.counts == {"F": {"ok": 79, "inaccurate": 1}, "S": {"ok": 78, "diverged": 1, "failed": 1},
                            "T": {"ok": 79, "diverged": 1}}  # fmt: skip


def test_paired_differences(raw: tuple[np.ndarray, np.ndarray], draws: Collected) -> None:
    values, status = (part.reshape(2 * SEEDS, *part.shape[2:]) for part in raw)
    found = [d for d in statistics(draws).differences if d.state == "x2"]
    assert [(d.a, d.b) for d in found] == [("F", "S"), ("F", "T"), ("S", "T")]
    raw_p = []
    for d in found:
        a, b = OBSERVERS.index(d.a), OBSERVERS.index(d.b)
        both = np.all(status[:, [a, b]] <= INACCURATE, axis=1)
        one, other = values[both, a, 1], values[both, b, 1]
        test = stats.ttest_rel(one, other)
        assert d.n == int(both.sum())
        assert d.mean == pytest.approx(np.mean(one - other), rel=1e-12)
        assert d.p == pytest.approx(test.pvalue, rel=1e-9)
        interval = test.confidence_interval(0.95)
        assert d.ci95 == pytest.approx((interval.low, interval.high), rel=1e-9)
        raw_p.append(test.pvalue)
    ordered = sorted(raw_p)
    naive = [max(min((3 - k) * ordered[k], 1.0) for k in range(ordered.index(p) + 1)) for p in raw_p]
    assert [d.p_holm for d in found] == pytest.approx(naive, rel=1e-9)


def test_the_same_noise_makes_small_differences_significant(draws: Collected) -> None:
    """The observers differ by a twentieth of what the noise changes from seed to seed."""
    found = statistics(draws)
    first = found.differences[0]
    spread = found.summaries["F", "rmse", "x1"].half
    assert abs(first.mean) < spread
    assert first.significant


def test_points_divide_the_members(members: Collected) -> None:
    divided = list(points(members, ["theta"]))
    assert [at for at, _ in divided] == [{"theta": 2.0}, {"theta": 3.0}]
    assert [len(part) for _, part in divided] == [SEEDS, SEEDS]
    np.testing.assert_array_equal(
        np.concatenate([part.metrics["rmse"] for _, part in divided]), members.metrics["rmse"]
    )


def test_points_that_no_grid_has() -> None:
    """Every member is a point of its own: there is one for each, and not one for each pair of values."""
    size = 500
    random = np.random.default_rng(0)
    members = Collected(
        name="x",
        axes={
            "a": random.random(size),
            "b": random.random(size),
            "c": np.array(["u", "v"] * (size // 2), dtype=object),
        },
        observers=("F",),
        states=("x",),
        metrics={"sup": random.random((size, 1, 1))},
        status=np.zeros((size, 1), dtype=np.int8),
        error=np.full(size, "", dtype=object),
    )
    divided = list(points(members, ["a", "b", "c"]))
    assert [at["a"] for at, _ in divided] == sorted(members.axes["a"].tolist())
    assert all(len(part) == 1 and part.axes["c"][0] == at["c"] for at, part in divided)
    assert len(list(points(thinned(members, ["a", "b"], 60), ["a", "b"]))) <= 60
    assert [at for at, _ in points(members, ["c"])] == [{"c": "u"}, {"c": "v"}]
    assert [(at, len(part)) for at, part in points(members, [])] == [({}, size)]


def test_too_few_members_leave_the_uncertainty_open(members: Collected) -> None:
    one = np.zeros(len(members), dtype=bool)
    one[3] = True
    summary = statistics(members.where(one)).summaries["F", "rmse", "x1"]
    assert summary.n == 1
    assert summary.mean == members.metrics["rmse"][3, 0, 0]
    assert np.isnan([summary.sem, *summary.ci95]).all()
    none = statistics(members.where(~np.ones(len(members), dtype=bool))).summaries["F", "rmse", "x1"]
    assert none.n == 0
    assert np.isnan([none.mean, none.median]).all()


def test_lost_members_are_infinite_in_quantiles() -> None:
    values, sound = np.array([1.0, 2.0, 3.0, 99.0]), np.array([True, True, True, False])
    assert [float(q) for q in quantiles(values, sound, (0.0, 0.5, 0.75, 1.0))] == [1.0, 2.5, np.inf, np.inf]
    assert float(quantiles(values, ~sound, [0.5])[0]) == np.inf


def test_differences_without_scatter() -> None:
    """Equal observers do not differ; what is different by the same amount in every member does."""
    values = np.ones((5, 3, 1))
    values[:, 2] = 2.0
    members = Collected(
        name="x",
        axes={"seed": np.arange(5)},
        observers=("a", "b", "c"),
        states=("x",),
        metrics={"sup": values},
        status=np.zeros((5, 3), dtype=np.int8),
        error=np.full(5, "", dtype=object),
    )
    assert [(d.a, d.b, d.mean, d.p) for d in statistics(members).differences] == [
        ("a", "b", 0.0, 1.0), ("a", "c", -1.0, 0.0), ("b", "c", -1.0, 0.0)
    ]  # fmt: skip


@pytest.mark.parametrize("value", [0.1, 1 / 3, -7e-9, 0.0])
def test_without_chance_there_is_no_uncertainty(value: float) -> None:
    members = Collected(
        name="x",
        axes={"seed": np.arange(7)},
        observers=("a",),
        states=("x",),
        metrics={"sup": np.full((7, 1, 1), value)},
        status=np.zeros((7, 1), dtype=np.int8),
        error=np.full(7, "", dtype=object),
    )
    summary = statistics(members).summaries["a", "sup", "x"]
    assert (summary.mean, summary.sem, summary.ci95) == (value, 0.0, (value, value))


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([0.01, float("nan")])[0] == 0.01
    assert holm([]) == []
