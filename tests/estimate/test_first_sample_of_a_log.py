"""Observers that begin at the first sample of a log: an outlier is no start where a gate and the noise are stated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import Block, inline
from recordings import POLES, assessed_of, recorded_of, recording, signal, source
from scipy.integrate import solve_ivp

from hgorun.data.recording import Recording
from hgorun.errors import ConfigError
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.scores.shut_out import shut_out
from hgorun.estimate.start import left_at_start, starting
from hgorun.result.result import Result

PERIOD, COUNT, GATE, STD = 0.125, 24, 5.0, 0.02
TAKEN = PERIOD * np.arange(COUNT)
PENDULUM: Block = {key: x for key, x in inline({"a": "b", "b": "-sin(a)"}, "a").items() if key != "initial"}
GIVEN = {"a": 0.5, "b": 0.0}
OBSERVERS: Block = {
    "O": {"type": "shgo", **POLES},
    "F": {"type": "ekf", "Q": {"b": 0.01}, "internal": {"P": 0.1}},
    "G": {"type": "shgo", **POLES, "initial": GIVEN},
}


def values(outliers: dict[int, float]) -> np.ndarray:
    found = 0.5 * np.cos(TAKEN) + STD * np.random.default_rng(3).normal(size=COUNT)
    for k, size in outliers.items():
        found[k] += size
    return found


def estimated(
    y: np.ndarray,
    which: np.ndarray | None = None,
    observers: Block = OBSERVERS,
    solver: Block | None = None,
    **more: Any,
) -> Result:
    chosen = np.arange(COUNT) if which is None else which
    config = {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": PERIOD},
        "plant": {**PENDULUM, **more},
        "observers": observers,
        "solver": solver or {"step": PERIOD / 16},
    }
    log = recording(signal("a", TAKEN[chosen], y[chosen], gate=GATE, std=STD))
    return estimate(source(config), log, sensitivity=False)


@pytest.mark.parametrize("outliers", [{0: 0.5}, {1: 0.6}])
def test_the_estimate_is_that_of_a_log_without_the_outlier(outliers: dict[int, float]) -> None:
    """Of observers without a start; one that has one is as in a stream."""
    (k,) = outliers
    kept = np.delete(np.arange(COUNT), k)
    found, without, clean = estimated(values(outliers)), estimated(values(outliers), kept), estimated(values({}))
    used = recorded_of(found).outputs["a"].used
    assert used[k].tolist() == [False, False, True]
    assert assessed_of(found, "F").scores["gated"] == {"a": 1}
    for label in "OF":
        x, other = (one.observers[label].xhat for one in (found, without))
        if k == 0:  # where the log without it starts from the second sample
            assert x[0, 0] == pytest.approx(0.5, abs=2 * STD)
        else:
            np.testing.assert_allclose(x, other, rtol=0, atol=1e-9)
        errors = [np.abs(one.observers[label].xhat[8:, 0] - 0.5 * np.cos(TAKEN[8:])).max() for one in (found, clean)]
        assert errors[0] < errors[1] + STD


def test_of_two_outliers_neither_is_the_start() -> None:
    """With more samples in one row: b is measured, too, and its first sample is sound."""
    y, others = values({0: 3.0, 1: -2.0}), 0.02 * np.random.default_rng(1).normal(size=COUNT) - 0.5 * np.sin(TAKEN)
    log = recording(*(signal(name, TAKEN, v, gate=GATE, std=STD) for name, v in (("ya", y), ("yb", others))))
    config = {"plant": {**PENDULUM, "output": {"ya": "a", "yb": "b"}}, "observers": {"F": OBSERVERS["F"]}}
    found = estimate(source({**config, "solver": {"step": 0.01}}), log, sensitivity=False)
    assert found.observers["F"].xhat[0, 0] == pytest.approx(0.5, abs=3 * STD)
    assert recorded_of(found).outputs["ya"].used[:3, 0].tolist() == [False, False, True]
    assert recorded_of(found).outputs["yb"].used[:, 0].all()
    (told,) = found.remarks
    assert told.startswith("log.csv:2: ya: the first 2 are outliers beside the next samples: F leaves them out, and a ")
    assert f"starts from {found.observers['F'].xhat[0, 0]:.6g}, which these say, in place of {y[0]:g}" in told


def test_a_start_that_is_moved_and_an_outlier_that_is_used_are_told() -> None:
    y = values({0: 0.5})
    found = estimated(y)
    moved, used = found.remarks
    assert moved.startswith("log.csv:2: a: the first sample is an outlier beside the next samples: O, F leave it out")
    assert f"starts from {found.observers['O'].xhat[0, 0]:.6g}, which these say, in place of {y[0]:g}" in moved
    assert used.startswith(f"log.csv:2: a: {y[0]:g}, taken at 0, is an outlier beside the other first samples")
    assert "G uses it" in used


def test_one_of_few_samples_is_an_outlier_and_not_too_many_for_one() -> None:
    found = estimated(values({0: 3.0}), np.arange(4), {"O": OBSERVERS["O"]})
    (told,) = found.remarks
    assert "the first sample is an outlier" in told
    assert assessed_of(found, "O").scores["gated"] == {"a": 1}
    assert not any(shut_out(found))


def test_an_outlier_is_named_where_it_stands() -> None:
    """Not where a sample before the run has the same value, and in the part of the log that has it."""
    y = values({4: 0.5})
    y[1] = y[4]
    files = Path("one.csv"), Path("two.csv")
    one = replace(signal("a", TAKEN, y, gate=GATE, std=STD), sources=files, part=(np.arange(COUNT) > 3).astype(int))
    config = {"time": {"start": float(TAKEN[4])}, "plant": PENDULUM, "observers": OBSERVERS, "solver": {"step": 0.01}}
    found = estimate(source(config), recording(one), sensitivity=False)
    assert [words.partition(": a:")[0] for words in found.remarks[:2]] == ["two.csv:6", "two.csv:6"]


def test_the_start_is_looked_for_once_in_all_passes_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once where it is sought, and once in the run, whose steps are halved until they are short enough."""
    made, judged = list[PreparedEstimate](), starting.judged_start

    def counted(prepared: PreparedEstimate) -> Any:
        made.append(prepared)
        return judged(prepared)

    monkeypatch.setattr(left_at_start, "judged_start", counted)
    integration = estimated(values({0: 0.5}), solver={"accuracy": 1e-9}).integration
    assert integration is not None
    assert integration.evaluations is not None
    assert integration.evaluations > 10_000
    assert len(made) == 2


