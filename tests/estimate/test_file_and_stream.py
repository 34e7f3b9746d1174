"""One rule for a file and a stream: what a log may have, both take with the same bits, or both refuse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from examples import Block, inline
from recordings import held_input, recording, signal, source

from hgorun import Experiment
from hgorun.errors import HgorunError
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.observers.base import OBSERVERS, CorrectedObserver
from hgorun.testing.cases import TWO_OUTPUTS, Case, Subject, block_of

GRID = 1 / 32  # of all times; two steps are as long
EVEN = 4 * GRID * np.arange(13)
UNEVEN = GRID * np.cumsum([0, 4, 4, 3, 5, 4, 2, 6, 4, 4, 3, 4, 4])
LATES = (None, "innovation", "replay", "drop")
Estimates = Mapping[int, np.ndarray]  # by multiples of the grid


def with_late(**late: int) -> np.ndarray:
    """When the even samples are known, some of them late, by multiples of the grid."""
    known = EVEN.copy()
    for name, by in late.items():
        known[int(name[1:])] += by * GRID
    return known


@dataclass(frozen=True, eq=False)
class Samples:
    """What is sampled of all outputs, of which the last lacks one sample, or the first has an outlier, where said."""

    taken: np.ndarray
    known: np.ndarray
    lacks: bool = False
    gated: bool = False

    def of(self, number: int, outputs: int, level: float) -> np.ndarray:
        y = level + np.cos(self.taken + number) / 2
        if self.lacks and number == outputs - 1:
            y[5] = np.nan
        if self.gated and number == 0:
            y[9] += 100.0
        return y


LOGS: Mapping[str, Samples] = {
    "even": Samples(EVEN, EVEN),
    "no sample at the start": Samples(EVEN + 4 * GRID, EVEN + 4 * GRID),
    "one sample": Samples(EVEN[3:4], EVEN[3:4]),
    "a gap": Samples(np.delete(EVEN, 5), np.delete(EVEN, 5)),
    "uneven": Samples(UNEVEN, UNEVEN),
    "one output missing": Samples(EVEN, EVEN, lacks=True),
    "two of one time": Samples(np.insert(EVEN, 6, EVEN[6]), np.insert(EVEN, 6, EVEN[6])),
    "an outlier": Samples(EVEN, EVEN, gated=True),
    "a late sample": Samples(EVEN, with_late(_5=2)),
    "a late sample, after the next": Samples(EVEN, with_late(_5=6)),
    "all late": Samples(EVEN, EVEN + 2 * GRID),
    "a late sample between": Samples(np.insert(EVEN, 5, EVEN[4] + GRID), np.insert(EVEN, 5, EVEN[4] + 2 * GRID)),
    "a late sample and an outlier": Samples(EVEN, with_late(_5=2), gated=True),
    "a late sample next to an outlier": Samples(EVEN, with_late(_8=6), gated=True),
}
VARIANTS: Mapping[str, Block] = {
    "tracking": {"h_0": 4 * GRID},
    "aekf": {"update": "jump", "copies": 2, "interval": 4 * GRID},
    "hg_ekf": {"update": "jump", "interval": 4 * GRID},
    "levant": {"discretisation": "implicit"},
}


def of_file(text: Block, log: Samples, ys: Mapping[str, np.ndarray]) -> Estimates:
    signals = []
    for name, y in ys.items():
        there = ~np.isnan(y)
        gate = 5.0 if log.gated else None
        signals.append(signal(name, log.taken[there], y[there], log.known[there], gate=gate))
    xhat = estimate(source(text), recording(*signals), sensitivity=False).observers["O"].xhat
    return dict(enumerate(xhat))


def of_stream(text: Block, log: Samples, ys: Mapping[str, np.ndarray]) -> Estimates:
    estimator = Estimator(Experiment(text), gates=dict.fromkeys(ys, 5.0) if log.gated else {})
    found = {}
    for k in np.lexsort((log.taken, log.known)).tolist():
        estimator.update(log.taken[k], {name: float(y[k]) for name, y in ys.items()}, float(log.known[k]))
        found[round(log.known[k] / GRID)] = estimator.estimate()["O"].copy()
    return found


def of_both(case: Case, log: Samples, late: str | None) -> tuple[Estimates | str, Estimates | str]:
    """Estimates, or why there are none."""
    level = 1.5 if case.plant_keys["type"] == "contois" else 0.0
    outputs = case.plant.model.outputs
    ys = {name: log.of(i, len(outputs), level) for i, name in enumerate(outputs)}
    end = float(log.known.max())
    keys = {"late": late} if late else {}
    first = float(log.taken[0])
    text: Block = {
        "time": {"start": 0.0, "end": end, "output_step": GRID},
        "plant": dict(case.plant_keys),
        "observers": {"O": {"type": case.name, **case.keys, "initial": case.aside, **keys}},
        "measurement": {
            "sampling": {"period": 4 * GRID, **({"offset": first} if first else {})},
            "noise": [{"type": "gaussian", "std": 0.05}],
        },
        "solver": {"method": "rk4", "step": GRID / 2},
    }
    found: list[Estimates | str] = []
    for way in (of_file, of_stream):
        try:
            found.append(way(text, log, ys))
        except (HgorunError, ValueError) as error:
            found.append(str(error))
    return found[0], found[1]


def cases(name: str, keys: Block) -> Iterator[Case]:
    """On a plant of one output, where it takes one, and on one of two."""
    first, *others = Subject(OBSERVERS.find(name), name, keys, None).cases
    yield replace(first, keys={key: value for key, value in first.keys.items() if key != "period"})
    yield from (one for one in others if one.plant_keys is TWO_OUTPUTS)


def compared(name: str, keys: Block, logs: Mapping[str, Samples]) -> set[str]:
    """What is refused of some logs; all else has the same bits."""
    refused = set()
    for case in cases(name, keys):
        for label, log in logs.items():
            for late in LATES if (log.known > log.taken).any() or label == "even" else LATES[:1]:
                what = f"{name} {keys}: {label}, late: {late}"
                file, stream = of_both(case, log, late)
                if isinstance(file, str) or isinstance(stream, str):
                    assert isinstance(file, str), f"{what}: only a stream refuses: {stream}"
                    assert isinstance(stream, str), f"{what}: only a file refuses: {file}"
                    refused.add(f"{label}, {late}")
                    continue
                for row, xhat in stream.items():
                    np.testing.assert_array_equal(xhat, file[row], err_msg=f"{what}, t = {row * GRID}")
    return refused


def some(*labels: str) -> dict[str, Samples]:
    return {label: LOGS[label] for label in labels}


@pytest.mark.costly
@pytest.mark.parametrize(
    ("name", "keys", "labels", "refused"),
    [
        ("luenberger_exact", {}, ["a gap", "uneven", "one output missing"], {"uneven, None"}),
        ("tracking", VARIANTS["tracking"], ["even", "a gap"], {"a gap, None", "even, innovation"}),
        ("aekf", VARIANTS["aekf"], ["a gap", "uneven"], {"uneven, None"}),
        ("deadbeat", {}, ["even"], {"even, innovation", "even, replay"}),
        ("ekf", {}, ["even"], {"even, innovation"}),
    ],
)
def test_a_stream_refuses_what_a_file_refuses(name: str, keys: Block, labels: list[str], refused: set[str]) -> None:
    assert compared(name, keys, some(*labels)) == refused


@pytest.mark.parametrize("name", ["shgo", "ekf"])
def test_samples_of_one_time_are_followed_by_both(name: str) -> None:
    assert compared(name, {}, some("one sample")) == set()


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize("name", OBSERVERS.names())
def test_every_observer_has_one_rule(name: str) -> None:
    for keys in ({}, VARIANTS.get(name)):
        if keys is not None:
            refused = compared(name, keys, LOGS)
            assert ("even, None" in refused) is (name == "predictor_chain")  # which is not for data


def test_a_stream_asks_who_may_refuse_times() -> None:
    """Also with unknown inputs, whose class is another one."""
    jumps: Block = {"type": "aekf", "update": "jump", "theta_1": 2.0, "m": 0.05, "interval": 0.1, "extend": 1}
    other: Block = {"type": "hg_ekf", "update": "jump", "theta": 2, "extend": 1}
    for block, asks in ((jumps, True), (other, False)):
        observer = block_of(OBSERVERS.find(block["type"]), block)
        assert isinstance(observer, CorrectedObserver)
        assert observer.asks_of_times is asks


PLANT = inline({"a": "b", "b": "-a"}, {"y": "a"})


def test_a_restored_stream_knows_when_the_last_sample_was() -> None:
    """A sample that is refused has not been, one that is lost is none."""
    text: Block = {
        "time": {"start": 1.0, "end": 2.0, "output_step": 0.125},
        "plant": PLANT,
        "observers": {"O": {"type": "luenberger_exact", "poles": -2}},
        "measurement": {"sampling": {"period": 0.125}},
        "solver": {"step": 1 / 64},
    }
    estimator, other = Estimator(Experiment(text)), Estimator(Experiment(text))
    for t in (1.0, 1.25):
        estimator.update(t, {"y": 1.0})
    other.restore(estimator.checkpoint())
    for one in (estimator, other):
        with pytest.raises(ValueError, match=r"t = 1.4375: O: the gain is .* samples of y are 0.1875 apart, not"):
            one.update(1.4375, {"y": 1.0})
        one.update(1.5, {"y": 1.0})
    np.testing.assert_array_equal(other.estimate()["O"], estimator.estimate()["O"])


FALLING = inline({"a": "b", "b": "-1/a"}, {"y": "a"}, start=0.0)
STEPPED: Block = {**PLANT, "discretise": "euler"}
UNUSED: Block = {**PLANT, "inputs": {"u": "0"}}


@pytest.mark.parametrize(
    ("plant", "block", "inputs", "message"),
    [
        (FALLING, {"type": "shgo", "theta": 2}, (), "not a finite number at the start of the run: division by zero"),
        (STEPPED, {"type": "hgo_fd", "eps": 0.5}, (), "this steps a simulated plant, and nothing is simulated here"),
        (UNUSED, {"type": "shgo", "theta": 2}, ("u",), r"data\.inputs\.u: nothing depends on this input"),
    ],
    ids=["singular", "discretised", "unused"],
)
def test_what_cannot_be_followed_is_refused_of_both(
    plant: Block, block: Block, inputs: tuple[str, ...], message: str
) -> None:
    text: Block = {
        "time": {"start": 0.0, "end": 1.0, "output_step": 0.125},
        "plant": plant,
        "observers": {"O": {**block, "initial": {"a": 0.0, "b": 0.0}}},
        "solver": {"step": 1 / 64},
    }
    y, u = signal("y", EVEN, np.cos(EVEN)), {name: held_input(name, EVEN, np.sin(EVEN)) for name in inputs}
    with pytest.raises(HgorunError, match=message):
        estimate(source(text), replace(recording(y), inputs=u), sensitivity=False)
    with pytest.raises(HgorunError, match=message):
        Estimator(Experiment({**text, "measurement": {"sampling": {"period": 0.125}}}), inputs=inputs)


def test_a_recorded_input_is_what_it_is_at_the_start() -> None:
    """a' = b, b' = -a/u: were u taken for 0 there, the equations would be said to be singular."""
    plant = inline({"a": "b", "b": "-a/u"}, {"y": "a"}, inputs={"u": "1"})
    text: Block = {
        "time": {"start": 0.0, "end": 1.5, "output_step": 0.125},
        "plant": plant,
        "observers": {"O": {"type": "shgo", "theta": 2, "initial": {"a": 1.0, "b": 0.0}}},
        "solver": {"step": 1 / 64},
    }
    w = np.sqrt(0.5)
    data = recording(signal("y", EVEN, np.cos(w * EVEN)), u=held_input("u", EVEN, np.full(13, 2.0)))
    xhat = estimate(source(text), data, sensitivity=False).observers["O"].xhat
    np.testing.assert_allclose(xhat[-1], [np.cos(1.5 * w), -w * np.sin(1.5 * w)], rtol=0, atol=1e-8)


def singular_with(u: float) -> tuple[Block, Block]:
    """b' = -1/(a u), which is no number where u is 0."""
    plant = inline({"a": "b", "b": "-1/(a*u)"}, {"y": "a"}, inputs={"u": "1"})
    text: Block = {
        "time": {"start": 0.0, "end": 1.5, "output_step": 0.125},
        "plant": plant,
        "observers": {"O": {"type": "shgo", "theta": 2, "initial": {"a": 1.0, "b": 0.0}}},
        "solver": {"step": 1 / 64},
    }
    return text, {**text, "measurement": {"sampling": {"period": 0.125}}}


