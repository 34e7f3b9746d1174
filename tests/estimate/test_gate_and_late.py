"""A gate and late samples that are gone back to: each is judged at its place in the order of measurement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import pendulum_filter
import pytest
from examples import Block, experiment
from pendulum_filter import corrected
from recordings import NOISE, PENDULUM, START, assessed_of, recorded_of, recording, signal, source

from hgorun.data.recording import Recording
from hgorun.engine.session import Mark, Session
from hgorun.estimate.estimate import estimate
from hgorun.estimate.gate import gated
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result

GATE = 3.0
EKF: Block = {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01, "initial": START}
SHGO: Block = {"type": "shgo", "theta": 2, "poles": -1, "late": "replay", "initial": START}
TAKEN = 0.1 * np.arange(1, 61)
RNG = np.random.default_rng(4)
VALUES = np.sin(TAKEN) + 0.02 * RNG.standard_normal(TAKEN.size)
VALUES[[17, 30, 31, 44]] += [1.5, -2.0, 0.9, 3.0]
VALUES[46:] += 0.15 * np.arange(1, 15)  # the pendulum is pushed
# every third is up to a second late, also outliers and samples that show that later ones are none
DELAYS = np.where(np.arange(TAKEN.size) % 3 == 0, 0.1 * RNG.integers(1, 11, TAKEN.size), 0.0)
DELAYS[46:51] = 0.55  # without these the ones behind look like outliers
END = 7.0


def log(delays: np.ndarray) -> Recording:
    return recording(signal("a", TAKEN, VALUES, TAKEN + delays, gate=GATE))


def found(block: Block, delays: np.ndarray) -> Result:
    config = {
        "time": {"start": 0.0, "end": END, "output_step": 0.5},
        "plant": PENDULUM,
        "observers": {"O": block},
        "measurement": {"noise": NOISE},
        "solver": {"step": 0.01},
    }
    return estimate(source(config), log(delays), sensitivity=False)


def used(result: Result) -> np.ndarray:
    """When the samples were taken that have been used."""
    one = recorded_of(result).outputs["a"]
    return np.sort(one.taken[one.used[:, 0]])


def flown(z: np.ndarray, span: float) -> np.ndarray:
    return pendulum_filter.flown(z, span, 0.01)


def filtered(samples: Sequence[tuple[float, float]], t: float) -> tuple[np.ndarray, list[float]]:
    """The filter at t of samples in the order in which they were taken, and when those were that it left out."""
    z, now, outliers = np.array([0.0, 1, 1, 0, 1]), 0.0, []
    for taken, y in samples:
        z, now = flown(z, taken - now), taken
        if abs(y - z[0]) > GATE * np.sqrt(z[2] + 0.01):
            outliers.append(taken)
        else:
            z = corrected(z, y)
    return flown(z, t - now) if t > now + 1e-9 else z, outliers


def known_by(t: float) -> list[tuple[float, float]]:
    known = t + 1e-9 >= TAKEN + DELAYS
    return list(zip(TAKEN[known].tolist(), VALUES[known].tolist(), strict=True))


@pytest.mark.costly
def test_a_filter_of_what_has_come_so_far_is_that_of_an_independent_simulator() -> None:
    result = found(EKF, DELAYS)
    for t, x in zip(result.time, result.observers["O"].xhat, strict=True):
        wanted, _ = filtered(known_by(float(t)), float(t))
        np.testing.assert_allclose(x, wanted[:2], rtol=0, atol=1e-6, err_msg=f"t = {t}")
    _, outliers = filtered(known_by(END), END)
    assert len(outliers) >= 4
    one = recorded_of(result).outputs["a"]
    np.testing.assert_allclose(np.sort(one.taken[~one.used[:, 0]]), outliers)
    assert assessed_of(result, "O").scores["gated"] == {"a": float(len(outliers))}


@pytest.mark.costly
def test_a_judgement_is_made_anew_when_an_older_sample_comes() -> None:
    """What looks like outliers may not, once the late samples in between have come."""
    judged = [set(filtered(known_by(t), t)[1]) for t in np.arange(0.5, END, 0.1)]
    assert any(before - after for before, after in pairwise(judged))


@pytest.mark.costly
@pytest.mark.parametrize("block", [EKF, SHGO], ids=["ekf", "shgo"])
def test_in_the_end_the_order_of_arrival_does_not_matter(block: Block) -> None:
    in_time = found(block, np.zeros_like(DELAYS))
    for delays in (DELAYS, np.where(np.arange(TAKEN.size) % 2 == 0, 0.8, 0.0)):
        late = found(block, delays)
        x = late.observers["O"].xhat[-1]
        np.testing.assert_allclose(x, in_time.observers["O"].xhat[-1], rtol=0, atol=1e-8)
        assert np.array_equal(used(late), used(in_time))
        assert used(late).size < TAKEN.size


def arrivals() -> Iterator[tuple[float, float, float]]:
    order = np.lexsort((TAKEN, TAKEN + DELAYS))
    yield from zip(TAKEN[order].tolist(), (TAKEN + DELAYS)[order].tolist(), VALUES[order].tolist(), strict=True)


@pytest.mark.costly
@pytest.mark.parametrize("block", [EKF, SHGO], ids=["ekf", "shgo"])
def test_a_stream_judges_alike_and_counts(block: Block) -> None:
    """Also one that is begun again from a checkpoint after every tenth sample."""
    measurement = {"noise": NOISE, "sampling": {"period": 0.1}}
    one = experiment(PENDULUM, {"O": block}, end=END, step=0.01, measurement=measurement)
    estimator = Estimator(one, gates={"a": GATE})
    for k, (taken, known, y) in enumerate(arrivals()):
        estimator.update(taken, {"a": y}, available=known)
        if k % 10 == 9:
            kept, estimator = estimator.checkpoint(), Estimator(one, gates={"a": GATE})
            estimator.restore(kept)
    whole = found(block, DELAYS)
    np.testing.assert_allclose(estimator.predict(END)["O"], whole.observers["O"].xhat[-1], atol=1e-8)
    assert estimator.gated == {"O": {"a": (TAKEN.size - used(whole).size, TAKEN.size)}}
    row = assessed_of(whole, "O").in_a_row["a"]
    assert estimator.gated_in_a_row == {"O": {"a": row.count}}
    left_out = np.isin(TAKEN, used(whole), invert=True)
    assert left_out[np.isclose(TAKEN, row.first).argmax() :][: row.count].all()


def test_samples_that_are_left_out_when_late_are_not_judged() -> None:
    result = found(EKF | {"late": "drop"}, DELAYS)
    in_time = [(t, y) for t, y, d in zip(TAKEN.tolist(), VALUES.tolist(), DELAYS.tolist(), strict=True) if d == 0]
    wanted, outliers = filtered(in_time, END)
    np.testing.assert_allclose(result.observers["O"].xhat[-1], wanted[:2], rtol=0, atol=1e-6)
    assert assessed_of(result, "O").scores["gated"] == {"a": float(len(outliers))}


@pytest.mark.costly
@pytest.mark.parametrize("most", [2, 64])
@pytest.mark.parametrize("block", [EKF, SHGO, SHGO | {"late": "innovation"}], ids=["ekf", "replay", "innovation"])
@pytest.mark.parametrize("delays", [0 * DELAYS, DELAYS], ids=["in time", "late"])
def test_samples_that_are_passed_at_once_are_judged_as_one_by_one(
    most: int, block: Block, delays: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gated, "_MOST", most)
    at_once = found(block, delays)
    monkeypatch.setattr(gated.GatedRun, "_pass", lambda *_: 0)
    one_by_one = found(block, delays)
    taken = used(one_by_one)
    assert not np.isin(TAKEN[[17, 30, 31, 44]], taken).any()
    assert 20 < taken.size < 57
    for name in ("used", "innovation"):
        both = [getattr(recorded_of(one).outputs["a"], name) for one in (at_once, one_by_one)]
        np.testing.assert_array_equal(*both)
    np.testing.assert_array_equal(at_once.observers["O"].xhat, one_by_one.observers["O"].xhat)


@pytest.mark.costly
def test_a_mark_keeps_few_of_the_samples_of_a_long_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those on their way, and those that are looked at together: it would else take the square of their number."""
    count = 1200
    taken, rng = 0.005 * np.arange(1, count + 1), np.random.default_rng(6)
    values = np.sin(taken) + 0.02 * rng.standard_normal(count)
    values[::40] += 5.0
    config = {
        "time": {"start": 0.0, "end": END, "output_step": 0.5},
        "plant": PENDULUM,
        "observers": {"O": {"type": "shgo", "theta": 2, "poles": -1, "initial": START}},
        "measurement": {"noise": NOISE},
        "solver": {"step": 0.01},
    }
    kept, mark = list[int](), Session.mark

    def spied(session: Session, stop: int) -> Mark:
        found = mark(session, stop)
        kept.append(sum(len(values) for _, values in found.slots))
        return found

    monkeypatch.setattr(Session, "mark", spied)
    late = recording(signal("a", taken, values, taken + 0.02 * rng.random(count), gate=5.0))
    result = estimate(source(config), late, sensitivity=False)
    assert set(taken[40::40]).isdisjoint(used(result))
    assert len(kept) > 50
    assert max(kept) < 300  # at most 64 places between two outliers, with the samples on their way
