"""The KKL observer of samples that begin late, against a recursion in numpy; and which plants it says it is for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from examples import Block, experiment, inline, simulated
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import hgorun
from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.members.members import Members
from hgorun.errors import ConfigError
from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare

A = np.array([[0.0, 1.0], [-1.0, -0.3]])
DAMPED: Block = inline({"x1": "x2", "x2": "-x1 - 0.3*x2"}, "x1", initial={"x1": 1, "x2": 0.5})
DUFFING: Block = inline({"x1": "x2", "x2": "-x1 - x1**3"}, "x1", initial={"x1": 1, "x2": 0})
T, LAM = 0.5, np.array([0.7, 1.9, 3.1])
RIGHT: Block = {"type": "kkl", "lam": LAM.tolist(), "initial": {"x1": 1, "x2": 0.5}}
WRONG: Block = {**RIGHT, "initial": {"x1": -0.4, "x2": 0.9}}
BOX: Block = {"x1": [-1.2, 1.2], "x2": [-1.2, 1.2]}
TIMES = [0.4 + T * k for k in range(10)]
LATE = [{"period": T, "offset": 0.5}, {"period": T, "offset": 1.3}, {"times": [-0.1, *TIMES]}, {"times": TIMES}]


def recursion(first: float, xhat: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Estimates of the damped oscillator at some times: z of the first sample is T of the estimate then."""
    Lam, step = np.exp(-LAM * T), expm(A * T)
    rows = np.array([np.linalg.solve((step - value * np.eye(2)).T, [1.0, 0.0]) for value in Lam])
    found, at, z, x = [], first, rows @ expm(A * first) @ xhat, np.array([1.0, 0.5])
    begun, since = xhat, 0.0
    for t in times:
        while at + T <= t + 1e-9:
            z, at = Lam * z + (expm(A * at) @ x)[0], at + T
            begun, since = np.linalg.pinv(rows) @ z, at
        found.append(expm(A * (t - since)) @ begun)
    return np.array(found)


@pytest.mark.parametrize("sampling", LATE)
def test_z_begins_at_the_first_sample(sampling: Block) -> None:
    blocks = {"right": RIGHT, "wrong": WRONG}
    found = simulated(DAMPED, blocks, end=4, step=0.01, measurement={"sampling": sampling})
    np.testing.assert_allclose(found.observers["right"].xhat, found.x, atol=1e-8)
    first = sampling.get("offset", TIMES[0])
    expected = recursion(first, np.array([-0.4, 0.9]), found.time)
    np.testing.assert_allclose(found.observers["wrong"].xhat, expected, atol=1e-8)


@pytest.mark.parametrize("offset", [0.0, 0.4])
def test_z_begins_at_the_first_sample_of_a_stream(offset: float) -> None:
    """Whatever the configuration says of its time."""
    block: Block = {"sampling": {"period": T, "offset": offset}}
    estimator = Estimator(experiment(DAMPED, {"K": WRONG}, end=4, step=0.01, measurement=block))
    for t in TIMES[:7]:
        estimator.update(t, {"x1": float((expm(A * t) @ [1.0, 0.5])[0])})
        expected = recursion(TIMES[0], np.array([-0.4, 0.9]), np.array([t]))[0]
        np.testing.assert_allclose(estimator.estimate()["K"], expected, atol=1e-7)


def duffing(x: np.ndarray, span: float) -> Callable[[float], np.ndarray]:
    return solve_ivp(
        lambda t, x: [x[1], -x[0] - x[0] ** 3], (0, span), x, rtol=1e-11, atol=1e-12, dense_output=True
    ).sol


@pytest.mark.slow
def test_a_fitted_inverse_begins_there_as_well() -> None:
    """z against the sum over the samples of the past; the wrong start apart from the right one."""
    lam, offset = np.arange(1.0, 6.0), 0.3
    kkl: Block = {"type": "kkl", "m": 5, "box": BOX, "grid": 9}
    blocks = {"right": {**kkl, "initial": {"x1": 1}}, "wrong": {**kkl, "initial": {"x2": 0.7}}}
    sampling: Block = {"sampling": {"period": T, "offset": offset}}
    found = simulated(DUFFING, blocks, end=2, step=0.01, measurement=sampling)
    for label, start in (("right", [1.0, 0.0]), ("wrong", [0.0, 0.7])):
        past = duffing(duffing(np.array(start), offset)(offset) * [1, -1], 21)  # backwards: x2 the other way round
        expected = sum(np.exp(-lam * T * j) * past(T * (j + 1))[0] for j in range(41))
        np.testing.assert_allclose(found.observers[label].internal["z"][0], expected, atol=1e-6)
    assert np.max(np.abs(found.observers["right"].xhat - found.x)) < 1e-3


