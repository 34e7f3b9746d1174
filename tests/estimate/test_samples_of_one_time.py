"""Samples of one output that were taken at one time enter one after the other, in a file as in a stream."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from examples import Block, experiment, inline
from recordings import NOISE, recorded_of, recording, signal, source

from hgorun.data.recording import Recording
from hgorun.errors import ConfigError
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

END, PERIOD, GATE = 3.0, 0.125, 5.0
ONCE = PERIOD * np.arange(1, 25)
TWICE = [9, 17]  # there are two samples of y at these times, and two of z at the second one
TAKEN = np.sort(np.concatenate([ONCE, ONCE[TWICE]]))
Y = 0.6 * np.cos(TAKEN)
AGAIN = np.flatnonzero(np.diff(TAKEN) == 0)  # the first of two each
Y[AGAIN] += [0.05, 4.0]  # an outlier the first time
Y[AGAIN + 1] -= [4.0, 0.05]  # and the second time
OUT = [int(AGAIN[0]) + 1, int(AGAIN[1])]
TAKEN_Z = np.sort(np.append(ONCE, ONCE[TWICE[1]]))
Z = -0.6 * np.sin(TAKEN_Z) + 0.02 * (np.arange(TAKEN_Z.size) % 2)
START = {"a": 0.5, "b": 0.0}
EKF: Block = {"type": "ekf", "Q": {"b": 0.1}, "initial": START}
BLOCKS: dict[str, Block] = {
    "ekf": EKF,
    "impulsive": {"type": "impulsive", "theta": 2, "initial": START},
    "shgo": {"type": "shgo", "theta": 2, "poles": -1, "initial": START},
}
ONE, TWO = ({"y": "a"}, {"y": "a", "z": "b"})


def config(outputs: dict[str, str], blocks: dict[str, Block]) -> Block:
    return {
        "time": {"start": 0.0, "end": END, "output_step": PERIOD},
        "plant": inline({"a": "b", "b": "-sin(a) - 0.1*b"}, outputs),
        "observers": blocks,
        "measurement": {"noise": NOISE, "sampling": {"period": PERIOD}},
        "solver": {"step": 1 / 64},
    }


def log(outputs: dict[str, str], gate: float | None, known: np.ndarray | None = None) -> Recording:
    y = signal("y", TAKEN, Y, known, gate=gate)
    return recording(y, signal("z", TAKEN_Z, Z, gate=gate)) if "z" in outputs else recording(y)


def followed(block: Block, gate: float | None, order: Sequence[tuple[float, float, str, float]]) -> np.ndarray:
    """The last estimates of a stream of (known, taken, output, value); it is begun again now and then."""
    one = Experiment(block)
    outputs = list(block["plant"]["output"])

    def begun() -> Estimator:
        return Estimator(one, gates={} if gate is None else dict.fromkeys(outputs, gate))

    estimator = begun()
    for k, (known, t, name, value) in enumerate(order):
        estimator.update(t, {name: value}, available=known)
        if k % 5 == 2:
            kept, estimator = estimator.checkpoint(), begun()
            estimator.restore(kept)
    return np.concatenate(list(estimator.predict(END).values()))


def lines(outputs: dict[str, str], *, by_output: bool) -> list[tuple[float, float, str, float]]:
    """The samples in the order of their times; of one time all of an output first, or the first of every output."""
    rows = [(t, k, 0, "y", y) for k, (t, y) in enumerate(zip(TAKEN.tolist(), Y.tolist(), strict=True))]
    if "z" in outputs:
        rows += [(t, k, 1, "z", z) for k, (t, z) in enumerate(zip(TAKEN_Z.tolist(), Z.tolist(), strict=True))]
        again = {(0, k + 1) for k in AGAIN} | {(1, int(np.flatnonzero(np.diff(TAKEN_Z) == 0)[0]) + 1)}
        rows.sort(key=lambda row: (row[0], row[2] if by_output else (row[2], row[1]) in again, row[2], row[1]))
    return [(t, t, name, value) for t, _, _, name, value in rows]


@pytest.mark.costly
@pytest.mark.parametrize("gate", [None, GATE])
@pytest.mark.parametrize("outputs", [ONE, TWO], ids=["one output", "two"])
def test_a_file_has_the_bits_of_the_stream(outputs: dict[str, str], gate: float | None) -> None:
    """Whatever observers there are beside, and in whatever order the lines of one time come."""
    blocks = BLOCKS if outputs is ONE else {"ekf": EKF}
    block = config(outputs, blocks)
    found = estimate(source(block), log(outputs, gate), sensitivity=False)
    last = np.concatenate([found.observers[label].xhat[-1] for label in blocks])
    for by_output in {False, outputs is TWO}:
        np.testing.assert_array_equal(followed(block, gate, lines(outputs, by_output=by_output)), last)
    if gate is not None:
        used = recorded_of(found).outputs["y"].used
        assert all(np.flatnonzero(~used[:, j]).tolist() == OUT for j in range(len(blocks)))


@pytest.mark.parametrize("gate", [None, GATE])
def test_late_ones_as_well(gate: float | None) -> None:
    """The two come late, one after the other; the filter goes back to when they were taken."""
    known = TAKEN.copy()
    known[AGAIN] += 2 * PERIOD
    known[AGAIN + 1] += 3 * PERIOD
    order = sorted(
        zip(known.tolist(), TAKEN.tolist(), ["y"] * TAKEN.size, Y.tolist(), strict=True), key=lambda row: row[0]
    )
    block = config(ONE, {"ekf": EKF})
    found = estimate(source(block), log(ONE, gate, known), sensitivity=False)
    np.testing.assert_array_equal(followed(block, gate, order), found.observers["ekf"].xhat[-1])


def test_both_are_taken_as_by_a_filter_written_out() -> None:
    """Of a constant with two measurements at a time: the mean of all of them, each by its weight."""
    times, values = np.repeat(PERIOD * np.arange(1, 9), 2), np.random.default_rng(1).normal(1.0, 0.3, 16)
    plant = inline({"a": "0"}, {"y": "a"})
    block: Block = {"type": "ekf", "Q": {"a": 1e-12}, "R": {"y": 0.25}, "internal": {"P": [[4]]}, "initial": {"a": 0.0}}
    settings = config({"y": "a"}, {"O": block}) | {"plant": plant, "time": {"end": 1.0, "output_step": PERIOD}}
    found = estimate(source(settings), recording(signal("y", times, values)), sensitivity=False)
    expected = values.sum() / 0.25 / (1 / 4 + 16 / 0.25)
    np.testing.assert_allclose(found.observers["O"].xhat[-1], [expected], rtol=1e-9)


def test_no_step_leads_from_one_to_the_other() -> None:
    block = config(ONE, {"O": {"type": "hgo_fd", "eps": 0.4, "initial": START}})
    with pytest.raises(ConfigError, match=r"O steps from sample to sample, and two samples were taken at 1\.25: take"):
        estimate(source(block), log(ONE, None), sensitivity=False)
    one = experiment(block["plant"], block["observers"], end=END, step=1 / 64, measurement=block["measurement"])
    estimator = Estimator(one)
    for k in range(3):
        estimator.update(ONCE[k], {"y": float(k)})
    before = estimator.checkpoint()
    with pytest.raises(ValueError, match=r"this is a second one of y at t = 0\.375: leave one of them out, or give"):
        estimator.update(ONCE[2], {"y": 3.0})
    assert estimator.checkpoint() == before
