"""Observers on recorded data: laws, and a plain integration as an oracle."""

from __future__ import annotations

from csv import DictReader
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from examples import Block, experiment, inline
from recordings import (
    NOISE,
    PENDULUM,
    START,
    assessed_of,
    held_input,
    observers,
    of_simulation,
    pendulum,
    recorded_of,
    recording,
    signal,
    source,
)

from hgorun.data.recording import Recording
from hgorun.errors import ConfigError
from hgorun.estimate.estimate import estimate
from hgorun.estimate.holdout import HoldOut, held_out
from hgorun.result.quantities.quantities import SCORES
from hgorun.result.reading import read
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.tables.metrics import as_json, csv, text

MEASUREMENT = {"sampling": {"period": 0.1, "jitter": 0.02}, "noise": NOISE}


@pytest.mark.costly
@pytest.mark.parametrize("delay", ["0", "0.1 + 0.05*sin(3*t)"], ids=["at once", "late"])
@pytest.mark.parametrize("start", [0.0, 100.0])
def test_the_recording_of_a_simulation_gives_its_bits(delay: str, start: float) -> None:
    run = pendulum(
        observers("shgo", "fhgo2"),
        measurement=MEASUREMENT | {"delay": delay},
        time={"start": start, "end": start + 6, "output_step": 0.1},
    )
    simulated = simulate_prepared(run)
    found = estimate(run.experiment.source, of_simulation(run), sensitivity=False)
    for label, one in simulated.observers.items():
        if start == 0.0:
            assert np.array_equal(found.observers[label].xhat, one.xhat)
        else:  # a recording's times have the digits of its clock
            np.testing.assert_allclose(found.observers[label].xhat, one.xhat, rtol=0, atol=1e-11)


def test_several_rates_and_late_samples_give_the_simulations_bits() -> None:
    plant = inline({"a": "b", "b": "-a + c", "c": "d", "d": "-c - a*b"}, ["a", "c"])
    outputs = {"a": {"sampling": {"period": 0.1}}, "c": {"sampling": {"period": 0.17}, "delay": 0.05}}
    blocks = {"shgo": {"type": "shgo", "theta": 2, "poles": -1, "initial": {"a": 0.0, "c": 0.0}}}
    run = prepare(experiment(plant, blocks, end=4, step=0.01, measurement={"noise": NOISE, "outputs": outputs}))
    found = estimate(run.experiment.source, of_simulation(run), sensitivity=False)
    assert np.array_equal(found.observers["shgo"].xhat, simulate_prepared(run).observers["shgo"].xhat)


def plain_observer(taken: np.ndarray, y: np.ndarray, known: np.ndarray, until: float, u: float = 0.0) -> np.ndarray:
    """The standard high-gain observer of the pendulum on samples, by small steps of Euler's method with theta = 2."""
    h, steps = 1e-4, round(until / 1e-4)
    a, b, alpha, s, held = START["a"], START["b"], 0.0, 0.0, np.nan
    past = np.empty(steps + 1)
    arrivals = list(zip(np.round(known / h).astype(int), np.round(taken / h).astype(int), y, strict=True))
    newest = -1
    for i in range(steps + 1):
        past[i] = a - alpha
        while arrivals and arrivals[0][0] <= i:
            _, then, value = arrivals.pop(0)
            if then >= newest:
                newest, s, held = then, past[then], value
        e = 0.0 if np.isnan(held) else s + alpha - held
        da, db = b - 4 * e, -np.sin(a) - 0.1 * b + u - 4 * e
        a, b, alpha = a + h * da, b + h * db, alpha - h * 4 * e
    return np.array([a, b])


