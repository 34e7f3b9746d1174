"""Gates beside observers that step from sample to sample: what is left out is as if it had never been there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from examples import Block, experiment, inline
from recordings import NOISE, assessed_of, held_input, recorded_of, recording, signal, source

from hgorun.errors import ConfigError
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment

GATE = 5.0
_GAPS = np.random.default_rng(3).choice([1, 2, 3], 48)
TAKEN = np.cumsum(_GAPS) / 16  # exact, and not even
END = float(TAKEN[-1])
ROWS = np.cumsum(_GAPS)  # of the output points
Y, Z, U = 0.6 * np.cos(TAKEN), 0.4 * np.sin(TAKEN), np.sin(3 * TAKEN)
OUT = {"y": [20, 33], "z": [34, 45]}  # two of them are neighbours, each an outlier of another output
Y[OUT["y"]] += 4.0
Z[OUT["z"]] -= 4.0
KEPT = np.setdiff1d(np.arange(TAKEN.size), [*OUT["y"], *OUT["z"]])
ONE = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, {"y": "a"}, inputs={"u": "0"})
TWO = inline({"a": "b", "b": "-sin(a) - 0.1*b + u", "c": "d", "d": "a - c"}, {"y": "a", "z": "c"}, inputs={"u": "0"})
OF_CHAIN: dict[str, Block] = {
    "fd": {"type": "hgo_fd", "eps": 0.4},
    "levant": {"type": "levant", "G": 2, "discretisation": "implicit"},
}
STEPS: dict[str, Block] = {"deadbeat": {"type": "deadbeat"}, "reduced": {"type": "reduced_sampled", "H": 0.5}}


def config(plant: Block, blocks: dict[str, Block]) -> Block:
    start = {"a": 0.5, "b": 0.0, "c": 0.0, "d": 0.0}
    initial = {name: start[name] for name in plant["states"]}
    return {
        "time": {"start": 0.0, "end": END, "output_step": 1 / 16},
        "plant": plant,
        "observers": {label: {**block, "initial": initial} for label, block in blocks.items()},
        "measurement": {"noise": NOISE, "sampling": {"period": 1 / 16}},
        "solver": {"step": 1 / 64},
    }


def of_log(block: Block, which: np.ndarray, gated: Sequence[str]) -> Result:
    """The estimate of some rows, with gates of some outputs."""
    of = {"y": Y, "z": Z}
    signals = [
        signal(name, TAKEN[which], of[name][which], gate=GATE if name in gated else None)
        for name in block["plant"]["output"]
    ]
    return estimate(source(block), recording(*signals, u=held_input("u", TAKEN, U)), sensitivity=False)


def followed(block: Block, gates: Sequence[str], *, by_line: bool) -> tuple[np.ndarray, Estimator]:
    """The estimates of a stream after every sample; it is begun again from a checkpoint now and then."""
    one = Experiment(block)

    def begun() -> Estimator:
        return Estimator(one, gates=dict.fromkeys(gates, GATE), inputs=["u"])

    estimator, rows = begun(), []
    for k, t in enumerate(TAKEN.tolist()):
        y = {name: float(values[k]) for name, values in (("z", Z), ("y", Y)) if name in block["plant"]["output"]}
        for given in [{name: value} for name, value in y.items()] if by_line else [y]:
            estimator.update(t, given)
        estimator.update(t, {}, u={"u": float(U[k])})
        if k % 3 == 0:
            kept, estimator = estimator.checkpoint(), begun()
            estimator.restore(kept)
        rows.append(np.concatenate([x.copy() for x in estimator.estimate().values()]))
    return np.array(rows), estimator


def deadbeat(kept: np.ndarray = KEPT) -> np.ndarray:
    """Of the rows that are kept, (6) and (9) of Katayama written out: a, b, c, d after each but the first."""
    rows = []
    for k, j in zip(kept[:-1].tolist(), kept[1:].tolist(), strict=True):
        T = TAKEN[j] - TAKEN[k]
        b, d = (Y[j] - Y[k]) / T, (Z[j] - Z[k]) / T
        rows.append([Y[j], b + T * (-np.sin(Y[k]) - 0.1 * b + U[k]), Z[j], d + T * (Y[k] - Z[k])])
    return np.array(rows)


CASES = {
    "one output": (ONE, {**STEPS}, ["y"]),
    "two outputs": (TWO, STEPS, ["y", "z"]),
    "one of two": (TWO, STEPS, ["z"]),
}


@pytest.mark.measured("one of two")
@pytest.mark.costly
@pytest.mark.parametrize(("plant", "blocks", "gated"), CASES.values(), ids=list(CASES))
def test_the_estimate_is_that_of_the_log_without_outliers(
    plant: Block, blocks: dict[str, Block], gated: Sequence[str]
) -> None:
    """To the last bit, of a file and of a stream; a step takes all outputs, so that a row is left out as a whole."""
    out = sorted(k for name in gated for k in OUT[name])
    kept = np.setdiff1d(np.arange(TAKEN.size), out)
    block = config(plant, blocks)
    whole, without = of_log(block, np.arange(TAKEN.size), gated), of_log(block, kept, [])
    for j, label in enumerate(blocks):
        np.testing.assert_array_equal(whole.observers[label].xhat, without.observers[label].xhat, err_msg=label)
        for name in plant["output"]:
            assert np.flatnonzero(~recorded_of(whole).outputs[name].used[:, j]).tolist() == out
        assert assessed_of(whole, label).scores["gated"] == dict.fromkeys(gated, len(out))
    expected = np.concatenate([whole.observers[label].xhat[ROWS] for label in blocks], axis=1)
    for by_line in (False, True):
        found, estimator = followed(block, gated, by_line=by_line)
        np.testing.assert_array_equal(found, expected)
        counts = dict.fromkeys(gated, (len(out), TAKEN.size))
        assert estimator.gated == dict.fromkeys(blocks, counts)
        assert estimator.gated_in_a_row == dict.fromkeys(blocks, dict.fromkeys(gated, 1 + (len(gated) > 1)))
        assert {assessed_of(whole, label).in_a_row[gated[0]].count for label in blocks} == {1 + (len(gated) > 1)}


def test_it_is_that_of_an_independent_observer() -> None:
    whole = of_log(config(TWO, {"deadbeat": STEPS["deadbeat"]}), np.arange(TAKEN.size), ["y", "z"])
    xhat = whole.observers["deadbeat"].xhat[ROWS[KEPT[1:]]]
    np.testing.assert_allclose(xhat, deadbeat(), rtol=1e-12, atol=1e-14)


def test_steps_lead_over_outliers_and_over_late_samples_that_are_dropped() -> None:
    """Rows that are late beside outliers: those of the independent observer, of a file and of a stream."""
    late = {10: 0.01, 19: 0.5, 32: 0.02, 35: 0.02}  # 20 and 33 to 34 are outliers
    kept = np.setdiff1d(KEPT, list(late))
    available = TAKEN + [late.get(k, 0.0) for k in range(TAKEN.size)]
    block = config(TWO, {"deadbeat": {**STEPS["deadbeat"], "late": "drop"}})
    signals = [signal(name, TAKEN, values, available, gate=GATE) for name, values in (("y", Y), ("z", Z))]
    u = held_input("u", TAKEN, U)
    of_file = estimate(source(block), recording(*signals, u=u), sensitivity=False)
    xhat = of_file.observers["deadbeat"].xhat[ROWS[kept[1:]]]
    np.testing.assert_allclose(xhat, deadbeat(kept), rtol=1e-12, atol=1e-14)
    for name in ("y", "z"):
        one = recorded_of(of_file).outputs[name]
        np.testing.assert_array_equal(one.taken[one.used[:, 0]], TAKEN[kept])
    estimator, rows = Estimator(Experiment(block), gates={"y": GATE, "z": GATE}, inputs=["u"]), []
    for known, k in sorted((float(available[k]), k) for k in range(TAKEN.size)):
        estimator.update(float(TAKEN[k]), {"y": float(Y[k]), "z": float(Z[k])}, known)
        if k not in late:
            estimator.update(known, {}, u={"u": float(U[k])})
        if k in kept[1:]:
            rows.append(estimator.estimate()["deadbeat"].copy())
    np.testing.assert_array_equal(rows, xhat)


def test_observers_of_chains_leave_out_as_well_beside_one_that_flows() -> None:
    """Each by its own judgement: what one leaves out another may take."""
    shgo: Block = {"type": "shgo", "theta": 2, "poles": -1}
    block = config(ONE, {"shgo": shgo, **OF_CHAIN})
    whole = of_log(block, np.arange(TAKEN.size), ["y"])
    without = of_log(block, np.setdiff1d(np.arange(TAKEN.size), OUT["y"]), [])
    for label in OF_CHAIN:
        np.testing.assert_array_equal(whole.observers[label].xhat, without.observers[label].xhat, err_msg=label)
    x, y = (one.observers["shgo"].xhat for one in (whole, without))
    np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-14)


def test_a_map_of_one_period_is_refused_beside_a_gate() -> None:
    """As is a log in which a sample of it is missing: its map is that of no other period."""
    plant = inline({"a": "b", "b": "-a - 0.1*b"}, {"y": "a"})
    block: Block = {"type": "kkl", "theta": 2}
    times = 0.125 * np.arange(1, 41)
    settings = config(plant, {"O": block}) | {"time": {"start": 0.0, "end": 5.0, "output_step": 0.125}}
    settings["measurement"] = {"noise": NOISE}
    message = "observers.O.type: the step of kkl is that of one period, and a gate leaves samples out"
    with pytest.raises(ConfigError, match=message):
        estimate(source(settings), recording(signal("y", times, np.cos(times), gate=GATE)), sensitivity=False)
    missing = recording(signal("y", np.delete(times, 9), np.cos(np.delete(times, 9))))
    with pytest.raises(ConfigError, match="its map is that of one period, but samples are"):
        estimate(source(settings), missing, sensitivity=False)
    one = experiment(plant, {"O": block}, end=5.0, step=1 / 64, measurement={"sampling": {"period": 0.125}})
    with pytest.raises(ConfigError, match=message):
        Estimator(one, gates={"y": GATE})
