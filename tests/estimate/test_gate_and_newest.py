"""What a gate leaves out is as if it had never come, also for older samples of its output that arrive after it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from examples import Block, experiment, inline
from recordings import NOISE, assessed_of, recorded_of, recording, signal, source

from hgorun.data.recording import Recording
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result

PLANT = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"ya": "a", "yb": "b"})
GATE, END = 5.0, 6.0
TAKEN = np.round(0.1 * np.arange(1, 51), 10)  # as all times of events, multiples of ten steps: nothing cuts a step
KNOWN = TAKEN.copy()
A, B = 0.6 * np.cos(TAKEN), -0.6 * np.sin(TAKEN)
# an outlier in time, with two older samples that arrive after it, and some that are older than what has been used
OUT = [25, 38]
KNOWN[[23, 24, 30, 31]] = [2.64, 2.67, 3.4, 3.3]
KNOWN[33:39] = TAKEN[38]  # from a laboratory, all at once; the newest of them is an outlier
A[OUT] += 4.0
KEPT = np.setdiff1d(np.arange(TAKEN.size), OUT)
BUCY: Block = {"type": "kalman_bucy", "Q": {"b": 0.1}, "R": {"ya": 0.1, "yb": 0.1}, "initial": {"a": 0.5, "b": 0.0}}
CHAIN: Block = {"type": "shgo", "theta": 2, "poles": -1, "initial": {"a": 0.5, "b": 0.0}}
EKF: Block = {"type": "ekf", "Q": {"b": 0.1}, "initial": {"a": 0.5, "b": 0.0}}


def log(which: Sequence[int] | np.ndarray, gate: float | None, *, both: bool) -> Recording:
    a = signal("ya", TAKEN[which], A[which], KNOWN[which], gate=gate)
    return recording(a, signal("yb", TAKEN, B, KNOWN, gate=gate)) if both else recording(a)


def found(blocks: dict[str, Block], which: Sequence[int] | np.ndarray, *, gate: float | None = GATE) -> Result:
    both = "chain" not in blocks
    config = {
        "time": {"start": 0.0, "end": END, "output_step": 0.1},
        "plant": PLANT if both else {**PLANT, "output": {"ya": "a"}},
        "observers": blocks,
        "measurement": {"noise": NOISE},
        "solver": {"step": 0.01},
    }
    return estimate(source(config), log(which, gate, both=both), sensitivity=False)


CASES = {"one output": {"chain": CHAIN}, "two": {"bucy": BUCY}, "beside one that goes back": {"bucy": BUCY, "ekf": EKF}}


@pytest.mark.measured("two")
@pytest.mark.slow
@pytest.mark.parametrize("blocks", CASES.values(), ids=list(CASES))
def test_the_estimate_is_that_of_the_log_without_the_rows_of_outliers(blocks: dict[str, Block]) -> None:
    whole, without = found(blocks, np.arange(TAKEN.size)), found(blocks, KEPT, gate=None)
    for label in blocks:
        x = whole.observers[label].xhat
        assert np.isfinite(x).all()
        np.testing.assert_allclose(x, without.observers[label].xhat, rtol=1e-12, atol=1e-12, err_msg=label)
        j = list(blocks).index(label)
        used = [recorded_of(one).outputs["ya"] for one in (whole, without)]
        assert [*used[0].taken[used[0].used[:, j]]] == [*used[1].taken[used[1].used[:, j]]]
        assert assessed_of(whole, label).scores["gated"]["ya"] == len(OUT)


@pytest.mark.costly
@pytest.mark.parametrize("blocks", [CASES["one output"], CASES["two"]], ids=["one output", "two"])
def test_a_stream_goes_on_as_without_them(blocks: dict[str, Block]) -> None:
    """Also one that is begun again from a checkpoint after every seventh sample; each sees the same rows."""
    outputs = {"ya": A} if "chain" in blocks else {"ya": A, "yb": B}
    plant = {**PLANT, "output": {name: PLANT["output"][name] for name in outputs}}
    one = experiment(plant, blocks, end=END, step=0.01, measurement={"noise": NOISE, "sampling": {"period": 0.1}})
    gates = dict.fromkeys(outputs, GATE)
    with_gate, without = Estimator(one, gates=gates), Estimator(one)
    for count, k in enumerate(np.lexsort((TAKEN, KNOWN)).tolist()):
        y = {name: float(values[k]) for name, values in outputs.items()}
        with_gate.update(TAKEN[k], y, available=KNOWN[k])
        if k in OUT:
            del y["ya"]
        without.update(TAKEN[k], y, available=KNOWN[k])
        if count % 7 == 6:
            kept, with_gate = with_gate.checkpoint(), Estimator(one, gates=gates)
            with_gate.restore(kept)
        for label, x in without.estimate().items():
            np.testing.assert_allclose(with_gate.estimate()[label], x, rtol=1e-12, atol=1e-12, err_msg=f"{label}, {k}")
    whole = found(blocks, np.arange(TAKEN.size))
    for label, counts in with_gate.gated.items():
        np.testing.assert_allclose(with_gate.predict(END)[label], whole.observers[label].xhat[-1], atol=1e-8)
        offered = recorded_of(whole).outputs["ya"].used[:, list(blocks).index(label)].sum() + len(OUT)
        assert counts["ya"] == (len(OUT), offered)


def test_what_is_on_its_way_does_not_know_of_an_outlier() -> None:
    """All samples are late by three periods: when an outlier arrives, those behind it have been taken."""
    values = 0.6 * np.cos(TAKEN)
    out = np.array([14, 21, 22, 33])
    values[out] += 4.0
    config = {
        "time": {"start": 0.0, "end": END, "output_step": 0.1},
        "plant": {**PLANT, "output": {"ya": "a"}},
        "observers": {"chain": CHAIN},
        "measurement": {"noise": NOISE},
        "solver": {"step": 0.01},
    }
    kept = np.setdiff1d(np.arange(TAKEN.size), out)
    xhat = []
    for which, gate in ((np.arange(TAKEN.size), GATE), (kept, None)):
        late = signal("ya", TAKEN[which], values[which], np.round(TAKEN[which] + 0.3, 10), gate=gate)
        xhat.append(estimate(source(config), recording(late), sensitivity=False).observers["chain"].xhat)
    np.testing.assert_allclose(xhat[0], xhat[1], rtol=1e-12, atol=1e-12)
