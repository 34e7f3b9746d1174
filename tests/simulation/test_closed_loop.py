"""Closed loops: known trajectories and laws, a plain simulator, and runs that need no controller."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from differentiator import registered
from examples import inline

import hgorun
from hgorun import ConfigError, Experiment, Result

Block = dict[str, Any]

CUBIC = inline({"x1": "x2", "x2": "x2**3 + u"}, "x1", inputs={"u": "controller"})
LAW: Block = {"law": {"u": "-x2**3 - x1 - x2"}, "saturation": {"u": [-1, 1]}}
# theta 50, x(0) = (0.5, 0): x1, x2, xhat1, xhat2
GOLDEN = {
    0.05: (0.49877, -0.04969, 0.56061, 5.11315),
    0.1: (0.49503, -0.09971, 0.50889, 0.78159),
    0.5: (0.42110, -0.23756, 0.42118, -0.22928),
    1: (0.28682, -0.28373, 0.28683, -0.28321),
    2: (0.03903, -0.18596, 0.03897, -0.19206),
    5: (-0.02622, 0.04049, -0.02622, 0.04105),
}


@pytest.fixture(scope="module", autouse=True)
def differentiator() -> Iterator[None]:
    with registered():
        yield


def plain(theta: float) -> Block:
    return {"type": "plain_differentiator", "theta": theta}


def closed(plant: Block, controller: Block, observers: dict[str, Block], **more: Any) -> Experiment:
    config = {"time": {"end": 10, "output_step": 0.01}, "plant": plant, "observers": observers}
    return Experiment(config | {"controller": controller} | more)


def simulated(plant: Block, controller: Block, observers: dict[str, Block], **more: Any) -> Result:
    return hgorun.simulate(closed(plant, controller, observers, **more))


def started(plant: Block, *x: float) -> Block:
    return plant | {"initial": dict(zip(plant["initial"], x, strict=True))}


@pytest.fixture(scope="module")
def cubic() -> Experiment:
    """Gains from 10 to 100, each with a plant of its own."""
    return closed(CUBIC, LAW, {f"F{theta}": plain(theta) for theta in (10, 20, 50, 100)}, solver={"step": 5e-4})


@pytest.fixture(scope="module")
def from_rest(cubic: Experiment) -> Result:
    return hgorun.simulate(cubic.varied({"plant.initial.x2": 0}))


def test_a_known_trajectory() -> None:
    """Of the classical method with steps of 1e-4."""
    result = simulated(started(CUBIC, 0.5, 0), LAW, {"F": plain(50)}, solver={"step": 1e-4, "method": "rk4"})
    for t, expected in GOLDEN.items():
        row = round(t / 0.01)
        found = [*result.closed_loop["F"].x[row], *result.observers["F"].xhat[row]]
        np.testing.assert_allclose(found, expected, atol=6e-6)


@pytest.mark.parametrize(
    ("x2", "expected"),
    [(0.5, (0.1065, 0.04744, 0.01723, 0.008428)), (0.0, (0.2501, 0.1446, 0.06876, 0.03839))],
)
def test_recovery_is_of_order_one_over_theta(cubic: Experiment, x2: float, expected: tuple[float, ...]) -> None:
    result = hgorun.simulate(cubic.varied({"plant.initial.x2": x2}))
    found = [max(of["recovery"].values()) for of in result.metrics().values()]
    np.testing.assert_allclose(found, expected, rtol=3e-3)
    for label, loop in result.closed_loop.items():
        if label != "plant":
            apart = np.max(np.abs(loop.x - result.x), axis=0)
            np.testing.assert_array_equal(result.observers[label].metrics["recovery"], apart)


def test_without_saturation_the_state_escapes_sooner_for_larger_gains(cubic: Experiment) -> None:
    escape = {"F10": 0.5339, "F20": 0.1254, "F50": 0.02400, "F100": 0.00814}
    result = hgorun.simulate(
        cubic.varied({"controller.saturation": None, "plant.initial.x2": 0, "solver": {"step": "auto"}, "time.end": 1})
    )
    assert result.verdict.status == "ok"  # with the true state all is well
    for label, when in escape.items():
        assert result.observers[label].status == "diverged"
        assert result.observers[label].diverged_at == pytest.approx(when, rel=5e-3)
        loop = result.closed_loop[label]
        assert np.all(np.isinf(loop.effort))
        assert np.all(np.isfinite(loop.x[result.time < when - 0.01]))
        assert np.all(np.isnan(loop.x[result.time > when + 0.01]))


def test_a_loop_that_diverges_leaves_the_others_their_bits(cubic: Experiment, from_rest: Result) -> None:
    lost = hgorun.simulate(cubic.varied({"plant.initial.x2": 0, "observers.F20.theta": 1.5}))
    assert lost.observers["F20"].status == "diverged"
    assert lost.status == "diverged"
    for label in ("F10", "F50", "F100"):
        np.testing.assert_array_equal(lost.closed_loop[label].x, from_rest.closed_loop[label].x)
        np.testing.assert_array_equal(lost.observers[label].xhat, from_rest.observers[label].xhat)
    alone = hgorun.simulate(
        cubic.varied({"plant.initial.x2": 0, **{f"observers.{label}": None for label in ("F10", "F20", "F50")}})
    )
    np.testing.assert_array_equal(alone.closed_loop["F100"].x, from_rest.closed_loop["F100"].x)
    np.testing.assert_array_equal(alone.x, from_rest.x)


OSCILLATOR = inline({"x1": "x2", "x2": "-x1 - 0.5*x2 + u"}, "x1", 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "measurement",
    [
        {"noise": [{"type": "gaussian", "std": 0.05, "hold": 0.03}]},
        {"sampling": {"period": 0.1, "jitter": 0.03}, "noise": [{"type": "gaussian", "std": 0.05}]},
        {"sampling": {"period": 0.1}, "delay": 0.17, "noise": [{"type": "gaussian", "std": 0.05}]},
        {"delay": 0.2},
    ],
)
def test_a_law_of_time_alone_is_an_open_loop(measurement: Block) -> None:
    observers: dict[str, Block] = {"S": {"type": "shgo", "theta": 4}, "F": {"type": "fhgo2", "theta": 4, "r": 2}}
    if "sampling" in measurement and "delay" in measurement:
        observers["D"] = {"type": "shgo", "theta": 4, "late": "drop"}
    elif "sampling" in measurement:  # they step with the input at the sample before
        observers |= {"B": {"type": "deadbeat"}, "R": {"type": "reduced_sampled", "H": 1}}
    config: Block = {
        "time": {"end": 2, "output_step": 0.05},
        "plant": OSCILLATOR | {"inputs": {"u": "0.5*sin(2*t)"}},
        "observers": observers,
        "measurement": measurement,
        "solver": {"step": 0.005},
    }
    driven = config | {
        "plant": OSCILLATOR | {"inputs": {"u": "controller"}},
        "controller": {"law": {"u": "0.5*sin(2*t)"}},
    }
    one, other = (hgorun.simulate(Experiment(each)) for each in (config, driven))
    np.testing.assert_array_equal(one.u, other.u)
    np.testing.assert_allclose(one.measurements.y, other.measurements.y, atol=1e-12)
    for label, observer in one.observers.items():
        np.testing.assert_array_equal(observer.xhat, other.observers[label].xhat)
        for name, values in observer.metrics.items():
            np.testing.assert_array_equal(values, other.observers[label].metrics[name])
        assert not other.observers[label].metrics["recovery"].any()


def test_with_the_model_of_a_linear_plant_the_error_does_not_depend_on_the_law() -> None:
    """Separation."""
    plant = OSCILLATOR | {"inputs": {"u": "controller"}}
    errors = []
    for law in ("-3*x1 - 2*x2", "0.3*x1", "sin(t)"):
        result = simulated(
            plant, {"law": {"u": law}}, {"S": {"type": "shgo", "theta": 3}}, solver={"step": 0.002},
            time={"end": 4, "output_step": 0.1},
        )  # fmt: skip
        errors.append(result.observers["S"].xhat - result.closed_loop["S"].x)
    np.testing.assert_allclose(errors[1], errors[0], atol=1e-9)
    np.testing.assert_allclose(errors[2], errors[0], atol=1e-9)


SERVO = inline(
    {"x1": "x2", "x2": "-x2 + u"}, "x1", 0.0, inputs={"u": "controller"}, parameters={"r": 1}, disturbance={"x2": 0.3}
)
SERVO_LAW: Block = {
    "law": {"u": "2*(r - x1) - x2 + xi"},
    "integral": {"xi": "r - x1"},
    "saturation": {"u": [-0.8, 0.8]},
    "cost": {"x2": 1, "u": 0.5},
}


def naive(period: float | None, windup: bool, *, state_feedback: bool, h: float = 2e-3, end: float = 6.0) -> np.ndarray:
    """(x1, x2, xhat1, xhat2, xi, cost, effort, u) at all steps of the classical method, theta = 20."""
    low, high, theta = -0.8, 0.8, 20.0

    def gamma(z: np.ndarray) -> float:
        x1, x2 = z[:2] if state_feedback else z[2:4]
        return float(2 * (1 - x1) - x2 + z[4])

    def rate(z: np.ndarray, held: float | None) -> np.ndarray:
        wanted, e = gamma(z), z[2] - z[0]
        u = min(max(wanted, low), high) if held is None else held
        dxi = 1 - (z[0] if state_feedback else z[2])
        if windup and ((wanted > high and dxi > 0) or (wanted < low and dxi < 0)):
            dxi = 0.0
        return np.array(
            [z[1], -z[1] + u + 0.3, z[3] - 2 * theta * e, -(theta**2) * e, dxi, z[1] ** 2 + 0.5 * u**2, u**2]
        )

    z, held, rows = np.zeros(7), None, []
    for k in range(round(end / h) + 1):
        if period is not None and k % round(period / h) == 0:
            held = min(max(gamma(z), low), high)
        rows.append([*z, min(max(gamma(z), low), high) if held is None else held])
        a = rate(z, held)
        b = rate(z + h / 2 * a, held)
        c = rate(z + h / 2 * b, held)
        d = rate(z + h * c, held)
        z = z + h / 6 * (a + 2 * b + 2 * c + d)
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("period", "windup", "close"), [(None, False, 1e-6), (0.25, False, 1e-6), (None, True, 3e-4), (0.25, True, 3e-4)]
)
def test_period_integral_and_saturation_as_a_plain_simulator_has_them(
    period: float | None, windup: bool, close: float
) -> None:
    """With anti-windup the equations jump in the state, which steps of either pass at times of their own."""
    controller = SERVO_LAW | {"anti_windup": "conditional" if windup else "none"}
    if period is not None:
        controller |= {"period": period}
    result = simulated(SERVO, controller, {"F": plain(20)}, solver={"step": 2e-3}, time={"end": 6, "output_step": 0.05})
    for label, state_feedback in (("F", False), ("plant", True)):
        expected, loop = naive(period, windup, state_feedback=state_feedback), result.closed_loop[label]
        shown = expected[::25]
        np.testing.assert_allclose(loop.x, shown[:, :2], atol=close)
        np.testing.assert_allclose(loop.integral["xi"], shown[:, 4], atol=close)
        np.testing.assert_allclose(loop.u[:-1, 0], shown[:-1, 7], atol=close)
        assert loop.cost == pytest.approx(expected[-1, 5], abs=close)
        assert loop.effort[0] == pytest.approx(expected[-1, 6], abs=close)
        assert loop.peak_input[0] == pytest.approx(np.max(np.abs(expected[:, 7])), abs=close)
        if not state_feedback:
            np.testing.assert_allclose(result.observers["F"].xhat, shown[:, 2:4], atol=close)


@pytest.mark.costly
def test_automatic_steps_are_as_accurate_as_asked_for() -> None:
    controller = SERVO_LAW | {"period": 0.25}
    result = simulated(SERVO, controller, {"F": plain(20)}, time={"end": 6, "output_step": 0.05})
    expected, loop = naive(0.25, True, state_feedback=False), result.closed_loop["F"]
    assert result.status == "ok"
    np.testing.assert_allclose(loop.x, expected[::25, :2], atol=1e-3)
    assert loop.cost == pytest.approx(expected[-1, 5], rel=1e-3)


@pytest.mark.parametrize("solver", [{"method": "dopri5", "rtol": 1e-8}, {"step": 0.01}])
def test_late_outputs_are_those_of_the_true_state(solver: Block) -> None:
    """What a result shows as measured is of the plant that the true state drives."""
    plant = inline({"x1": "x2", "x2": "u"}, "x1", 0.5, inputs={"u": "controller"})
    result = simulated(
        plant, {"law": {"u": "-x1 - x2"}, "period": 0.1}, {"S": {"type": "shgo", "theta": 5}}, solver=solver,
        measurement={"delay": 0.1}, time={"end": 2, "output_step": 0.05},
    )  # fmt: skip
    then = np.interp(result.measurements.taken[:, 0], result.time, result.x[:, 0])
    np.testing.assert_allclose(result.measurements.y[:, 0], then, atol=1e-12)


def test_a_law_may_use_an_observers_own_state() -> None:
    """An estimated disturbance is cancelled: the plant follows the undisturbed one, the others do not."""
    plant = inline({"x1": "x2", "x2": "u"}, "x1", 0.5, inputs={"u": "controller"}, disturbance={"x2": "0.7"})
    controller = {"law": {"u": "-x1 - 2*x2 - sigma"}, "truth": {"sigma": 0.7}}
    observers: dict[str, Block] = {"E": {"type": "extended", "theta": 20}, "S": {"type": "shgo", "theta": 20}}
    result = simulated(plant, controller, observers, time={"end": 20, "output_step": 0.1})
    np.testing.assert_allclose(result.x[-1], 0, atol=1e-6)
    np.testing.assert_allclose(result.closed_loop["E"].x[-1], 0, atol=1e-4)
    assert result.closed_loop["S"].x[-1, 0] > 0.5  # sigma is zero for it
    np.testing.assert_allclose(result.closed_loop["E"].u[-1], -0.7, atol=1e-3)


LINEAR: Block = {
    "time": {"end": 2, "output_step": 0.1},
    "plant": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1 + u"},
        "output": "x1",
        "inputs": {"u": "controller"},
        "initial": {"x1": 1, "x2": 0.5},
    },
    "controller": {"law": {"u": "-x1 - 2*x2"}},
    "solver": {"step": 0.001},
}


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{}, {"sampling": {"period": 0.1}}])
def test_the_covariance_of_a_linear_plant_does_not_depend_on_the_law(measurement: Block) -> None:
    """Riccati equations and samples are solved here without any law, for P has none in it."""
    filters = {"kalman_bucy": "flow", "hg_ekf": "flow", **({"ekf": "jump", "ukf": "jump"} if measurement else {})}
    blocks = {name: {"type": name, "Q": {"x1": 1, "x2": 1}, "R": 1} for name in filters}
    blocks["hg_ekf"] |= {"theta": 1, "Q": 1}
    run = hgorun.simulate(Experiment({**LINEAR, "measurement": measurement, "observers": blocks}))
    F, H, step = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[1.0, 0.0]]), 1e-3

    def slope(P: np.ndarray, flow: bool) -> np.ndarray:
        return F @ P + P @ F.T + np.eye(2) - (P @ H.T @ H @ P if flow else 0)

    for name, how in filters.items():
        P = np.eye(2)
        for k in range(2000):
            if how == "jump" and k % 100 == 0:
                P = P - P @ H.T @ H @ P / (H @ P @ H.T + 1)
            half = P + 0.5 * step * slope(P, how == "flow")
            P = P + step * slope(half, how == "flow")
        if how == "jump":
            P = P - P @ H.T @ H @ P / (H @ P @ H.T + 1)
        found = run.observers[name].internal["P"][-1]
        np.testing.assert_allclose(found[np.triu_indices(2)], P[np.triu_indices(2)], rtol=2e-5, err_msg=name)


def test_it_is_written_and_read(from_rest: Result, tmp_path: Path) -> None:
    result = simulated(SERVO, SERVO_LAW, {"F": plain(20)}, solver={"step": 0.01}, time={"end": 1, "output_step": 0.1})
    back = hgorun.read(result.save(tmp_path / "loop.h5"))
    assert list(back.closed_loop) == ["plant", "F"]
    for label, loop in result.closed_loop.items():
        for name in ("x", "u", "y", "effort", "peak_input", "cost"):
            np.testing.assert_array_equal(getattr(back.closed_loop[label], name), getattr(loop, name))
        np.testing.assert_array_equal(back.closed_loop[label].integral["xi"], loop.integral["xi"])
    np.testing.assert_array_equal(back.truth_of("F"), result.closed_loop["F"].x)
    assert hgorun.read(from_rest.save(tmp_path / "other.h5")).closed_loop["F10"].cost is None


def test_a_state_that_is_not_estimated_drives_nothing() -> None:
    rates = {"type": "kinetic_rate", "dilution": "0.1", "theta": 2, "yields": {"S": [-1]}}
    plant = inline({"S": "-v + 0.1*(2 - S) + u", "v": "0"}, "S", 0.5, inputs={"u": "controller"})
    with pytest.raises(ConfigError, match="does not estimate v"):
        simulated(plant, {"law": {"u": "-v"}}, {"K": rates})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"controller": {"law": {"v": "-x1"}}}, "law: the law of input u is missing"),
        ({"controller": {"law": {"u": "-x1 - z"}}}, "z"),
        (
            {"controller": {"law": {"u": "-x1"}, "saturation": {"v": [0, 1]}}},
            r"controller\.saturation\.v: input 'v' has",
        ),
        ({"controller": {"law": {}}}, r"controller\.law: expected input"),
        ({"controller": {"law": {"u": "-x1"}, "cost": {"x1": 1, "z": 1}}}, r"controller\.cost\.z: .* is not known"),
        ({"controller": {"law": {"u": "-x1"}, "saturation": {"u": [1, 0]}}}, "low < high"),
        ({"controller": {"law": {"u": "-x1"}, "integral": {"x1": "x2"}}}, "a name of the plant"),
        ({"controller": {"law": {"u": "-x1"}, "period": 0}}, "a number above 0"),
        ({"controller": {"law": {"u": "-x1"}, "cost": "x3"}}, "x3"),
        ({"controller": {"law": {"u": "-x1 - sigma"}, "truth": {"sigma": 0}}}, "no observer has a state sigma"),
        ({"controller": {"law": {"u": "1/x1"}}, "plant.initial.x1": 0.0}, "not a finite number at the start"),
        ({"plant.inputs.u": "sin(t)"}, "an input with a law is written u: controller"),
        ({"controller": None}, "there is no block controller"),
        ({"measurement": {"noise": [{"type": "gaussian", "snr_db": 20, "hold": 0.1}]}}, "give std"),
        (
            {
                "observers.F": {"type": "ekf", "theta": 1, "R": 1},
                "measurement": {"sampling": {"period": 1}, "delay": 0.5},
            },
            "replay takes",
        ),
        ({"plant.discretise": "euler", "measurement": {"sampling": {"period": 0.1}}}, "is integrated"),
    ],
)
def test_what_makes_no_sense_is_refused(cubic: Experiment, changes: Block, message: str) -> None:
    only = {f"observers.{label}": None for label in ("F20", "F50", "F100")}
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(cubic.varied(only | {"observers.F": plain(10), "observers.F10": None} | changes))
