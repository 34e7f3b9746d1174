"""Streams of observers that step from sample to sample: with inputs, with two outputs, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from examples import Block, inline
from recordings import held_input, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

TAKEN = 0.125 * np.array([0, 1, 2, 4, 5, 8, 9, 10, 11, 13, 16, 17])  # exact, and not even
Y, Z, U = np.cos(TAKEN), 0.4 * np.sin(TAKEN), np.sin(3 * TAKEN)
ONE = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, {"y": "a"}, inputs={"u": "0"})
TWO = inline({"a": "b", "b": "-sin(a) - 0.1*b + u", "c": "d", "d": "a - c"}, {"y": "a", "z": "c"}, inputs={"u": "0"})


def config(plant: Block, block: Block) -> Block:
    return {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": 0.125},
        "plant": plant,
        "observers": {"O": {**block, "initial": dict.fromkeys(plant["states"], 0.0)}},
        "measurement": {"sampling": {"period": 0.125}},
        "solver": {"step": 1 / 64},
    }


def deadbeat() -> np.ndarray:
    """Of both outputs, (6) and (9) of Katayama written out: the states a, b, c, d after every sample but the first."""
    rows, step = [], np.diff(TAKEN)
    for k, T in enumerate(step):
        b, d = (Y[k + 1] - Y[k]) / T, (Z[k + 1] - Z[k]) / T
        rows.append([Y[k + 1], b + T * (-np.sin(Y[k]) - 0.1 * b + U[k]), Z[k + 1], d + T * (Y[k] - Z[k])])
    return np.array(rows)


Updates = Callable[[Estimator, int], None]


def at_once(estimator: Estimator, k: int) -> None:
    y = {"y": Y[k], "z": Z[k]}
    estimator.update(TAKEN[k], {name: y[name] for name in estimator.kinds if name in y}, u={"u": U[k]})


def one_by_one(estimator: Estimator, k: int) -> None:
    for name, values in (("z", Z), ("y", Y)):
        if name in estimator.kinds:
            estimator.update(TAKEN[k], {name: values[k]})
    estimator.update(TAKEN[k], {}, u={"u": U[k]})  # which the next step begins with


def followed(block: Block, update: Updates) -> np.ndarray:
    """Estimates after every sample, of a stream that is begun again from a checkpoint now and then."""
    rows, estimator = [], Estimator(Experiment(block), inputs=["u"])
    for k in range(TAKEN.size):
        update(estimator, k)
        if k % 4 == 2:
            stored, estimator = estimator.checkpoint(), Estimator(Experiment(block), inputs=["u"])
            estimator.restore(stored)
        rows.append(estimator.estimate()["O"])
    return np.array(rows)


@pytest.mark.parametrize("update", [at_once, one_by_one])
@pytest.mark.parametrize("plant", [ONE, TWO], ids=["one output", "two"])
def test_a_stream_is_that_of_an_independent_observer_and_has_the_bits_of_a_file(plant: Block, update: Updates) -> None:
    block = config(plant, {"type": "deadbeat"})
    found = followed(block, update)
    np.testing.assert_allclose(found[1:], deadbeat()[:, : found.shape[1]], rtol=1e-12, atol=1e-14)
    signals = [signal(name, TAKEN, values) for name, values in (("y", Y), ("z", Z)) if name in plant["output"]]
    whole = estimate(source(block), recording(*signals, u=held_input("u", TAKEN, U)), sensitivity=False)
    rows = np.round(TAKEN / 0.125).astype(int)
    np.testing.assert_array_equal(found, whole.observers["O"].xhat[rows])


def test_a_sample_of_one_output_alone_is_no_step() -> None:
    estimator = Estimator(Experiment(config(TWO, {"type": "deadbeat"})), inputs=["u"])
    at_once(estimator, 0)
    at_once(estimator, 1)
    before = estimator.estimate()["O"]
    estimator.update(TAKEN[2], {"y": Y[2]})
    assert np.array_equal(estimator.estimate()["O"][[1, 3]], before[[1, 3]])
    with pytest.raises(ValueError, match=r"O steps from sample to sample of all outputs, and that of z at t = 0.25 is"):
        at_once(estimator, 3)
    estimator.update(TAKEN[2], {"z": Z[2]})
    np.testing.assert_allclose(estimator.estimate()["O"][1], deadbeat()[1, 1], rtol=1e-12)


@pytest.mark.parametrize("block", [{"type": "deadbeat"}, {"type": "hgo_fd", "eps": 0.3}], ids=["deadbeat", "hgo_fd"])
def test_a_late_sample_is_refused(block: Block) -> None:
    estimator = Estimator(Experiment(config(ONE, block)), inputs=["u"])
    at_once(estimator, 0)
    with pytest.raises(ValueError, match=r"taken at 0.1 is late, and O takes samples without delay: leave late ones"):
        estimator.update(0.1, {"y": 0.9}, available=0.2)
    assert estimator.t == 0.0


def test_late_samples_that_are_left_out_have_not_been() -> None:
    found = []
    for late in (False, True):
        estimator = Estimator(Experiment(config(ONE, {"type": "deadbeat", "late": "drop"})), inputs=["u"])
        for k in range(4):
            at_once(estimator, k)
            if late and k < 3:
                estimator.update(TAKEN[k] + 0.01, {"y": 9.0}, available=TAKEN[k] + 0.02)
        found.append(estimator.estimate()["O"])
    np.testing.assert_array_equal(found[1], found[0])


@pytest.mark.parametrize(
    ("plant", "block"),
    [(ONE, {"type": "hgo_fd", "eps": 0.3}), (TWO, {"type": "deadbeat"})],
    ids=["one output", "two"],
)
def test_a_file_whose_late_samples_are_left_out_is_that_without_them(plant: Block, block: Block) -> None:
    """Of every output the same rows, beside an observer that goes back to them; a stream leaves the same ones out."""
    late = np.array([3, 7, 8])
    kept = np.setdiff1d(np.arange(TAKEN.size), late)
    available = TAKEN.copy()
    available[late] += [0.3, 0.05, 0.2]
    signals = {"y": Y, "z": Z} if plant is TWO else {"y": Y}
    u = held_input("u", TAKEN[kept], U[kept])
    text = config(plant, block | {"late": "drop"})
    text["observers"]["R"] = {"type": "shgo", "theta": 2, "late": "replay"}
    some = [signal(name, TAKEN[kept], values[kept]) for name, values in signals.items()]
    whole = [signal(name, TAKEN, values, available) for name, values in signals.items()]
    without, found = (estimate(source(text), recording(*of, u=u), sensitivity=False) for of in (some, whole))
    rows = np.round(TAKEN[kept] / 0.125).astype(int)
    np.testing.assert_array_equal(found.observers["O"].xhat[rows], without.observers["O"].xhat[rows])
    del text["observers"]["R"]
    estimator = Estimator(Experiment(text), inputs=["u"])
    for k in np.argsort(available):
        y = {name: values[k] for name, values in signals.items()}
        if k in late:
            estimator.update(TAKEN[k], y, available[k])
        else:
            estimator.update(TAKEN[k], y, u={"u": U[k]})
    np.testing.assert_array_equal(estimator.estimate()["O"], found.observers["O"].xhat[-1])


def test_a_stream_of_one_period_refuses_a_gap() -> None:
    """As a file does."""
    text = config(inline({"a": "b", "b": "-a"}, {"y": "a"}), {"type": "kkl", "theta": 2})
    estimator = Estimator(Experiment(text))
    for t in (0.0, 0.125):
        estimator.update(t, {"y": 1.0})
    with pytest.raises(ValueError, match=r"of one period, 0.125, and the sample of t = 0.375 comes 0.25 after"):
        estimator.update(0.375, {"y": 1.0})
    estimator.update(0.25, {"y": 1.0})