def test_outliers_among_the_first_samples_are_not_too_many_for_outliers() -> None:
    found = estimated(values({0: 3.0, 1: -2.0}), np.arange(8), {"O": OBSERVERS["O"]})
    (told,) = found.remarks
    assert "the first 2 are outliers beside the next samples" in told
    assert assessed_of(found, "O").scores["gated"] == {"a": 2}
    assert assessed_of(found, "O").outliers_at_start == {"a": 2}
    assert not any(shut_out(found))


@pytest.mark.parametrize("gravity", ["1", "1.5"])
def test_nothing_changes_where_the_first_samples_agree(gravity: str) -> None:
    """As without a gate that is so near, also where the model is somewhat wrong."""
    found = estimated(values({}), observers={"O": OBSERVERS["O"]}, dynamics={"a": "b", "b": f"-{gravity}*sin(a)"})
    assert not found.remarks
    assert found.observers["O"].xhat[0, 0] == values({})[0]
    assert recorded_of(found).outputs["a"].used.all()


@pytest.mark.parametrize(
    "more",
    [
        {"dynamics": {"a": "b", "b": "c", "c": "d", "d": "f", "f": "-f"}, "states": [*"abcdf"]},  # too many states
        {"dynamics": {"a": "b", "b": "exp(50*a*a)"}},  # leaves all bounds
    ],
)
def test_a_start_that_cannot_be_judged_is_the_first_sample(more: Block) -> None:
    y = values({0: 3.0})
    found = estimated(y, observers={"O": {**OBSERVERS["O"], "theta": 1}}, **more)
    assert found.observers["O"].xhat[0, 0] == y[0]


def test_what_cannot_run_is_refused_as_without_a_gate() -> None:
    with pytest.raises(ConfigError, match=r"solver.rtol: estimates of recorded data take steps that are fixed"):
        estimated(values({}), solver={"method": "dopri5", "rtol": 1e-6})


@pytest.mark.parametrize("std", [None, STD])
def test_a_gate_leaves_no_good_sample_out_behind_a_start_that_passes_through_the_first(std: float | None) -> None:
    """A chain of three that begins at the parabola through three samples: its errors are small there and then grow."""
    plant = {key: x for key, x in inline({"a": "b", "b": "c", "c": "-2*b"}, "a").items() if key != "initial"}
    config = {"plant": plant, "observers": {"O": OBSERVERS["O"]}, "solver": {"step": PERIOD / 16}}
    log = recording(signal("a", TAKEN, values({}), gate=GATE, std=std))
    found = estimate(source(config), replace(log, first_samples=3), sensitivity=False)
    one = recorded_of(found).outputs["a"]
    assert np.abs(one.innovation[:3]).max() < 0.1 * np.abs(one.innovation[3:8]).max()
    assert one.used.all()


