"""Late samples in the innovation: a file and a stream give the same bits, with a gate the same numbers to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, inline
from recordings import recorded_of, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.estimator import Estimator
from hgorun.result.result import Result
from hgorun.simulation.experiment import Experiment

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


def config(kind: str, block: Block, plant: Block) -> Block:
    return {
        "time": {"start": 0.0, "end": float(TAKEN[-1]), "output_step": PERIOD},
        "plant": {**plant, "initial": INITIAL},
        "observers": {"O": {"type": kind, "initial": INITIAL, "late": "innovation", **block}},
        "measurement": {"sampling": {"period": PERIOD}, "noise": [{"type": "gaussian", "std": 0.02}]},
        "solver": {"step": STEP},
    }


def samples(output: int) -> tuple[np.ndarray, np.ndarray]:
    """Values with outliers, and when they are known: some before the next one is taken, some after it."""
    random = np.random.default_rng(output)
    values = 0.5 * (np.cos(TAKEN), -np.sin(TAKEN))[output] + 0.02 * random.normal(size=COUNT)
    values[[12 + output, 13 + output, 31]] += 4.0
    delays = np.zeros(COUNT)
    delays[3 + output :: 7] = 0.125  # one at a time
    delays[5 + output :: 14] = 0.625  # two others are taken and used meanwhile
    return values, TAKEN + delays


def of_file(block: Block, gates: dict[str, float]) -> Result:
    names = block["plant"]["output"]
    signals = [signal(name, TAKEN, *samples(i), gate=gates.get(name)) for i, name in enumerate(names)]
    return estimate(source(block), recording(*signals), sensitivity=False)


def of_stream(block: Block, gates: dict[str, float]) -> tuple[np.ndarray, Estimator]:
    """Estimates at the multiples of the period, from samples in the order in which they are known."""
    estimator = Estimator(Experiment(block), gates=gates, std={})
    events = [
        (known, taken, i, name, y)
        for i, name in enumerate(block["plant"]["output"])
        for y, known, taken in zip(*samples(i), TAKEN, strict=True)
    ]
    rows = {}
    for known, taken, _, name, y in sorted(events):
        if known > TAKEN[-1] + 1e-9:
            continue
        estimator.update(float(taken), {name: float(y)}, available=float(known))
        rows[round(known / PERIOD, 6)] = estimator.estimate()["O"]
    return np.array([rows[k] for k in range(COUNT) if k in rows]), estimator


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_stream_has_the_bits_of_the_file(kind: str) -> None:
    agree(config(kind, FAMILIES[kind], ONE), {})


@pytest.mark.parametrize("kind", ["shgo", "kalman_bucy", "extended", "dead_zone"])
def test_with_a_gate_it_has_the_numbers(kind: str) -> None:
    agree(config(kind, FAMILIES[kind], ONE), {"ya": 4.0})


@pytest.mark.parametrize("gates", [{}, {"yb": 5.0}, {"ya": 5.0, "yb": 5.0}], ids=["all", "one", "both"])
@pytest.mark.parametrize("kind", OF_TWO)
def test_so_it_has_with_two_outputs(kind: str, gates: dict[str, float]) -> None:
    agree(config(kind, OF_TWO[kind], TWO), gates)


def agree(block: Block, gates: dict[str, float]) -> None:
    result = of_file(block, gates)
    rows, estimator = of_stream(block, gates)
    known = {round(known / PERIOD, 6) for i in range(len(block["plant"]["output"])) for known in samples(i)[1].tolist()}
    whole = [k for k in range(COUNT) if k in known]
    assert np.isfinite(rows).all()
    # a file takes back what a sample that comes after a newer one has done, and a stream does not let it happen
    np.testing.assert_allclose(
        rows, result.observers["O"].xhat[whole], rtol=1e-13 if gates else 0, atol=1e-15 if gates else 0
    )
    outputs = recorded_of(result).outputs
    for name, (count, _) in estimator.gated["O"].items():
        assert count >= 2
        assert count <= np.count_nonzero(~outputs[name].used[:, 0])
