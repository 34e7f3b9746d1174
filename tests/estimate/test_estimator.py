"""Observers on samples that come one after the other: the bits of an estimate of the whole recording."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from examples import Block, experiment, inline
from recordings import NOISE, PENDULUM, START, observers, of_simulation, pendulum, recording, signal

import hgorun
from hgorun.engine.live import Live
from hgorun.errors import ConfigError
from hgorun.estimate.carrying import estimates, one_pass
from hgorun.estimate.completed import completed
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare

MEASUREMENT = {"sampling": {"period": 0.1, "jitter": 0.02}, "noise": NOISE}


def follow(estimator: Estimator, prepared: PreparedEstimate) -> np.ndarray:
    """The estimates at every arrival, shape (samples, m, n)."""
    (one,) = prepared.samples
    found = []
    for taken, known, y in zip(one.taken.tolist(), one.available.tolist(), one.values.tolist(), strict=True):
        estimator.update(taken, {one.output: y}, available=known)
        found.append([x.copy() for x in estimator.estimate().values()])
    return np.array(found)


def at_arrivals(prepared: PreparedEstimate) -> np.ndarray:
    """The same of the whole recording at once."""
    times = prepared.samples[0].available
    raw, _, _ = one_pass(prepared, np.unique(times), prepared.run.step)
    return np.stack(estimates(prepared, np.unique(times), raw), axis=1)


@pytest.mark.costly
@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("gate", [None, 2.5])
def test_samples_one_by_one_give_the_bits_of_the_whole(late: bool, gate: float | None) -> None:
    delay = "0.1 + 0.2*abs(sin(3*t))" if late else "0"
    run = pendulum(observers("shgo", "fhgo2"), measurement=MEASUREMENT | {"delay": delay})
    log = of_simulation(run)
    log = recording(replace(log.outputs["a"], gate=gate))
    prepared = prepare_estimate(completed(run.experiment.source, log, "x", ""), log)
    whole = at_arrivals(prepared)
    # the same noise is stated for both, and the same sampling
    estimator = Estimator(prepared.experiment, gates={} if gate is None else {"a": gate})
    found = follow(estimator, prepared)
    assert np.array_equal(found[-1], whole[-1])
    if late:  # samples on their way cut steps of the whole run that a stream does not know of yet
        np.testing.assert_allclose(found, whole, rtol=0, atol=1e-6)
    else:
        assert np.array_equal(found, whole)
    assert not any(estimator.lost.values())
    assert estimator.t == prepared.samples[0].available[-1]


@pytest.fixture(name="small")
def of_pendulum() -> Experiment:
    return experiment(PENDULUM, observers("shgo"), end=2, step=0.01, measurement={"sampling": {"period": 0.1}})


def test_what_is_predicted_changes_nothing(small: Experiment) -> None:
    one, other = Estimator(small), Estimator(small, remembered=0)
    for k in range(1, 30):
        one.update(0.1 * k, {"a": np.sin(0.1 * k)})
        other.update(0.1 * k, {"a": np.sin(0.1 * k)})
        ahead = one.predict(0.1 * k + 0.05)["shgo"]
        assert abs(ahead[0] - np.sin(0.1 * k + 0.05)) < 0.3
        assert np.array_equal(one.predict(0.1 * k)["shgo"], other.estimate()["shgo"])


def test_what_is_predicted_on_a_grid_takes_as_many_steps_as_the_way_is_long(
    small: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimator, advanced = Estimator(small), []
    estimator.update(0.1, {"a": 0.1})
    through = Live.advance

    def advance(live: Live, t: float, regime: int) -> None:
        advanced.append(t - live.t)
        through(live, t, regime)

    monkeypatch.setattr(Live, "advance", advance)
    times = np.linspace(0.1, 3.0, 50).tolist()
    found = list(estimator.predictions(times))
    assert sum(advanced) == pytest.approx(2.9)
    assert [t for t, _ in found] == times
    for t, ahead in found[::7]:  # other steps, the same to their error
        np.testing.assert_allclose(ahead["shgo"], estimator.predict(t)["shgo"], rtol=0, atol=1e-6)
    assert estimator.t == 0.1


def test_whoever_is_interrupted_while_he_predicts_has_lost_nothing(
    small: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimator = Estimator(small)
    estimator.update(0.1, {"a": 0.1})
    before, through = estimator.checkpoint(), Live.advance

    def interrupted(live: Live, t: float, regime: int) -> None:
        through(live, t, regime)
        raise KeyboardInterrupt

    monkeypatch.setattr(Live, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        estimator.predict(1.0)
    assert estimator.checkpoint() == before


def test_a_checkpoint_goes_on_with_the_same_bits(small: Experiment) -> None:
    one = Estimator(small, gates={"a": 4})
    for k in range(1, 15):
        one.update(0.1 * k, {"a": np.sin(0.1 * k)})
    stored = one.checkpoint()
    two = Estimator(small, gates={"a": 4})
    two.restore(stored)
    for k in range(15, 30):
        for estimator in (one, two):
            estimator.update(0.1 * k, {"a": np.sin(0.1 * k) + 10 * (k == 20)})
        assert np.array_equal(one.estimate()["shgo"], two.estimate()["shgo"])
    assert one.checkpoint() == two.checkpoint()
    for wrong, message in ((b"", "not a checkpoint"), (stored[:200], "damaged"), (stored + b"0", "not end where")):
        with pytest.raises(ConfigError, match=message):
            two.restore(wrong)
    with pytest.raises(ConfigError, match="another configuration"):
        Estimator(small.varied({"observers.shgo.theta": 3})).restore(stored)


def test_inputs_come_with_samples() -> None:
    plant = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, "a", inputs={"u": "where(t < 0.95, 0.3, -0.2)"})
    blocks = {"o": {"type": "shgo", "theta": 2, "poles": -1, "initial": START}}
    whole = experiment(plant, blocks, end=2, step=0.01, measurement={"sampling": {"period": 0.1}})
    of_time, given = Estimator(whole), Estimator(whole, inputs=("u",))
    with pytest.raises(ValueError, match=r"no output is called 'u'; .*; u is an input, given as u=\{'u': "):
        given.update(0.0, {"u": 0.3})
    given.update(0.0, {}, u={"u": 0.3})
    for k in range(1, 20):
        if k == 10:
            given.update(0.95, {}, u={"u": -0.2})
        for estimator in (of_time, given):
            estimator.update(0.1 * k, {"a": 0.1 * k})
    np.testing.assert_allclose(of_time.estimate()["o"], given.estimate()["o"], atol=1e-3)


def test_observers_that_jump_are_followed() -> None:
    blocks: dict[str, Block] = {"reduced": {"type": "reduced_sampled", "H": 3, "initial": {"b": 1}}}
    run = prepare(experiment(PENDULUM, blocks, end=4, step=0.01, measurement={"sampling": {"period": 0.1}}))
    log = of_simulation(run)
    prepared = prepare_estimate(completed(run.experiment.source, log, "x", ""), log)
    assert np.array_equal(follow(Estimator(prepared.experiment), prepared), at_arrivals(prepared))


def test_what_cannot_be_followed_is_said(small: Experiment) -> None:
    estimator = Estimator(small, remembered=3)
    estimator.update(1.0, {"a": float("nan")})
    for call, message in (
        (lambda: estimator.update(0.5, {"a": 1}), "before 1, which has been reached"),
        (lambda: estimator.update(1.7e9, {"a": 1}), "time.start may be missing"),
        (lambda: estimator.predict(float("inf")), "time.start may be missing"),
        (lambda: estimator.update(2, {"b": 1}), "no output is called 'b'"),
        (lambda: estimator.update(2, {"a": 1}, u={"u": 1}), "not given with samples"),
        (lambda: estimator.update(3, {"a": 1}, available=2), "after it was known"),
        (lambda: estimator.predict(float("nan")), "is before"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    for k in range(5):
        estimator.update(2.0 + k, {"a": 0})
    with pytest.raises(ValueError, match=r"is remembered \(events: 3, since 3\): begin anew with a larger"):
        estimator.update(1.5, {"a": 1}, available=7.0)
    with pytest.raises(ValueError, match=r"taken at -0.5 is before 0, where estimates begin \(time.start\)"):
        estimator.update(-0.5, {"a": 1}, available=7.0)
    with pytest.raises(ConfigError, match="unknown input 'u'"):
        Estimator(small, inputs=("u",))
    adaptive = small.varied({"solver": {"method": "dopri5", "rtol": 1e-6}})
    with pytest.raises(ConfigError, match="fixed"):
        Estimator(adaptive)
    assert estimator.states == ("a", "b")
    assert estimator.labels == ("shgo",)
    assert hgorun.Estimator is Estimator


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.1, 1.0), r"y: expected numbers by name, as \{'a': 0.5\}, found 1.0"),
        ((0.1, None), "y: expected numbers by name"),
        ((None, {"a": 1}), "t: expected a number, found None"),
        (("0.1", {"a": 1}), "t: expected a number, found '0.1'"),
        ((0.1, {"a": [1, 2]}), r"y\['a'\]: expected a number"),
        ((0.1, {"a": 1}, "later"), "available: expected a number"),
        ((0.1, {"a": 1}, None, 0.3), "u: expected numbers by name"),
    ],
)
def test_what_is_no_sample_is_said(small: Experiment, arguments: tuple[Any, ...], message: str) -> None:
    estimator = Estimator(small)
    with pytest.raises(TypeError, match=message):
        estimator.update(*arguments)
    with pytest.raises(TypeError, match="checkpoint: expected the bytes of checkpoint"):
        estimator.restore("abc")  # type: ignore[arg-type]  # that is the point
    with pytest.raises(TypeError, match="t: expected a number"):
        estimator.predict(None)  # type: ignore[arg-type]  # as above
    assert estimator.t == 0
    estimator.restore(bytearray(estimator.checkpoint()))


@pytest.mark.parametrize("blocks", [observers("shgo", "fhgo2"), {"K": {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01}}])
def test_many_samples_at_once_have_the_bits_of_one_after_the_other(blocks: dict[str, Block]) -> None:
    plant = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, {"y": "a", "z": "b"}, inputs={"u": "0"})
    if "K" not in blocks:
        plant = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, "a", inputs={"u": "0"})
    whole = experiment(plant, blocks, end=2, step=0.01, measurement={"sampling": {"period": 0.1}})
    one, many = (Estimator(whole, inputs=("u",), remembered=0) for _ in range(2))
    rng, count = np.random.default_rng(1), 300
    t = np.cumsum(rng.choice([0, 0.005, 0.02, 0.033], size=count))
    names = list(one.kinds)
    kinds, values = rng.integers(0, len(names), count), rng.normal(0.0, 0.3, count)

    def take(estimator: Estimator, k: int) -> np.ndarray:
        sample = {names[kinds[k]]: float(values[k])}
        estimator.update(float(t[k]), {} if "u" in sample else sample, u=sample if "u" in sample else None)
        return np.concatenate(list(estimator.estimate().values()))

    expected = np.array([take(one, k).copy() for k in range(count)])
    found, at, calls = [], 0, 0
    while at < count:
        some = min(many.at_once(t[at:], kinds[at:]), 70)
        if some:
            part = slice(at, at + some)
            estimates = many.update_many(t[part], kinds[part], values[part])
            found += list(np.concatenate([xhat for xhat, _ in estimates.values()], axis=1))
            assert not any(lost.any() for _, lost in estimates.values())
        else:  # of an output that is heard for the first time
            found.append(take(many, at).copy())
        at, calls = at + max(some, 1), calls + 1
    assert np.array_equal(found, expected)
    assert one.checkpoint() == many.checkpoint()
    assert calls < 15 or "K" in blocks  # which is corrected by both outputs together


def test_samples_are_taken_together_only_where_nothing_is_decided_in_between(small: Experiment) -> None:
    t, kinds = np.array([1.0, 1.1, 1.05, 1.2]), np.zeros(4, dtype=np.int64)
    estimators = [Estimator(small, remembered=0), Estimator(small), Estimator(small, gates={"a": 4}, remembered=0)]
    assert [one.at_once(t, kinds) for one in estimators] == [0, 0, 0]  # nothing has been heard
    for one in estimators:
        one.update(0.9, {"a": 0.1})
    assert [one.at_once(t, kinds) for one in estimators] == [2, 0, 0]  # then time runs backwards
    assert estimators[0].at_once(t - 0.5, kinds) == 0


def test_from_when_on_an_observer_is_lost_is_known_of_many_samples() -> None:
    blocks = {"o": {"type": "shgo", "theta": 60, "poles": -1, "initial": START}}
    whole = experiment(PENDULUM, blocks, end=2, step=0.05, measurement={"sampling": {"period": 0.1}})
    one, many = Estimator(whole, remembered=0), Estimator(whole, remembered=0)
    t = np.arange(1, 400, dtype=np.float64) * np.float64(0.1)
    lost = []
    for moment in t.tolist():
        one.update(moment, {"a": 0.1})
        lost.append(one.lost["o"])
    many.update(t[0], {"a": 0.1})
    _, found = many.update_many(t[1:], np.zeros(t.size - 1, dtype=np.int64), np.full(t.size - 1, 0.1))["o"]
    assert found.tolist() == lost[1:]
    assert any(lost)
    assert not all(lost)


TWO = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"y": "a", "z": "b**2/2 - cos(a)"})
EKF: Block = {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01, "initial": START}


@pytest.mark.costly
def test_a_filter_goes_back_to_late_samples_of_another_output() -> None:
    """One output at once, the other half a second late, both taken together at times: the bits of the whole."""
    taken = np.array([0.25 * k for k in range(1, 17)])
    second = taken[1:-2:2]
    log = recording(signal("y", taken, np.sin(taken)), signal("z", second, 0.3 * np.cos(second) - 0.7, second + 0.5))
    of_both = experiment(TWO, {"K": EKF, "R": {"type": "ekf", "Q": {"b": 1}, "R": 0.1}}, end=4, step=0.01)
    prepared = prepare_estimate(completed(of_both.source, log, "x", ""), log)
    since = np.asarray(taken - prepared.experiment.origin)
    raw, _, _ = one_pass(prepared, since, prepared.run.step)
    whole = estimates(prepared, since, raw)
    estimator = Estimator(prepared.experiment)
    for k, t in enumerate(taken.tolist()):
        estimator.update(t, {"y": float(np.sin(t))})
        if t - 0.5 in second:
            estimator.update(t - 0.5, {"z": float(0.3 * np.cos(t - 0.5) - 0.7)}, available=t)
        for j, x in enumerate(estimator.estimate().values()):
            assert np.array_equal(x, whole[j][k])


def test_a_filter_takes_samples_in_any_order() -> None:
    taken = 0.25 * np.arange(1, 13)
    known = taken + 0.25 * (5 * np.arange(12) % 4)
    log = recording(signal("a", taken, np.sin(taken), known))
    one = experiment(PENDULUM, {"K": EKF}, end=4, step=0.01)
    prepared = prepare_estimate(completed(one.source, log, "x", ""), log)
    end = np.array([3.75]) - prepared.experiment.origin
    raw, _, _ = one_pass(prepared, end, prepared.run.step)
    estimator = Estimator(prepared.experiment)
    for t, available in sorted(zip(taken.tolist(), known.tolist(), strict=True), key=lambda pair: pair[::-1]):
        estimator.update(t, {"a": float(np.sin(t))}, available=available)
    found = estimator.predict(3.75)["K"]
    np.testing.assert_allclose(found, estimates(prepared, end, raw)[0][0], rtol=0, atol=1e-9)


def test_late_samples_that_a_stream_leaves_out_or_cannot_take() -> None:
    drop = Estimator(experiment(PENDULUM, {"K": EKF | {"late": "drop"}}, end=4, step=0.01))
    without = Estimator(experiment(PENDULUM, {"K": EKF | {"late": "drop"}}, end=4, step=0.01))
    for estimator in (drop, without):
        estimator.update(0.5, {"a": 0.4})
    drop.update(0.3, {"a": 5.0}, available=0.8)
    assert drop.t == 0.8
    np.testing.assert_allclose(drop.predict(1.0)["K"], without.predict(1.0)["K"], rtol=0, atol=1e-9)
    mixed = Estimator(experiment(PENDULUM, {"K": EKF, **observers("shgo")}, end=4, step=0.01))
    mixed.update(0.5, {"a": 0.4})
    with pytest.raises(ValueError, match="treat late samples alike"):
        mixed.update(0.3, {"a": 0.4}, available=0.8)


@pytest.mark.costly
def test_late_samples_after_a_checkpoint_are_taken_in_as_without_it(small: Experiment) -> None:
    """A stream that is killed and restored at any moment goes on with the same bits."""
    rng = np.random.default_rng(8)
    taken = np.arange(1, 30) * 0.1
    known = taken + rng.uniform(0, 0.35, taken.size)
    order = np.argsort(known)
    whole, restored = Estimator(small), Estimator(small)
    for k in order:
        for estimator in (whole, restored):
            estimator.update(float(taken[k]), {"a": np.sin(taken[k])}, available=float(known[k]))
        assert np.array_equal(whole.estimate()["shgo"], restored.estimate()["shgo"])
        stored = restored.checkpoint()
        restored = Estimator(small)
        restored.restore(stored)


def test_a_sample_older_than_all_that_is_remembered_is_refused(small: Experiment) -> None:
    estimator = Estimator(small, remembered=0)
    estimator.update(1.0, {"a": 0.5})
    with pytest.raises(ValueError, match=r"is remembered \(events: 0\)"):
        estimator.update(0.5, {"a": 0.5}, available=1.2)


def test_a_checkpoint_of_fewer_events_goes_on_with_more(small: Experiment) -> None:
    few, many = Estimator(small, remembered=3), Estimator(small, remembered=50)
    for k in range(10):
        few.update(0.1 * k, {"a": 0.5})
        many.update(0.1 * k, {"a": 0.5})
    more = Estimator(small, remembered=50)
    more.restore(few.checkpoint())
    with pytest.raises(ValueError, match=r"events: 50, since 0.6"):  # what was forgotten stays so
        more.update(0.45, {"a": 1}, available=1.0)
    for estimator in (more, many):
        for k in range(10, 20):
            estimator.update(0.1 * k, {"a": 0.4})
        estimator.update(0.95, {"a": 1}, available=2.0)
    assert np.array_equal(more.estimate()["shgo"], many.estimate()["shgo"])


def test_a_stamp_of_another_clock_is_not_taken_with_others(small: Experiment) -> None:
    estimator = Estimator(small, remembered=0)
    estimator.update(1.0, {"a": 0.5})
    assert estimator.at_once(np.array([1.1, 1.2, 1.7e9]), np.zeros(3, dtype=np.int64)) == 2


def test_times_in_messages_are_told_apart(small: Experiment) -> None:
    """Six digits of seconds since 1970 are days."""
    estimator = Estimator(small)
    estimator.update(12.345678, {"a": 0.0})
    with pytest.raises(ValueError, match=r"t = 12\.345671 is before 12\.345678,"):
        estimator.update(12.345671, {"a": 0.0})
