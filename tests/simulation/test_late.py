"""Late samples: left out, or the observer is taken back to the time of each, against simulators of a few lines."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pendulum_filter
import pytest
from examples import Block, chain, experiment, findings, inline, said, simulated
from pendulum_filter import corrected

import hgorun
from hgorun import Result
from hgorun.analysis.report import analyze
from hgorun.errors import ConfigError
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare

PENDULUM = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a", 0.8)
EKF: Block = {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01}
SHGO: Block = {"type": "shgo", "theta": 2}
NOISE: Block = {"noise": [{"type": "expression", "value": "0.05*sin(7*k)"}]}
PERIOD, STEP = 0.25, 0.0125


def late(delay: str) -> Block:
    return {"sampling": {"period": PERIOD, "offset": PERIOD}, "delay": delay, **NOISE}


def run(observers: dict[str, Block], delay: str, **more: object) -> Result:
    return simulated(PENDULUM, observers, end=4, output_step=0.05, step=STEP, measurement=late(delay), **more)


def flown(z: np.ndarray, span: float) -> np.ndarray:
    return pendulum_filter.flown(z, span, 0.00625)


def filtered(samples: Sequence[tuple[float, float, float]], t: float) -> np.ndarray:
    """The filter at t of all (taken, arrival, y) that have arrived by then, in the order in which they were taken."""
    z, now = np.array([0.0, 0, 1, 0, 1]), 0.0
    for taken, _, y in sorted(s for s in samples if s[1] <= t + 1e-9):
        z, now = corrected(flown(z, taken - now), y), taken
    return flown(z, t - now) if t > now else z


def samples_of(result: Result) -> list[tuple[float, float, float]]:
    m = result.measurements
    return list(zip(m.taken[:, 0], m.time, m.y[:, 0], strict=True))


@pytest.mark.costly
@pytest.mark.parametrize(
    "delay",
    ["0.5", "0.37", "0.4 + 0.3*sin(9*t)"],
    ids=["whole periods", "between samples", "out of order"],
)
def test_the_filter_of_what_has_arrived(delay: str) -> None:
    result = run({"K": EKF}, delay)
    samples, found = samples_of(result), result.observers["K"]
    if "sin" in delay:
        assert any(a[0] > b[0] for a, b in pairwise(samples))
    for row in range(0, 81, 5):
        z = filtered(samples, float(result.time[row]))
        np.testing.assert_allclose(found.xhat[row], z[:2], rtol=0, atol=2e-7)
        np.testing.assert_allclose(found.internal["P"][row, 0], z[2:4], rtol=0, atol=2e-7)


JUMPING: list[Block] = [
    EKF,
    {"type": "ukf", "Q": {"b": 0.1}, "R": 0.01},
    {"type": "hg_ekf", "theta": 2, "update": "jump"},
    {"type": "hg_ekf", "theta": 2, "late": "replay"},
    {"type": "aekf", "theta_1": 2, "m": 0.01, "update": "jump", "copies": 2},
    {"type": "impulsive", "theta": 2},
    {"type": "impulsive_riccati", "theta": 2},
]


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize("block", JUMPING, ids=lambda block: f"{block['type']} {block.get('update', '')}")
def test_with_all_samples_in_hand_any_filter_is_the_one_in_order_bit_for_bit(block: Block) -> None:
    """One output; every second sample is 0.5 late, so that it comes after the one that was taken behind it."""
    end = 2.0
    keep: Block = {"end": end, "output_step": 0.25, "step": STEP}
    late = {"sampling": {"period": PERIOD, "offset": PERIOD}, "delay": "0.25*(1 + sign(cos(4*pi*t)))"}
    result = simulated(PENDULUM, {"K": block}, measurement=late, **keep)
    taken = np.sort(result.measurements.taken[:, 0])
    assert np.any(np.diff(result.measurements.taken[:, 0]) < 0)
    assert np.all(np.diff(taken) > 0)
    in_order = {"sampling": {"times": taken.tolist()}}
    wanted = simulated(PENDULUM, {"K": block}, measurement=in_order, **keep).observers["K"]
    found = result.observers["K"]
    assert np.array_equal(found.xhat[-1], wanted.xhat[-1])
    for name, values in found.internal.items():
        assert np.array_equal(np.asarray(values)[-1], np.asarray(wanted.internal[name])[-1])
    assert not np.array_equal(found.xhat, wanted.xhat)


@pytest.mark.slow
def test_with_all_samples_in_hand_it_is_the_filter_in_order_bit_for_bit() -> None:
    """Delays of whole periods, so that both have the same steps; by t = 3.5 all of the first twelve have come."""
    times = [PERIOD * k for k in range(1, 13)]
    arrivals = {t: t + PERIOD * (5 * k % 4) for k, t in enumerate(times)}
    order = sorted(arrivals, key=lambda t: (arrivals[t], t))
    assert order != times
    # each sample on its own output of the same state: its own time and delay
    names = [f"y{k}" for k in range(len(times))]
    plant = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {name: "a" for name in names}, 0.8)
    keep = {"end": 4, "output_step": 0.25, "step": STEP}

    def measured(delayed: bool) -> Block:
        outputs = {
            name: {
                "sampling": {"times": [arrivals[t] if delayed else t]},
                "delay": str(arrivals[t] - t) if delayed else "0",
                "noise": [{"type": "expression", "value": str(0.01 * (k % 5))}],
            }
            for k, (name, t) in enumerate(zip(names, times, strict=True))
        }
        return {"outputs": outputs}

    found = simulated(plant, {"K": EKF}, measurement=measured(True), **keep).observers["K"]
    wanted = simulated(plant, {"K": EKF}, measurement=measured(False), **keep).observers["K"]
    assert np.array_equal(found.xhat[15:], wanted.xhat[15:])
    assert np.array_equal(found.internal["P"][15:], wanted.internal["P"][15:])
    assert not np.array_equal(found.xhat[:12], wanted.xhat[:12])


def test_a_constant_delay_is_the_flow_from_the_filter_without_one() -> None:
    result = run({"K": EKF}, "0.5")
    for row in (30, 55, 80):
        taken = [(s, s, y) for s, _, y in samples_of(result)]
        undelayed = filtered(taken, float(result.time[row]) - 0.5)
        np.testing.assert_allclose(result.observers["K"].xhat[row], flown(undelayed, 0.5)[:2], rtol=0, atol=2e-7)


def test_continuous_observers_can_be_taken_back_too() -> None:
    """With delays of whole periods the observer is, as soon as a sample is known, that of samples without delay."""
    replayed = run({"S": SHGO | {"late": "replay"}}, "0.5").observers["S"]
    taken = {"times": [PERIOD * k - 0.5 for k in range(2, 17)]}
    noise = [{"type": "expression", "value": "0.05*sin(7*(k + 1))"}]
    measurement = {"sampling": taken, "noise": noise}
    in_order = simulated(PENDULUM, {"S": SHGO}, end=4, output_step=0.05, step=STEP, measurement=measurement)
    assert replayed.xhat.shape == in_order.observers["S"].xhat.shape
    # the last sample known at t = 4 was taken at 3.5: there nothing else has entered, and the held innovation goes on
    np.testing.assert_allclose(replayed.xhat[80], in_order.observers["S"].xhat[80], rtol=0, atol=1e-12)
    by_innovation = run({"S": SHGO}, "0.5").observers["S"]
    assert np.max(np.abs(by_innovation.xhat - replayed.xhat)) > 1e-3


@pytest.mark.costly
def test_late_samples_are_left_out() -> None:
    """Of two outputs one is late: the observer is that of the other alone."""
    plant = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"y": "a", "z": "a + b"}, 0.8)
    one = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, {"y": "a"}, 0.8)
    measurement = {"sampling": {"period": PERIOD}, **NOISE}
    both = measurement | {"outputs": {"z": {"delay": "0.3", "sampling": {"period": PERIOD, "offset": 1}}}}
    keep = {"end": 3, "step": STEP}
    dropped = simulated(plant, {"K": EKF | {"late": "drop"}, "L": EKF}, measurement=both, **keep)
    alone = simulated(one, {"K": EKF}, measurement=measurement, **keep).observers["K"]
    # steps end at the arrivals of the late samples as well
    np.testing.assert_allclose(dropped.observers["K"].xhat, alone.xhat, rtol=0, atol=1e-8)
    assert np.max(np.abs(dropped.observers["L"].xhat - alone.xhat)) > 1e-3


@pytest.mark.costly
def test_alone_and_in_company() -> None:
    blocks = {"K": EKF, "S": SHGO, "D": SHGO | {"late": "drop"}, "R": SHGO | {"late": "replay"}, "L": EKF | {"R": 0.1}}
    delay = "0.4 + 0.3*sin(9*t)"
    company = run(blocks, delay)
    assert list(company.observers) == list(blocks)
    for label, block in blocks.items():
        alone = run({label: block}, delay)
        assert np.array_equal(alone.observers[label].xhat, company.observers[label].xhat), label
        assert np.array_equal(alone.measurements.y, company.measurements.y)


def test_undelayed_samples_leave_nothing_to_do() -> None:
    blocks = {"S": SHGO, "D": SHGO | {"late": "drop"}, "R": SHGO | {"late": "replay"}}
    found = run(blocks, "0").observers
    assert np.array_equal(found["S"].xhat, found["D"].xhat)
    assert np.array_equal(found["S"].xhat, found["R"].xhat)


def test_automatic_steps() -> None:
    result = simulated(PENDULUM, {"K": EKF}, end=4, output_step=0.05, measurement=late("0.37"))
    z = filtered(samples_of(result), 4.0)
    assert result.observers["K"].verdict.status == "ok"
    np.testing.assert_allclose(result.observers["K"].xhat[-1], z[:2], rtol=0, atol=1e-5)


@pytest.mark.slow
def test_members_of_an_ensemble(tmp_path: object) -> None:
    base = experiment(PENDULUM, {"K": EKF, "S": SHGO}, end=2, output_step=0.05, step=STEP, measurement=late("0.37"))
    swept = hgorun.sweep(base, {"observers.K.R": [0.01, 0.02, 0.05]}, output=f"{tmp_path}/swept.h5")
    rmse = swept.to_xarray()["rmse"].sel(observer="K").values
    alone = hgorun.simulate(base.varied({"observers.K.R": 0.05})).observers["K"]
    assert np.array_equal(rmse[-1], alone.metrics["rmse"])


@pytest.mark.parametrize(
    ("block", "measurement", "message"),
    [
        (EKF | {"late": "innovation"}, late("0.3"), "is corrected by samples and has no innovation"),
        (SHGO | {"late": "replay"}, {"delay": "0.3"}, "replay needs sampled outputs, but a is continuous"),
        (SHGO | {"late": "drop"}, {"delay": "0.3"}, "drop needs sampled outputs"),
        ({"type": "deadbeat", "late": "replay"}, {"sampling": {"period": 0.1}}, "takes samples without delay"),
        (SHGO | {"late": "later"}, {}, "late"),
    ],
)
def test_what_cannot_be_is_refused(block: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(PENDULUM, {"o": block}, measurement=measurement))


@pytest.mark.costly
def test_in_lanes() -> None:
    starts = [{"a": 0.1 * k} for k in range(4)]
    runs = [
        prepare(
            experiment(PENDULUM, {"K": EKF | {"initial": start}, "R": SHGO | {"late": "replay"}}, end=2,
                       output_step=0.05, step=STEP, measurement=late("0.4 + 0.3*sin(9*t)"))
        )
        for start in starts
    ]  # fmt: skip
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, one in enumerate(runs):
        alone = integrate(one, as_given(one))
        assert np.array_equal(together.rows[..., lane], alone.rows[..., 0])


@pytest.mark.costly
def test_theory_of_the_innovation_is_not_told_of_a_replay() -> None:
    base = experiment(chain(2, "-x1"), {"S": SHGO | {"late": "replay"}, "T": SHGO}, end=4, step=STEP,
                      measurement={"sampling": {"period": 0.1}, "delay": "0.2"})  # fmt: skip
    found = analyze(base, findings("stability")).observers
    assert "late: replay" in found["S"].reasons["delay_critical"]
    assert said(found["T"])["delay_critical"] > 0


def test_a_divergence_stays_one() -> None:
    block = {"type": "shgo", "theta": 400, "late": "replay"}
    result = simulated(chain(2), {"S": block, "T": SHGO}, end=40, output_step=0.5, step=0.05, measurement=late("0.5"))
    assert result.observers["S"].verdict.lost
    assert not result.observers["T"].verdict.lost


def test_a_sparse_grid_shows_what_a_dense_one_shows_just_before_a_late_sample_arrives() -> None:
    """Observers are taken back at every arrival, so the ends of what is integrated do not ascend."""
    measurement = {"sampling": {"steps": "0.06 + 0.03*sin(k)"}, "delay": "0.15 + 0.14*sin(9*t)", **NOISE}
    dense, sparse = (
        simulated(PENDULUM, {"E": EKF}, end=2, output_step=step, step=0.02, measurement=measurement).observers["E"]
        for step in (0.002, 0.1)
    )
    np.testing.assert_allclose(sparse.xhat, dense.xhat[::50], rtol=0, atol=1e-12)


DEADBEAT: Block = {"type": "deadbeat", "late": "drop", "initial": {"x1": 0.1}}


def test_what_steps_from_sample_to_sample_steps_over_late_ones() -> None:
    """Every second sample of a simulation is late."""
    keep: Block = {"end": 2.0, "output_step": 0.25, "step": STEP}
    late = {"sampling": {"period": 0.25}, "delay": "0.05*(1 - cos(4*pi*t))"}
    found = simulated(chain(2, "-x1"), {"O": DEADBEAT}, measurement=late, **keep)
    in_time = {"sampling": {"period": 0.5}}
    wanted = simulated(chain(2, "-x1"), {"O": DEADBEAT}, measurement=in_time, **keep)
    # the plant's steps end at other times
    np.testing.assert_allclose(found.observers["O"].xhat, wanted.observers["O"].xhat, rtol=0, atol=1e-7)
    assert np.ptp(wanted.observers["O"].xhat[:, 1]) > 0.1


@pytest.mark.parametrize("closed", [False, True])
def test_a_plant_that_is_stepped_or_driven_takes_no_late_samples(closed: bool) -> None:
    plant = chain(2, "-x1") | ({} if closed else {"discretise": "euler"})
    more: Block = {"measurement": {"sampling": {"period": 0.25}, "delay": 0.05}}
    if closed:
        plant = inline({"x1": "x2", "x2": "u"}, "x1", inputs={"u": "controller"})
        more["controller"] = {"law": {"u": "-x1 - x2"}}
    with pytest.raises(
        ConfigError, match="this takes samples without delay, but x1 is late: run it apart, without the delay;"
    ):
        hgorun.simulate(experiment(plant, {"O": DEADBEAT}, end=2.0, **more))


@pytest.mark.parametrize(
    ("blocks", "delay", "expected"),
    [
        (
            {"S": SHGO | {"late": "drop"}},
            "0.1",
            "16 of 16 samples of a were left out since they were late",
        ),
        (
            {"S": SHGO | {"late": "drop"}, "K": EKF},
            "max(0, 0.1*cos(4*pi*t))",
            "8 of 16 samples of a were left out by S",
        ),
        ({"S": SHGO | {"late": "drop"}}, "0", None),
        ({"S": SHGO, "K": EKF}, "0.1", None),
    ],
)
def test_what_is_left_out_is_told(blocks: dict[str, Block], delay: str, expected: str | None) -> None:
    measurement = {"sampling": {"period": PERIOD, "offset": PERIOD}, "delay": delay}
    result = simulated(PENDULUM, blocks, end=4.15, output_step=0.05, step=STEP, measurement=measurement)
    told = [words for words in result.remarks if "left out" in words]
    assert len(told) == (expected is not None)
    if expected is not None:
        assert told[0].startswith(expected)
        assert ("next to nothing of it corrects" in told[0]) == told[0].startswith("16")