@pytest.mark.costly
@pytest.mark.parametrize("late", [0.0, 0.4])
def test_irregular_samples_as_a_plain_integration_has_them(late: float) -> None:
    rng = np.random.default_rng(3)
    taken = np.sort(np.round(rng.uniform(0.0, 5.0, 25), 3))
    known = np.round(taken + late * rng.uniform(0, 1, taken.size), 3)
    order = np.argsort(known, kind="stable")
    values = np.sin(taken) + 0.05 * rng.standard_normal(taken.size)
    log = recording(signal("a", taken, values, known if late else None))
    config = {"time": {"start": 0, "end": 6, "output_step": 0.5}, "plant": PENDULUM, "observers": observers("shgo")}
    found = estimate(source(config), log, sensitivity=False)
    expected = plain_observer(taken[order], values[order], known[order], 6.0)
    np.testing.assert_allclose(found.observers["shgo"].xhat[-1], expected, atol=2e-3)
    out_of_order = np.count_nonzero(taken[order] < np.maximum.accumulate(taken[order]))
    assert bool(out_of_order) == (late > 0)
    assert np.count_nonzero(~recorded_of(found).outputs["a"].used) == out_of_order
    assert any("after newer ones" in remark for remark in found.remarks) == bool(out_of_order)


def test_a_recorded_input_that_is_held_is_the_same_as_an_expression() -> None:
    plant = inline({"a": "b", "b": "-sin(a) - 0.1*b + u + v"}, "a", inputs={"v": "0.1*t"})
    taken = np.arange(0, 5, 0.1)
    log = recording(signal("a", taken, np.sin(taken)), u=held_input("u", [0, 2, 3], [0.3, -0.2, 0.0]))
    config = {"plant": plant, "observers": observers("shgo"), "solver": {"step": 0.01}}
    found = estimate(source(config), log, sensitivity=False)
    expression = dict(plant, inputs={"u": "where(t < 2, 0.3, where(t < 3, -0.2, 0))", "v": "0.1*t"})
    other = estimate(source(config | {"plant": expression}), recording(log.outputs["a"]), sensitivity=False)
    np.testing.assert_allclose(found.observers["shgo"].xhat, other.observers["shgo"].xhat, rtol=0, atol=1e-12)
    assert found.u[np.searchsorted(found.time, [0, 2.5, 4]), found.inputs.index("u")].tolist() == [0.3, -0.2, 0.0]


def test_what_the_data_decide() -> None:
    """Span, output step and start follow from the data where nothing says otherwise."""
    taken = np.array([2.0, 2.5, 3.0, 3.5, 6.0])
    log = recording(signal("a", taken, [0.7, 0.6, 0.5, 0.4, 0.1]))
    config = {"plant": {k: v for k, v in PENDULUM.items() if k != "initial"}}
    config["observers"] = {"o": {"type": "shgo", "theta": 2, "poles": -1}}
    found = estimate(source(config), log, sensitivity=False)
    assert found.time[[0, 20, -1]].tolist() == [2.0, 2.5, 6.0]
    assert found.observers["o"].xhat[0].tolist() == [0.7, 0.0]
    assert found.kind == "estimate"
    assert found.status == "ok"


def test_an_outlier_is_as_if_it_had_not_come() -> None:
    rng = np.random.default_rng(0)
    taken = np.arange(0, 8, 0.1)
    values = np.sin(taken) + 0.02 * rng.standard_normal(taken.size)
    values[[40, 60]] += 3.0
    config = {
        "time": {"start": 0, "end": 8, "output_step": 0.1}, "plant": PENDULUM, "solver": {"step": 0.02},
        "observers": observers("shgo", "fhgo2") | {"K": {"type": "ekf", "Q": {"b": 0.01}, "R": 4e-4}},
    }  # fmt: skip
    gated = estimate(source(config), recording(signal("a", taken, values, gate=6.0)), sensitivity=False)
    used = recorded_of(gated).outputs["a"].used
    assert np.flatnonzero(~used[:, 0]).tolist() == np.flatnonzero(~used[:, 1]).tolist() == [40, 60]
    assert assessed_of(gated, "shgo").scores["gated"] == {"a": 2.0}
    keep = used[:, 0]
    without = estimate(source(config), recording(signal("a", taken[keep], values[keep])), sensitivity=False)
    for label in ("shgo", "fhgo2", "K"):
        np.testing.assert_allclose(gated.observers[label].xhat, without.observers[label].xhat, rtol=0, atol=1e-6)
    expected = assessed_of(without, "K").scores["nis"]
    assert assessed_of(gated, "K").scores["nis"] == pytest.approx(expected, rel=1e-4)