def test_a_start_that_is_singular_for_its_inputs_is_refused_of_both() -> None:
    """When time goes on; what was refused has not been, and with another input the stream begins."""
    of_file, of_stream = singular_with(0.0)
    message = r"is not a finite number at the start of the run: division by zero, at a = 1, b = 0: "
    data = recording(signal("y", EVEN, np.cos(EVEN)), u=held_input("u", EVEN, np.zeros(13)))
    with pytest.raises(HgorunError, match=message):
        estimate(source(of_file), data, sensitivity=False)
    estimator = Estimator(Experiment(of_stream), inputs=("u",))
    estimator.update(0.0, {"y": 1.0})
    estimator.update(0.0, {}, u={"u": 0.0})
    stored = estimator.checkpoint()
    assert not estimator.at_once(np.array([0.125]), np.array([0]))
    with pytest.raises(ValueError, match=message):
        estimator.update(0.125, {"y": 1.0})
    assert estimator.t == 0.0
    estimator.update(0.0, {}, u={"u": 2.0})
    estimator.update(0.125, {"y": 1.0})
    assert not estimator.any_lost
    restored = Estimator(Experiment(of_stream), inputs=("u",))
    restored.restore(stored)
    with pytest.raises(ValueError, match=message):
        restored.update(0.125, {"y": 1.0})


def test_a_start_that_is_singular_without_its_inputs_names_them() -> None:
    estimator = Estimator(Experiment(singular_with(0.0)[1]), inputs=("u",))
    with pytest.raises(ValueError, match=r"^observers.O: .*; u is not known yet and counts as 0: give it at the"):
        estimator.update(0.125, {"y": 1.0}, u={"u": 2.0})
