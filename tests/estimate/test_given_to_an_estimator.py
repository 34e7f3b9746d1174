"""What an estimator takes for a sample, what it refuses, and which checkpoints are its own."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from examples import Block, experiment, inline

from hgorun.errors import ConfigError
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

PLANT = inline({"a": "b", "b": "-sin(a) + u + v"}, {"y": "a"}, inputs={"u": "0", "v": "0"})
SHGO: Block = {"type": "shgo", "theta": 2, "poles": -1, "initial": {"b": 1}}


@pytest.fixture(name="pushed", scope="module")
def of_a_pushed_pendulum() -> Experiment:
    return experiment(PLANT, {"o": SHGO}, end=2, step=0.01, measurement={"sampling": {"period": 0.1}})


def test_a_sample_that_is_nan_is_missing_and_one_that_is_infinite_is_refused(pushed: Experiment) -> None:
    estimator, without = (Estimator(pushed, inputs=["u"]) for _ in range(2))
    for one in (estimator, without):
        one.update(0.1, {"y": 0.1}, u={"u": 0.5})
    estimator.update(0.2, {"y": float("nan")})
    assert estimator.t == 0.2
    without.update(0.2, {})
    assert np.array_equal(estimator.estimate()["o"], without.estimate()["o"])
    before = estimator.checkpoint()
    message = r"\['.'\]: expected a finite number, or NaN for a missing value, found -?inf"
    with pytest.raises(ValueError, match=message):
        estimator.update(0.3, {"y": np.inf})
    with pytest.raises(ValueError, match=message):
        estimator.update(0.3, {}, u={"u": -np.inf})
    assert estimator.checkpoint() == before


def test_an_input_that_is_nan_stays_what_it_is(pushed: Experiment) -> None:
    estimator, without = (Estimator(pushed, inputs=["u"]) for _ in range(2))
    for one in (estimator, without):
        one.update(0.0, {}, u={"u": 0.5})
    estimator.update(0.2, {}, u={"u": float("nan")})
    without.update(0.2, {})
    for one in (estimator, without):
        one.update(0.4, {"y": 0.2})
    assert np.isfinite(estimator.estimate()["o"]).all()
    assert np.array_equal(estimator.estimate()["o"], without.estimate()["o"])


def test_an_input_among_the_samples_is_told_its_place(pushed: Experiment) -> None:
    estimator = Estimator(pushed, inputs=["u"])
    with pytest.raises(
        ValueError, match=r"no output is called 'u'; there are y; u is an input, given as u=\{'u': \.\.\.\}$"
    ):
        estimator.update(0.0, {"u": 1.0})
    with pytest.raises(ValueError, match=r"v is an input, given as u=\{'v': \.\.\.\} where inputs=\['v'\] says"):
        estimator.update(0.0, {"v": 1.0})


def test_a_checkpoint_of_other_gates_is_refused(pushed: Experiment) -> None:
    gated, free = Estimator(pushed, gates={"y": 4}), Estimator(pushed)
    gated.update(0.1, {"y": 0.1})
    stored = gated.checkpoint()
    for other, found in ((free, r"\{\}"), (Estimator(pushed, gates={"y": 5}), r"\{y: 5\}")):
        with pytest.raises(ConfigError, match=rf"was made with gates \{{y: 4\}}, and this estimator has {found}"):
            other.restore(stored)
        assert other.t == 0.0
    Estimator(pushed, gates={"y": 4.0}).restore(stored)
    with pytest.raises(ConfigError, match=r"was made with gates \{\}, and"):
        gated.restore(free.checkpoint())


def test_a_checkpoint_of_another_std_or_other_inputs_is_refused(pushed: Experiment) -> None:
    made, other = Estimator(pushed, std={"y": 0.2}), Estimator(pushed, std={"y": 0.1})
    stored = made.checkpoint()
    with pytest.raises(ConfigError, match=r"was made with std \{y: 0.2\}, and this estimator has \{y: 0.1\}: give"):
        other.restore(stored)
    with pytest.raises(ConfigError, match=r"was made with std \{y: 0.2\}, and this estimator has \{\}"):
        Estimator(pushed).restore(stored)
    Estimator(pushed, std={"y": 0.2}).restore(stored)
    with pytest.raises(ConfigError, match=r"was made with inputs \{u\}, and this estimator has \{\}"):
        Estimator(pushed).restore(Estimator(pushed, inputs=["u"]).checkpoint())


@pytest.mark.parametrize(
    "measurement",
    [
        {"noise": [{"type": "gaussian", "std": "1/5"}]},
        {"outputs": {"y": {"noise": [{"type": "gaussian", "std": 0.2}]}}},
    ],
    ids=["of all outputs", "of one"],
)
def test_a_std_that_is_that_of_the_configuration_makes_no_other_one(measurement: Block) -> None:
    run = experiment(PLANT, {"o": SHGO}, end=2, step=0.01, measurement={"sampling": {"period": 0.1}, **measurement})
    given, not_given = Estimator(run, std={"y": 0.2}), Estimator(run)
    for made, other in ((given, not_given), (not_given, given)):
        made.update(made.t + 0.1, {"y": 0.1})
        other.restore(made.checkpoint())
        assert other.t == made.t
    if "noise" in measurement:
        with pytest.raises(ConfigError, match=r"was made with std \{y: 0.3\}, and this estimator has \{y: 0.2\}"):
            not_given.restore(Estimator(run, std={"y": 0.3}).checkpoint())


def test_a_std_that_is_no_number_is_told_with_its_key(pushed: Experiment) -> None:
    with pytest.raises(ConfigError, match=r"measurement\.outputs\.y\.noise\.0\.std: .*found -0\.2"):
        Estimator(pushed, std={"y": -0.2})


def test_a_checkpoint_that_does_not_tell_its_gates_is_an_older_one(pushed: Experiment) -> None:
    estimator = Estimator(pushed)
    estimator.update(0.1, {"y": 0.1})
    magic, head, rest = estimator.checkpoint().split(b"\n", 2)
    told = json.loads(head)
    del told["gates"]
    other = Estimator(pushed)
    other.restore(b"\n".join([magic, json.dumps(told).encode(), rest]))
    assert other.t == 0.1
    assert np.array_equal(other.estimate()["o"], estimator.estimate()["o"])


@pytest.mark.parametrize("treatment", ["innovation", "replay"])
def test_times_that_differ_by_less_than_the_clock_of_the_run_tells_are_one(treatment: str) -> None:
    """0.7 and the next double after it are the same time since a start at -10."""
    plant = inline({"a": "b", "b": "-sin(a)"}, {"y": "a"})
    block = {**SHGO, "late": treatment}
    time = {"start": -10, "end": 2, "output_step": 0.1}
    run = experiment(plant, {"o": block}, step=0.01, time=time, measurement={"sampling": {"period": 0.1}})
    late, on_time = Estimator(run, inputs=()), Estimator(run, inputs=())
    for t, known, y in ((0.3, np.nextafter(0.3, 1), 1.0), (0.6, 0.6, 1.5), (0.7, np.nextafter(0.7, 1), 2.0)):
        late.update(t, {"y": y}, available=float(known))
        on_time.update(t, {"y": y})
    assert np.array_equal(late.predict(0.8)["o"], on_time.predict(0.8)["o"])


def test_a_late_sample_that_is_refused_has_not_been() -> None:
    """Its observer starts with the derivative of the output, which depends on an input that was not known then."""
    plant = inline({"a": "b/f", "b": "-sin(a)"}, {"y": "a"}, inputs={"f": "1"})
    block = {"type": "eso", "omega_o": 3, "late": "replay"}
    run = experiment(plant, {"o": block}, end=2, step=0.02, measurement={"sampling": {"period": 0.1}})
    estimator = Estimator(run, inputs=["f"])
    estimator.update(0.2, {}, u={"f": 1.0})
    for t in (0.2, 0.3):
        estimator.update(t, {"y": 0.1})
    before, here = estimator.checkpoint(), estimator.estimate()["o"]
    with pytest.raises(ValueError, match="f is not known yet"):
        estimator.update(0.1, {"y": 0.1}, available=0.35)
    assert np.array_equal(estimator.estimate()["o"], here)
    assert np.isfinite(here).all()
    assert estimator.t == 0.3
    again = Estimator(run, inputs=["f"])
    again.restore(before)
    for one in (estimator, again):
        one.update(0.4, {"y": 0.2})
        one.update(0.35, {"y": 0.15}, available=0.45)
    assert np.array_equal(estimator.estimate()["o"], again.estimate()["o"])


def test_predictions_do_not_see_what_happens_between_two_of_them(pushed: Experiment) -> None:
    estimator, alone = (Estimator(pushed, inputs=[]) for _ in range(2))
    seen, expected = estimator.predictions([0.1, 0.4]), alone.predictions([0.1, 0.4])
    first, _ = next(seen), next(expected)
    assert first[0] == 0.1
    estimator.update(0.6, {"y": 3.0})
    assert np.array_equal(next(seen)[1]["o"], next(expected)[1]["o"])
    assert estimator.t == 0.6


@pytest.mark.parametrize("gate", ["3", float("nan"), 0, -1, None])
def test_a_gate_is_a_positive_number(pushed: Experiment, gate: float) -> None:
    with pytest.raises(ConfigError, match=r"^gates\['y'\]: expected a number"):
        Estimator(pushed, gates={"y": gate}, std={"y": 0.1})


@pytest.mark.parametrize("key", ["gates", "std"])
def test_gates_and_deviations_are_given_by_name(pushed: Experiment, key: str) -> None:
    given: dict[str, Any] = {key: 3}
    with pytest.raises(ConfigError, match=rf"^{key}: expected numbers by name, as \{{'a': 0.5\}}, found 3$"):
        Estimator(pushed, **given)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gates": {"Y": 3}}, "gates: no output is called 'Y'. Did you mean `y`? Known: y"),
        ({"inputs": "u"}, "inputs: expected a list of names, such as ['u'], found 'u'"),
        ({"inputs": {"v": 1}}, "inputs: expected a list of names, such as ['v'], found a mapping"),
        ({"inputs": 3}, "inputs: expected a list of names, such as ['u'], found 3"),
        ({"inputs": ["u", 3]}, "inputs: expected a list of names, found 3 in it"),
    ],
)
def test_names_are_given_in_lists_and_are_known(pushed: Experiment, given: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Estimator(pushed, **given)
    assert str(caught.value) == said


def test_inputs_are_any_names_one_after_the_other(pushed: Experiment) -> None:
    for inputs in (("u", "v"), {"u", "v"}, (name for name in "uv")):
        Estimator(pushed, inputs=inputs).update(0.1, {"y": 0.1}, u={"u": 0.5, "v": 1})  # type: ignore[arg-type]  # more than is promised


@pytest.mark.parametrize("remembered", [-1, 2.5, "x"])
def test_events_are_remembered_in_whole_numbers(pushed: Experiment, remembered: int) -> None:
    with pytest.raises(ConfigError, match="remembered: expected a whole number of events, 0 or more, found"):
        Estimator(pushed, remembered=remembered)