def test_held_out_samples_are_not_used_and_a_reference_changes_nothing(tmp_path: Path) -> None:
    run = pendulum(observers("shgo", "fhgo2"), measurement=MEASUREMENT, end=20.0, step=0.02)
    whole = of_simulation(run)
    log, aside = held_out(whole, [HoldOut("a", 5)])
    other = replace(log, reference={"b": signal("b", [1.0, 2.0], [0.5, -0.4])})
    found = estimate(run.experiment.source, other, held_out=aside, text="text")
    alone = estimate(run.experiment.source, log, sensitivity=False)
    assert np.array_equal(found.observers["shgo"].xhat, alone.observers["shgo"].xhat)
    scores = assessed_of(found, "shgo").scores
    assert set(scores) >= {"holdout_rmse", "holdout_coverage", "whiteness", "size", "reference_rmse", "sensitivity"}
    assert set(scores) - {"sensitivity"} <= SCORES
    assert 0.05 < scores["holdout_rmse"]["a"] < 0.1  # the noise is 0.05
    assert 0.85 <= scores["holdout_coverage"]["a"] <= 1.0
    assert set(scores["sensitivity"]) == {"theta"}
    assert assessed_of(found, "shgo").no_band == {"b": "nothing measures this state"}
    stored = read(found.save(tmp_path / "estimate.h5"))
    assert as_json(stored) == as_json(found)
    assert as_json(found)["kind"] == "estimate"
    assert np.array_equal(recorded_of(stored).outputs["a"].innovation, recorded_of(found).outputs["a"].innovation)
    assert np.array_equal(recorded_of(stored).held_out["a"].y, aside["a"].values)
    assert np.array_equal(assessed_of(stored, "fhgo2").upper, assessed_of(found, "fhgo2").upper, True)
    assert "holdout_rmse a" in text([stored])
    rows = DictReader(StringIO(csv([replace(stored, units={"a": "rad", "b": "rad/s"})])))
    units = {row["metric"]: row["unit"] for row in rows}
    in_rad = ("holdout_rmse", "holdout_mean", "innovation_mean", "innovation_rms")
    assert {metric: unit for metric, unit in units.items() if unit} == dict.fromkeys(in_rad, "rad") | {
        "reference_rmse": "rad/s"
    }
    assert set(units) > {"holdout_coverage", "whiteness", "size", "sensitivity"}
    stored.plot(tmp_path / "estimate.png")
    assert (tmp_path / "estimate.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"solver": {"method": "dopri5", "rtol": 1e-6}}, "solver.rtol"),
        ({"plant": dict(PENDULUM, discretise="euler")}, "plant.discretise"),
        ({"plant": dict(PENDULUM, output=["a", "b"])}, "the output b of the plant is not among them"),
        (
            {"time": {"start": 50, "end": 60, "output_step": 1}},
            "time.start: there are no data then: they are from 0 to 2",
        ),
        ({"plant": 3}, "plant"),
        ({"observers": {}}, "observers: there are none: give one"),
    ],
)
def test_what_cannot_be_is_said(change: dict[str, object], message: str) -> None:
    config = {"plant": PENDULUM, "observers": observers("shgo")} | change
    with pytest.raises(ConfigError, match=message):
        estimate(source(config), recording(signal("a", [0, 1, 2], [0, 1, 2])), sensitivity=False)


