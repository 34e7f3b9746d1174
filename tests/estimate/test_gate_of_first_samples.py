"""Outliers among the first samples of an observer: which are left out, and which never."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examples import Block, inline
from recordings import POLES, assessed_of, recorded_of, recording, signal, source

from hgorun.data.recording import FirstSamples
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment

PERIOD, COUNT, GATE, STD = 0.125, 24, 5.0, 0.02  # exact times: a file and a stream make the same steps
TAKEN = PERIOD * np.arange(COUNT)
PLANT = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a")
NEAR, FAR = {"a": 0.5, "b": 0.0}, {"a": 3.0, "b": -6.0}  # 0.5 cos t is what is measured


def values(seed: int, outliers: dict[int, float]) -> np.ndarray:
    random = np.random.default_rng(seed)
    found = 0.5 * np.cos(TAKEN) + STD * random.normal(size=COUNT)
    for k, size in outliers.items():
        found[k] += size
    return found


def block(initial: dict[str, float]) -> Block:
    return {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": PERIOD},
        "plant": {**PLANT, "initial": initial},
        "observers": {"O": {"type": "shgo", **POLES, "initial": initial}},
        "measurement": {"sampling": {"period": PERIOD}},
        "solver": {"step": PERIOD / 16},
    }


def estimated(y: np.ndarray, initial: dict[str, float], std: float | None, gate: float | None = GATE) -> Result:
    log = recording(signal("a", TAKEN, y, gate=gate, std=std))
    return estimate(source(block(initial)), log, sensitivity=False)


def plain(innovations: np.ndarray, least: float) -> np.ndarray:
    """Which samples are used, from their innovations: the rule of the page, written down once more."""
    sizes, used = np.abs(innovations), np.ones(innovations.size, dtype=bool)
    for k in range(2, sizes.size):
        n = min(k, 61)
        scale = max(1.4826 * np.median(sizes[k - n : k]) * max(8 / n, 1), least)
        used[k] = sizes[k] <= GATE * scale or (scale == 0 and k < 8)
    return used


@pytest.mark.parametrize("std", [None, STD])
@pytest.mark.parametrize("outliers", [{}, {2: 10.0}, {4: -2.0, 6: 20.0}, {3: 0.5, 15: 4.0}], ids=str)
def test_outliers_among_the_first_are_left_out(outliers: dict[int, float], std: float | None) -> None:
    found = estimated(values(1, outliers), NEAR, std)
    one = recorded_of(found).outputs["a"]
    assert np.flatnonzero(~one.used[:, 0]).tolist() == list(outliers)
    assert np.array_equal(one.used[:, 0], plain(one.innovation[:, 0], std or 0.0))
    assert assessed_of(found, "O").scores["gated"] == {"a": len(outliers)}
    others = estimated(values(1, dict.fromkeys(outliers, 0.0)), NEAR, std)
    assert np.max(np.abs(found.observers["O"].xhat - others.observers["O"].xhat)) < 6 * STD


@pytest.mark.parametrize("std", [None, STD])
def test_a_start_far_from_the_truth_is_no_outlier(std: float | None) -> None:
    """All samples are used, as without a gate."""
    y = values(2, {})
    found, free = (estimated(y, FAR, std, gate) for gate in (GATE, None))
    assert np.all(recorded_of(found).outputs["a"].used)
    assert np.array_equal(found.observers["O"].xhat, free.observers["O"].xhat)


def test_an_output_that_rests_at_first_shuts_nothing_out() -> None:
    """Innovations that are zero, as of a coarse sensor at rest, say nothing of the noise."""
    y = np.where(np.arange(COUNT) < 5, 0.0, 0.1)
    found = estimated(y, {"a": 0.0, "b": 0.0}, None)
    one = recorded_of(found).outputs["a"]
    assert not np.any(one.innovation[:5])
    assert np.all(one.used[:8])
    assert np.array_equal(one.used[:, 0], plain(one.innovation[:, 0], 0.0))


@pytest.mark.parametrize("at", [2, 4, 7])
def test_a_stream_that_goes_on_from_a_checkpoint_judges_as_the_file(at: int) -> None:
    y = values(3, {3: 8.0, 6: -3.0})
    expected = estimated(y, NEAR, STD)
    experiment = Experiment(block(NEAR))
    estimators = [Estimator(experiment, gates={"a": GATE}, std={"a": STD}) for _ in range(2)]
    for k in range(COUNT):
        if k == at:
            estimators[1].restore(estimators[0].checkpoint())
        estimators[k >= at].update(float(TAKEN[k]), {"a": float(y[k])})
    assert np.array_equal(estimators[1].estimate()["O"], expected.observers["O"].xhat[-1])
    assert estimators[1].gated == {"O": {"a": (2, COUNT)}}


def test_the_first_two_are_used_whatever_they_are() -> None:
    one = recorded_of(estimated(values(4, {0: 9.0, 1: -9.0}), NEAR, STD)).outputs["a"]
    assert one.used[:2].tolist() == [[True], [True]]


OWN: dict[str, Block] = {
    "hgo_fd": {"eps": 0.4},
    "hgo_sa": {"eps": 0.4},
    "deadbeat": {},
    "reduced_sampled": {"H": 0.5},
}
FREE: Block = {"type": "shgo", **POLES}
LINE: Block = {key: value for key, value in PLANT.items() if key != "initial"}


@pytest.mark.parametrize(("outlier", "count"), [(0, "auto"), (1, 3)])
def test_what_a_fitted_start_has_left_out_is_not_used(outlier: int, count: FirstSamples) -> None:
    """The estimate is that of a log without the sample; an observer with a start of its own is as in a stream."""
    y, kept = values(3, {outlier: 0.6}), np.arange(COUNT) != outlier
    config = {key: value for key, value in block(NEAR).items() if key != "measurement"}
    config |= {"plant": LINE, "observers": {"O": FREE, "S": {**FREE, "initial": NEAR}}}

    def found(which: np.ndarray) -> Result:
        log = recording(signal("a", TAKEN[which], y[which], gate=GATE, std=STD))
        return estimate(source(config), replace(log, first_samples=count), sensitivity=False)

    result, others = found(np.ones(COUNT, dtype=bool)), found(kept)
    used, of_others = (recorded_of(one).outputs["a"].used for one in (result, others))
    assert not used[outlier, 0]
    assert used[outlier, 1]
    np.testing.assert_array_equal(used[kept, 0], of_others[:, 0])
    assert assessed_of(result, "O").scores["gated"] == {"a": 1 + np.count_nonzero(~of_others[:, 0])}
    np.testing.assert_allclose(result.observers["O"].xhat, others.observers["O"].xhat, rtol=0, atol=1e-9)


@pytest.mark.parametrize("outliers", [[0], [0, 1]], ids=str)
@pytest.mark.parametrize("kind", ["hgo_fd", "hgo_sa", "deadbeat", "reduced_sampled"])
def test_an_observer_that_steps_begins_behind_the_samples_that_the_start_has_left_out(
    kind: str, outliers: list[int]
) -> None:
    """Its first step leads from the first sample that it takes, as in a log without the others."""
    y, kept = values(3, {k: 2.0 * (-1) ** k for k in outliers}), np.delete(np.arange(COUNT), outliers)
    config = {key: value for key, value in block(NEAR).items() if key != "measurement"} | {"plant": LINE}

    def found(which: np.ndarray, count: FirstSamples, start: Block) -> Result:
        log = recording(signal("a", TAKEN[which], y[which], gate=GATE, std=STD))
        own = {**config, "observers": {"O": {"type": kind, **OWN[kind], **start}}}
        return estimate(source(own), replace(log, first_samples=count), sensitivity=False)

    result = found(np.arange(COUNT), 8, {})
    begins = result.observers["O"].xhat[0].tolist()
    others = found(kept, 1, {"initial": dict(zip("ab", begins, strict=True))})
    assert np.flatnonzero(~recorded_of(result).outputs["a"].used[:, 0]).tolist() == outliers
    there = np.isin(result.time, TAKEN[kept]), np.isin(others.time, TAKEN[kept])
    one, other = (run.observers["O"].xhat[where] for run, where in zip((result, others), there, strict=True))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


@pytest.mark.parametrize("outlier", [0, 2])
def test_a_start_that_is_given_is_none_at_the_samples_though_its_numbers_agree(outlier: int) -> None:
    """It has the measured state of a fitted one to the last digit, and is judged as any other: by the plain rule."""
    y = values(3, {outlier: 2.0})
    config = {key: value for key, value in block(NEAR).items() if key != "measurement"} | {"plant": LINE}

    def found(initial: dict[str, float]) -> Result:
        own = {**config, "observers": {"O": FREE, "S": {**FREE, "initial": initial}}}
        log = replace(recording(signal("a", TAKEN, y, gate=GATE, std=STD)), first_samples=8)
        return estimate(source(own), log, sensitivity=False)

    begins = float(found(NEAR).observers["O"].xhat[0, 0])
    result = found({"a": begins, "b": -3.0})
    one = recorded_of(result).outputs["a"]
    assert not one.used[outlier, 0]
    assert result.observers["S"].xhat[0, 0] == result.observers["O"].xhat[0, 0]
    np.testing.assert_array_equal(one.used[:, 1], plain(one.innovation[:, 1], STD))
    assert one.used[outlier, 1]


def test_a_given_start_with_the_number_of_a_sample_leaves_no_outlier_of_another_output_out() -> None:
    """Of a log that begins at rest the first sample is 0, as is many a given start: that says nothing of the rest."""
    ya, yb = STD * np.random.default_rng(1).normal(size=(2, COUNT))
    ya[0], yb[0] = 0.0, 1.0
    config = {key: value for key, value in block(NEAR).items() if key != "measurement"}
    config["plant"] = {**LINE, "output": {"ya": "a", "yb": "b"}}
    config["observers"] = {"O": FREE, "S": {**FREE, "initial": {"a": 0.0, "b": 0.5}}}
    log = recording(signal("ya", TAKEN, ya, gate=GATE, std=STD), signal("yb", TAKEN, yb, gate=GATE, std=STD))
    result = estimate(source(config), log, sensitivity=False)
    assert recorded_of(result).outputs["yb"].used[0].tolist() == [False, True]
    moved, used = result.remarks
    assert "O leaves it out" in moved
    assert "S uses it" in used


WIDE: Block = {"Q": {"a": 1e-4, "b": 1e-4}}  # P(0) = I: the gate of the covariance would let the outlier in


@pytest.mark.parametrize(("kind", "late"), [("ukf", False), ("ekf", True)])
def test_an_observer_with_a_covariance_leaves_out_what_the_start_has(kind: str, late: bool) -> None:
    """The estimate is that of a log without the samples, also where they come late and are replayed."""
    y, slow = values(3, {1: 3.0}), 0.5 * np.sin(TAKEN[::3] + np.pi)
    slow[0] -= 4.0
    known = TAKEN + 0.3 * (np.arange(COUNT) % 3) if late else TAKEN
    config = {key: value for key, value in block(NEAR).items() if key != "measurement"}
    config["plant"] = {**LINE, "output": {"ya": "a", "yb": "b"}}
    config["observers"] = {"F": {"type": kind, **WIDE}, "S": {"type": kind, **WIDE, "initial": NEAR}}

    def found(first: np.ndarray, second: np.ndarray) -> Result:
        outputs = (
            signal("ya", TAKEN[first], y[first], known[first], gate=GATE, std=STD),
            signal("yb", TAKEN[second], slow[second // 3], known[second], gate=GATE, std=STD),
        )
        return estimate(source(config), replace(recording(*outputs), first_samples=3), sensitivity=False)

    rows = np.arange(COUNT)
    result, others = found(rows, rows[::3]), found(np.delete(rows, 1), rows[3::3])
    ya, yb = (recorded_of(result).outputs[name] for name in ("ya", "yb"))
    assert ya.taken[~ya.used[:, 0]].tolist() == [TAKEN[1]]
    assert yb.taken[~yb.used[:, 0]].tolist() == [0.0]
    assert assessed_of(result, "F").scores["gated"] == {"ya": 1, "yb": 1}
    assert yb.used[0, 1]  # by its covariance
    np.testing.assert_allclose(result.observers["F"].xhat, others.observers["F"].xhat, rtol=0, atol=1e-9)


def test_an_observer_with_a_start_of_its_own_asks_for_no_fit() -> None:
    """Neither for noise, which a fit to "auto" needs, nor for a model that stays within bounds."""
    y, config = values(3, {1: 0.6}), {key: value for key, value in block(NEAR).items() if key != "measurement"}
    with_std, without = ({**config, "plant": plant} for plant in (FALLING, LINE))
    some: list[tuple[Block, float | None, FirstSamples]] = [(without, None, "auto"), (with_std, STD, 3)]
    for text, std, count in some:
        log = recording(signal("a", TAKEN, y, gate=GATE, std=std))
        found, as_ever = (
            estimate(source(text), replace(log, first_samples=of), sensitivity=False) for of in (count, 1)
        )
        np.testing.assert_array_equal(found.observers["O"].xhat, as_ever.observers["O"].xhat)


FALLING: Block = {**LINE, "dynamics": {"a": "b", "b": "1e6*a**3 - 1e6*b**3"}, "inputs": {}}
