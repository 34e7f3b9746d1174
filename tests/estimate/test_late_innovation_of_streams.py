"""Late samples, by innovation and by replay: a file and a stream give the same bits, also with gates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from examples import Block, inline
from recordings import recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment

PERIOD, STEP, COUNT = 0.25, 1 / 64, 45  # exact times: steps are the same to the last bit
TAKEN = PERIOD * np.arange(COUNT)
INITIAL = {"a": 0.5, "b": 0.0}
ONE = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"ya": "a"})
TWO = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"ya": "a", "yb": "b"})
HIGH_GAIN: Block = {"theta": 2, "poles": -1}

FAMILIES: dict[str, Block] = {
    "shgo": HIGH_GAIN,
    "fhgo2": {**HIGH_GAIN, "r": 1},
    "kalman_bucy": {"Q": {"b": 0.1}, "R": {"ya": 0.01}},
    "low_power": HIGH_GAIN,
    "extended": HIGH_GAIN,
    "stubborn": HIGH_GAIN,
    "dead_zone": HIGH_GAIN,
    "integral": HIGH_GAIN,
    "switched": {"theta_1": 3, "theta_2": 1, "delta": 0.1, "poles": -1},
}
OF_TWO: dict[str, Block] = {
    "shgo": HIGH_GAIN,
    "kalman_bucy": {"Q": {"b": 0.1}, "R": {"ya": 0.01, "yb": 0.02}},
}


def config(kind: str, block: Block, plant: Block, late: str = "innovation") -> Block:
    return {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": PERIOD},
        "plant": {**plant, "initial": INITIAL},
        "observers": {"O": {"type": kind, "initial": INITIAL, "late": late, **block}},
        "measurement": {"sampling": {"period": PERIOD}, "noise": [{"type": "gaussian", "std": 0.02}]},
        "solver": {"step": STEP},
    }


def together(output: int) -> tuple[np.ndarray, np.ndarray]:
    """Values of which every fifth is an outlier, and when they are known: many at once, and in another order."""
    random = np.random.default_rng(7 + output)
    values = 0.5 * (np.cos(TAKEN), -np.sin(TAKEN))[output] + 0.02 * random.normal(size=COUNT)
    values[10 + random.permutation(35)[:7]] += 4.0
    known = TAKEN + 0.125 * random.integers(0, 7, COUNT) * (random.random(COUNT) < 0.6)
    known[[25, 26, 27]] = TAKEN[27]  # from a laboratory
    values[26 + output] += 5.0
    return values, known


def some_late(output: int) -> tuple[np.ndarray, np.ndarray]:
    """Values with outliers, and when they are known: some before the next one is taken, some after it."""
    random = np.random.default_rng(output)
    values = 0.5 * (np.cos(TAKEN), -np.sin(TAKEN))[output] + 0.02 * random.normal(size=COUNT)
    values[[12 + output, 13 + output, 31]] += 4.0
    delays = np.zeros(COUNT)
    delays[3 + output :: 7] = 0.125  # one at a time
    delays[5 + output :: 14] = 0.625  # two others are taken and used meanwhile
    return values, TAKEN + delays


def by_whole_periods(output: int) -> tuple[np.ndarray, np.ndarray]:
    """Values that are known when others are taken: one period later at first, then some at once and some not."""
    random = np.random.default_rng(3 + output)
    delays = np.ones(COUNT)
    delays[20:] = random.integers(0, 4, COUNT - 20)
    return 2.0 * random.normal(size=COUNT), TAKEN + PERIOD * delays


Samples = Callable[[int], tuple[np.ndarray, np.ndarray]]


def of_file(block: Block, gates: dict[str, float], samples: Samples) -> Result:
    names = block["plant"]["output"]
    signals = [signal(name, TAKEN, *samples(i), gate=gates.get(name)) for i, name in enumerate(names)]
    return estimate(source(block), recording(*signals), sensitivity=False)


def of_stream(
    block: Block, gates: dict[str, float], samples: Samples
) -> tuple[list[int], dict[str, np.ndarray], Estimator]:
    """At which multiples of the period something became known, the estimates then, and who has made them."""
    estimator = Estimator(Experiment(block), gates=gates, std={})
    events = [
        (known, taken, i, name, y)
        for i, name in enumerate(block["plant"]["output"])
        for y, known, taken in zip(*samples(i), TAKEN, strict=True)
    ]
    rows: dict[float, dict[str, np.ndarray]] = {}
    for known, taken, _, name, y in sorted(events):
        if known > TAKEN[-1] + 1e-9:
            continue
        estimator.update(float(taken), {name: float(y)}, available=float(known))
        rows[round(known / PERIOD, 6)] = estimator.estimate()
    whole = [k for k in range(COUNT) if k in rows]
    return whole, {label: np.array([rows[k][label] for k in whole]) for label in estimator.labels}, estimator


@pytest.mark.costly
@pytest.mark.parametrize("kind", FAMILIES)
def test_a_stream_has_the_bits_of_the_file(kind: str) -> None:
    agree(config(kind, FAMILIES[kind], ONE), {})


@pytest.mark.parametrize(
    ("kind", "plant"), [("shgo", ONE), ("low_power", ONE), ("shgo", TWO)], ids=["shgo", "low power", "two"]
)
def test_so_it_has_where_samples_become_known_when_others_are_taken(kind: str, plant: Block) -> None:
    """What is kept for these is C xhat - alpha: in both before alpha is counted anew, or in both behind it."""
    agree(config(kind, FAMILIES[kind], plant), {}, by_whole_periods)


@pytest.mark.costly
@pytest.mark.parametrize("late", ["innovation", "replay"])
@pytest.mark.parametrize("kind", ["shgo", "fhgo2", "kalman_bucy", "extended", "dead_zone"])
def test_so_it_has_with_a_gate(kind: str, late: str) -> None:
    agree(config(kind, FAMILIES[kind], ONE, late), {"ya": 4.0})


@pytest.mark.costly
@pytest.mark.parametrize("gates", [{}, {"yb": 5.0}, {"ya": 5.0, "yb": 5.0}], ids=["all", "one", "both"])
@pytest.mark.parametrize("kind", OF_TWO)
def test_so_it_has_with_two_outputs(kind: str, gates: dict[str, float]) -> None:
    agree(config(kind, OF_TWO[kind], TWO), gates)


@pytest.mark.parametrize("gates", [{"yb": 5.0}, {"ya": 5.0, "yb": 5.0}], ids=["one", "both"])
def test_so_it_has_of_a_filter_that_goes_back(gates: dict[str, float]) -> None:
    agree(config("ekf", OF_TWO["kalman_bucy"], TWO, "replay"), gates)


@pytest.mark.costly
@pytest.mark.parametrize("late", ["innovation", "replay"])
@pytest.mark.parametrize("plant", [ONE, TWO], ids=["one output", "two"])
def test_so_it_has_where_many_become_known_at_once(plant: Block, late: str) -> None:
    """Some of them outliers, and to one observer others than to the other one."""
    block = config("shgo", {"theta": 2, "poles": -1}, plant, late)
    block["observers"]["far"] = {**block["observers"]["O"], "theta": 0.5, "initial": {"a": 3, "b": 0}}
    found = agree(block, dict.fromkeys(plant["output"], 5.0), together)
    left_out = [one.used for one in recorded_of(found).outputs.values()]
    assert late == "replay" or any((used[:, 0] != used[:, 1]).any() for used in left_out)


def agree(block: Block, gates: dict[str, float], samples: Samples = some_late) -> Result:
    result = of_file(block, gates, samples)
    whole, rows, estimator = of_stream(block, gates, samples)
    assert len(whole) > COUNT / 2
    for label, found in rows.items():
        assert np.isfinite(found).all()
        np.testing.assert_array_equal(found, result.observers[label].xhat[whole], err_msg=label)
    outputs = recorded_of(result).outputs
    for j, counts in enumerate(estimator.gated.values()):
        for name, (count, offered) in counts.items():
            assert j > 0 or count >= 2
            assert offered - count == np.count_nonzero(outputs[name].used[:, j])
    return result


@pytest.mark.parametrize("remembered", [0, 100])
def test_two_samples_of_one_output_at_one_time_enter_one_after_the_other(remembered: int) -> None:
    taken, values = np.repeat(TAKEN, 2), np.random.default_rng(1).normal(size=2 * COUNT)
    block = config("low_power", HIGH_GAIN, ONE)
    result = estimate(source(block), recording(signal("ya", taken, values)), sensitivity=False)
    estimator = Estimator(Experiment(block), std={}, remembered=remembered)
    rows = []
    for t, y in zip(taken.tolist(), values.tolist(), strict=True):
        estimator.update(t, {"ya": y})
        rows.append(estimator.estimate()["O"])
    np.testing.assert_array_equal(np.array(rows[1::2]), result.observers["O"].xhat)