@pytest.mark.parametrize(
    ("log", "message"),
    [
        (recording(signal("a", [1.0], [0.5])), "all samples are of one time, 1"),
        (recording(signal("a", [0, 1], [0, 1]), signal("z", [0, 1], [0, 1])), "data.outputs.z: no output of the plant"),
    ],
)
def test_what_was_recorded_has_to_be_of_use(log: Recording, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        estimate(source({"plant": PENDULUM, "observers": observers("shgo")}), log)


@pytest.mark.parametrize(
    ("time", "points"),
    [
        ({"end": 3.0}, [1 + 0.02 * k for k in range(101)]),
        ({"start": 0.0}, [0.01 * k for k in range(101)]),
        ({"start": 0.0, "end": 3.0, "output_step": 1.0}, [0, 1, 2, 3]),
    ],
)
def test_samples_of_one_time_are_followed_in_a_run_that_has_a_length(
    time: dict[str, float], points: list[float]
) -> None:
    config = {"plant": PENDULUM, "observers": observers("shgo"), "time": time}
    found = estimate(source(config), recording(signal("a", [1.0], [0.5])), sensitivity=False)
    assert found.time.tolist() == pytest.approx(points, abs=1e-14)


@pytest.mark.parametrize(
    ("time", "key"),
    [
        ({"start": 2.0, "end": 3.0}, "start"),
        ({"start": -1.0, "end": 0.5}, "end"),
        ({"end": 0.5}, "end"),
        ({"start": 2.0}, "start"),
    ],
)
def test_nor_do_they_lie_outside_of_it(time: dict[str, float], key: str) -> None:
    config = {"plant": PENDULUM, "observers": observers("shgo"), "time": time}
    with pytest.raises(ConfigError, match=rf"time\.{key}: there are no data then: they are from 1 to 1"):
        estimate(source(config), recording(signal("a", [1.0], [0.5])))


def test_a_reference_is_a_state_or_an_output() -> None:
    log = recording(signal("a", [0, 1], [0, 1]), reference={"z": signal("z", [0], [0])})
    with pytest.raises(ConfigError, match="neither a state nor an output"):
        estimate(source({"plant": PENDULUM, "observers": observers("shgo")}), log)


@pytest.mark.costly
@pytest.mark.parametrize("delay", ["0.5", "0.1 + 0.3*abs(sin(3*t))"], ids=["whole periods", "out of order"])
def test_late_samples_as_each_observer_is_told(delay: str) -> None:
    """A filter that is taken back, an observer that is, one that drops them, and one with the innovation: the bits."""
    blocks: dict[str, Block] = {
        "K": {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01, "initial": START},
        "S": {"type": "shgo", "theta": 2, "initial": START},
        "R": {"type": "shgo", "theta": 2, "initial": START, "late": "replay"},
        "D": {"type": "shgo", "theta": 2, "initial": START, "late": "drop"},
    }
    measurement = {"sampling": {"period": 0.25, "offset": 0.25}, "delay": delay, "noise": NOISE}
    run = pendulum(blocks, measurement=measurement)
    simulated = simulate_prepared(run)
    found = estimate(run.experiment.source, of_simulation(run), sensitivity=False)
    assert list(found.observers) == list(blocks)
    for label, one in simulated.observers.items():
        assert np.array_equal(found.observers[label].xhat, one.xhat), label


@pytest.mark.costly
def test_a_gate_that_leaves_out_too_much_is_told() -> None:
    taken = np.arange(0, 5, 0.05)
    values = np.sin(taken)
    values[5::10] += 100  # a tenth: outliers
    sure = {"Q": {"b": 1e-9}, "R": 1e-9, "initial": {"a": 0.0, "b": 1.0}}  # which a sine is not
    blocks = {"o": {"type": "shgo", "theta": 2}, "K": {"type": "ekf", **sure}}
    text = {"plant": PENDULUM, "observers": blocks, "solver": {"step": 0.01}}
    found = estimate(source(text), recording(signal("a", taken, values, gate=5.0)), sensitivity=False)
    assert found.recorded is not None
    used = found.recorded.outputs["a"].used
    few, many = taken.size - np.count_nonzero(used, axis=0)
    assert few <= 20 < many
    told = [one for one in found.remarks if "the gate of" in one]
    assert [one.partition(",")[0] for one in told] == [f"K: the gate of a left out {many} of 100 samples"]


@pytest.mark.parametrize("recorded", [False, True])
def test_a_gate_names_inputs_without_a_column(recorded: bool) -> None:
    """A mass that is pushed, by an input that the plant has for zero and the log as it was."""
    taken = np.arange(0, 5, 0.05)
    pushed = inline({"a": "b", "b": "F"}, "a", inputs={"F": "0"})
    sure = {"Q": {"b": 1e-9}, "R": 1e-9, "initial": {"a": 0.0, "b": 0.0}}
    text = {"plant": pushed, "observers": {"K": {"type": "ekf", **sure}}, "solver": {"step": 0.01}}
    position = signal("a", taken, 2.0 * taken**2, gate=5.0)
    log = recording(position, F=held_input("F", [0.0], [0.1])) if recorded else recording(position)
    (told,) = [one for one in estimate(source(text), log, sensitivity=False).remarks if "the gate of" in one]
    named = "the unit of the column, the model, whether data.inputs should name columns of F, and whether std"
    assert (named in told) == (not recorded)


def test_long_logs_are_not_run_again_for_every_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hgorun.estimate.estimate._MOST", 10)
    taken = np.arange(0, 2, 0.1)
    found = estimate(source({"plant": PENDULUM, "observers": observers("shgo")}), recording(signal("a", taken, taken)))
    assert "sensitivity" not in assessed_of(found, "shgo").scores
    assert any("20 samples" in remark for remark in found.remarks)


def test_measured_states_start_at_their_first_samples_unless_they_are_given() -> None:
    taken = np.arange(0, 2, 0.1)
    log = recording(signal("a", taken, 0.7 + taken))
    blocks = {name: {"type": "shgo", "theta": 2, "poles": -1, "initial": start} for name, start in STARTS.items()}
    found = estimate(source({"plant": PENDULUM, "observers": blocks}), log, sensitivity=False)
    starts = {name: one.xhat[0].tolist() for name, one in found.observers.items()}
    assert starts == {"nothing": [0.7, 0.0], "the other": [0.7, 3.0], "this": [0.1, 0.0]}


STARTS: dict[str, dict[str, float]] = {"nothing": {}, "the other": {"b": 3.0}, "this": {"a": 0.1}}


def test_an_input_has_to_act_on_the_plant_or_on_an_observer() -> None:
    """What is asked is the equations: a name in a text is not enough, and one that is built in need not be written."""
    taken = np.arange(0, 2, 0.1)
    log = recording(signal("a", taken, np.sin(taken)), u=held_input("u", [0, 1], [0.3, -0.2]))
    silent = inline({"a": "b", "b": "-sin(a) - 0*u"}, "a", inputs={})
    with pytest.raises(ConfigError, match=r"data\.inputs\.u: nothing depends on this input"):
        estimate(source({"plant": silent, "observers": observers("shgo")}), log)
    rate: Block = {"type": "kinetic_rate", "theta": 2, "yields": {"a": [1.0]}, "dilution": "u"}
    found = estimate(source({"plant": silent, "observers": {"o": rate}}), log, sensitivity=False)
    assert found.inputs == ("u",)
    listed = inline({"a": "b", "b": "-sin(a) + u"}, "a", inputs={"u": {}})  # what it is comes with the data
    found = estimate(source({"plant": listed, "observers": observers("shgo")}), log, sensitivity=False)
    assert found.u[-1].tolist() == [-0.2]


def test_what_the_first_samples_do_not_say_is_asked_for() -> None:
    """A tank whose outflow has no slope where it is empty: the level that is not measured has no start of its own."""
    taken = np.arange(0, 2, 0.1)
    log = recording(signal("low", taken, 20 + taken))
    plant = inline({"high": "1 - sqrt(high)", "low": "sqrt(high) - sqrt(low)"}, "low")
    block: Block = {"type": "shgo", "theta": 1, "poles": -1}
    with pytest.raises(ConfigError, match="states without an initial value start at 0: give initial of high"):
        estimate(source({"plant": plant, "observers": {"o": block}}), log)


@pytest.mark.parametrize(
    ("slope", "theta", "bound", "said"),
    [
        ("-sin(a) - 0.1*b", 2.0, 0.9, "its estimate of a grew until a = "),
        ("5*b", 0.1, 1e8, "its estimate of b grew until a = "),  # a gain that is too small for this model
    ],
)
def test_who_diverges_on_a_recording_says_what_left_its_bound(
    slope: str, theta: float, bound: float, said: str
) -> None:
    taken = np.arange(0, 8, 0.1)
    blocks = {"o": {"type": "shgo", "theta": theta, "initial": {"a": 0.1, "b": 0.1}}}
    text = {
        "plant": inline({"a": "b", "b": slope}, "a"),
        "observers": blocks,
        "solver": {"step": 0.002, "divergence": bound},
    }
    found = estimate(source(text), recording(signal("a", taken, np.sin(taken))), sensitivity=False)
    (trouble,) = found.troubles()
    assert said in trouble
    assert f"the bound is {bound:.3g} (solver.divergence)" in trouble
    assert "look at its initial values" in trouble