def test_a_start_is_sought_for_a_model_that_is_no_number_at_zero() -> None:
    """Observers that are given no start do not begin at 0 meanwhile; a derivative that is infinite there is told."""
    level = np.where(np.arange(COUNT) == 0, 5.0, 1 + 0.01 * TAKEN)
    plant = {key: x for key, x in inline({"a": "1.01 - sqrt(a)"}, "a").items() if key != "initial"}
    config = {"plant": plant, "observers": {"F": {"type": "ekf", "Q": {"a": 0.01}}}, "solver": {"step": 0.01}}

    def start(y: np.ndarray, count: int) -> float:
        log = replace(recording(signal("a", TAKEN, y, gate=GATE, std=STD)), first_samples=count)
        return float(estimate(source(config), log, sensitivity=False).observers["F"].xhat[0, 0])

    assert start(level, 1) == pytest.approx(1.0, abs=0.02)
    assert start(level, 3) == pytest.approx(1.0, abs=0.02)
    config["observers"] = {"O": OBSERVERS["O"]}
    with pytest.raises(ConfigError, match="leaves all bounds"):
        start(np.where(np.arange(COUNT) == 0, 0.0, level), 3)


COUPLED: Block = {
    key: x
    for key, x in inline(
        {"a": "b", "b": "-20*sin(a) - 0.1*b + 5*(c - a)", "c": "d", "d": "-30*sin(c) + 5*(a - c) - 0.1*d"},
        {"y": "a", "z": "c"},
    ).items()
    if key != "initial"
}


@pytest.mark.parametrize("outlier", [0.0, 3.0])
def test_slow_samples_are_judged_no_later_than_fast_ones(outlier: float) -> None:
    """No fit knows the swings far ahead: good samples were taken for outliers, and the outlier for a good one."""

    def swing(t: float, x: np.ndarray) -> list[float]:
        a, b, c, d = x
        return [b, -20 * np.sin(a) - 0.1 * b + 5 * (c - a), d, -30 * np.sin(c) + 5 * (a - c) - 0.1 * d]

    fast, random = np.arange(0, 1200) / 16, np.random.default_rng(5)
    x = solve_ivp(swing, (0, 75), [1.0, 0.0, 0.5, 0.0], t_eval=fast, rtol=1e-9, atol=1e-9).y
    y, z = (x[k] + 0.02 * random.standard_normal(fast.size) for k in (0, 2))
    y[0] += outlier
    log = recording(signal("y", fast, y, gate=GATE, std=STD), signal("z", fast[::100], z[::100], gate=GATE, std=STD))
    ekf = {"type": "ekf", "Q": {"b": 0.01, "d": 0.01}}
    config = {"time": {"start": 0.0, "end": 75.0}, "plant": COUPLED, "observers": {"F": ekf}}
    found = estimate(source(config), log, sensitivity=False)
    assert assessed_of(found, "F").scores["gated"] == {"y": 1 if outlier else 0, "z": 0}


def two_rates(outlier: dict[int, float]) -> Recording:
    """A pendulum whose angle is measured often, and its speed three times in two swings."""
    fast, random = np.arange(64) / 4, np.random.default_rng(5)
    x = solve_ivp(lambda _, x: [x[1], -np.sin(x[0])], (0, 16), [0.8, 0.0], t_eval=fast, rtol=1e-10, atol=1e-12).y
    y, z = x[0] + STD * random.standard_normal(64), x[1, ::28] + STD * random.standard_normal(3)
    for k, size in outlier.items():
        z[k] += size
    return recording(signal("y", fast, y, gate=GATE, std=STD), signal("z", fast[::28], z, gate=GATE, std=STD))


TWO_RATES: Block = {
    "plant": {**PENDULUM, "output": {"y": "a", "z": "b"}},
    "observers": {"F": OBSERVERS["F"]},
    "solver": {"step": 1 / 32},
}


def start_of(log: Recording) -> list[float]:
    """Where the filter begins."""
    start = completed(source(TWO_RATES), log, "start", "").observers["F"].initial
    return [start["a"], start["b"]]


def test_an_outlier_of_a_slow_output_is_not_where_a_start_is_sought_from() -> None:
    """The fit to the others ended at a speed of 2, where it had begun."""
    assert start_of(replace(two_rates({0: 2.0}), first_samples=3)) == pytest.approx([0.8, 0.0], abs=3 * STD)


@pytest.mark.costly
@pytest.mark.parametrize("outlier", [{}, {0: 2.0}, {1: 2.0}, {2: -1.0}], ids=str)
def test_a_start_from_as_many_as_agree_is_that_of_the_fast_output(outlier: dict[int, float]) -> None:
    """It began with three samples of the slow one, too: an outlier among them turned the start, and was used."""
    log = replace(two_rates(outlier), first_samples="auto")
    assert start_of(log) == pytest.approx([0.8, 0.0], abs=3 * STD)
    found = estimate(source(TWO_RATES), log, sensitivity=False)
    assert np.flatnonzero(~recorded_of(found).outputs["z"].used[:, 0]).tolist() == list(outlier)