def test_a_given_z_is_that_of_the_first_sample() -> None:
    z = [0.5, 0.2, 0.1]
    given = {"K": {**RIGHT, "internal": {"z": z}}}
    sampling: Block = {"sampling": {"period": T, "offset": 0.8}}
    found = simulated(DAMPED, given, end=1.3, output_step=1.3, step=0.01, measurement=sampling)
    expected = np.exp(-LAM * T) * z + (expm(0.8 * A) @ [1, 0.5])[0]
    np.testing.assert_allclose(found.observers["K"].internal["z"][-1], expected, atol=1e-8)


def test_lanes_of_other_starts() -> None:
    measurement: Block = {"sampling": {"period": T, "offset": 0.3}}
    blocks = [{**RIGHT, "initial": {"x1": 0.2 * k}} for k in range(8)]
    runs = [prepare(experiment(DAMPED, {"K": one}, step=0.01, end=3, measurement=measurement)) for one in blocks]
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, run in enumerate(runs):
        assert np.array_equal(together.rows[..., lane], integrate(run, as_given(run)).rows[..., 0])


def test_an_estimate_that_does_not_live_until_the_first_sample_is_refused() -> None:
    plant = inline({"a": "a**2"}, "a", initial={"a": -1})
    kkl: Block = {"type": "kkl", "box": {"a": [-1, 1]}, "outside": "saturate", "initial": {"a": 2}}
    with pytest.raises(
        ConfigError, match=r"K\.\w+: the first sample comes at 0.9, and the estimate is lost before that, after 0\.5"
    ):
        prepare(experiment(plant, {"K": kkl}, measurement={"sampling": {"period": 0.3, "offset": 0.9}}))


def test_a_first_sample_that_is_lost_is_refused() -> None:
    """The others come at even times."""
    refused = 0
    for seed in range(8):
        measurement: Block = {"sampling": {"period": 1, "dropout": 0.5}}
        made = experiment(DAMPED, {"K": {"type": "kkl"}}, end=2.5, measurement=measurement, seed=seed)
        try:
            prepare(made)
        except ConfigError as error:
            refused += "z begins with the sample that is due 0 after the start" in str(error)
    assert refused > 0


@pytest.mark.parametrize(
    ("change", "block"),
    [({"x2": "-x1 + u"}, {}), ({"x2": "-x1 + u"}, {"box": BOX}), ({"x2": "-x1 + sin(t)"}, {})],
)
def test_samples_of_plants_with_time_or_inputs_are_refused_for_that(change: Block, block: Block) -> None:
    plant = inline({"x1": "x2", **change}, "x1", initial={"x1": 1, "x2": 0})
    if "u" in change["x2"]:
        plant["inputs"] = {"u": "sin(3*t)"}
    with pytest.raises(ConfigError, match=r"K\.type: time or inputs enter the plant: the map of samples") as found:
        hgorun.simulate(experiment(plant, {"K": {"type": "kkl", **block}}, measurement={"sampling": {"period": 0.1}}))
    assert "box" not in str(found.value)


def test_constant_terms_take_a_box_and_are_named() -> None:
    plant = inline({"a": "1 - a"}, "a", initial={"a": 0})
    with pytest.raises(ConfigError, match="but for linear plants without constant terms"):
        prepare(experiment(plant, {"K": {"type": "kkl"}}, measurement={"sampling": {"period": 0.1}}))


@pytest.mark.slow
@pytest.mark.parametrize("path", ["observers.K.initial.x1", "observers.K.theta", "measurement.sampling.offset"])
def test_members_of_an_ensemble_have_the_bits_of_their_own_runs(path: str) -> None:
    base = experiment(
        DAMPED, {"K": RIGHT}, step=0.02, end=2, measurement={"sampling": {"period": T, "offset": 0.3}}, seed=1
    )
    members = Members.of({path: np.linspace(0.1, 0.9, 20)})
    block = compute(base, members)
    for i in (0, 7, 19):
        own = hgorun.simulate(base.varied(members.of_observers(base).changes(i))).observers["K"]
        assert block.error[i] == ""
        for name, values in block.metrics.items():
            assert values[i, 0].tobytes() == np.asarray(own.metrics[name], dtype=float).tobytes(), name


def test_uneven_samples_are_refused_with_the_reason() -> None:
    uneven = {"sampling": {"steps": "0.1 + 0.02*sin(k)"}}
    with pytest.raises(ConfigError, match="it takes samples of one period, and those of x1 come at times of their own"):
        hgorun.simulate(experiment(DAMPED, {"K": RIGHT}, measurement=uneven))
