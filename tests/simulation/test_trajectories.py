"""Trajectories against the plain simulator in naive.py: it makes the same steps, so the differences are rounding."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import prepared, run
from naive import Field, Vector
from naive import simulate as plainly
from plain_trajectories import (
    CLOSE,
    CONTOIS,
    COUNTED,
    DRAWN,
    END,
    EVERY,
    HELD,
    HOLD_CHANGES,
    INTEGRATORS,
    IRREGULAR,
    MIXED,
    MODELS,
    PERIODIC,
    SCENARIOS,
    SINE,
    STEP,
    THETA,
    VAN_DER_POL,
    Model,
    check,
    configuration,
    difference_to_plain,
    held,
    mixed,
    sampled,
    sine,
    van_der_pol_copy,
)
from scipy.integrate import solve_ivp

from hgorun import Result
from hgorun.measurement.chance import generator


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_measurement(name: str, tmp_path: Path) -> None:
    check(tmp_path, VAN_DER_POL, SCENARIOS[name])


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["varying delay", "sampled, out of order"])
@pytest.mark.parametrize("name", [name for name in MODELS if name != "van der pol"])
def test_every_plant(name: str, scenario: str, tmp_path: Path) -> None:
    check(tmp_path, MODELS[name], SCENARIOS[scenario])


# ---- what needs more than a table ----


@pytest.mark.slow
def test_start_away_from_zero(tmp_path: Path) -> None:
    """Samples, holds and delays count from the start; functions of time do not."""

    def late_held(t: float, mid: float) -> float:
        return held(t, mid - 5)

    def lag(t: float) -> float:
        return 0.25 + 0.1 * np.sin(2 * t)

    scenarios: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"sampling": {"period": 0.25}, "noise": COUNTED, "delay": MIXED}, sampled(5 + EVERY, delay=mixed)),
        ({"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE}, {"delay": lag, "noise": sine}),
        ({"noise": HELD}, {"noise": late_held, "events": 5 + np.array(HOLD_CHANGES)}),
    ]
    time = {"start": 5, "end": 8, "output_step": 0.037}
    for block, options in scenarios:
        result = run(tmp_path, configuration(VAN_DER_POL, block, time=time))
        options = options | {"t0": 5.0, "t_end": 8.0}
        assert difference_to_plain(result, VAN_DER_POL, options) < CLOSE


@pytest.mark.costly
def test_jitter_and_dropout(tmp_path: Path) -> None:
    """Which samples come, and when, is read from the result; the rest follows."""
    sampling = {"period": 0.1, "offset": 0.05, "jitter": 0.04, "dropout": 0.3}
    block = {"sampling": sampling, "noise": DRAWN, "delay": "0.15 + 0.1*sin(9*t)"}
    result = run(tmp_path, configuration(VAN_DER_POL, block), "seed=3")
    times = result.measurements.time
    number = np.rint((times - 0.05) / 0.1).astype(int)
    moved = np.abs(times - 0.05 - 0.1 * number)
    assert 0.03 < moved.max() <= 0.04
    assert np.all(np.diff(number) > 0)
    assert 15 <= len(number) <= 26  # of 30
    gauss, flat = (generator(3, "noise", "x1/0", i) for i in range(2))
    count = number[-1] + 1  # a lost sample has its draw too
    noise = gauss.normal(0, 1, count) * 0.1 + flat.uniform(-0.1, 0.2, count)
    options: dict[str, Any] = {"sampling": times, "noise": noise[number], "delay": lambda t: 0.15 + 0.1 * np.sin(9 * t)}
    assert difference_to_plain(result, VAN_DER_POL, options) < CLOSE


@pytest.mark.costly
@pytest.mark.parametrize("name", ["sampled", "varying delay", "continuous, held"])
def test_initial_filter_state_gains_and_theta(name: str, tmp_path: Path) -> None:
    eta0, gains = [0.3, -0.2], [3.0, 4.0, 2.5, 1.0]
    scenario = SCENARIOS[name]
    config = configuration(VAN_DER_POL, scenario.block)
    config["observers"] = {"F": {"type": "fhgo2", "r": 2, "theta": 2.2, "gains": gains, "internal": {"eta": eta0}}}
    result = run(tmp_path, config)
    common: dict[str, Any] = {"theta": 2.2, "gains": gains, "r": 2, "eta0": eta0, "t_end": END, "step": STEP}
    model = replace(VAN_DER_POL, xhat0=[0.0, 0.0])
    options = common | scenario.options | {"output_times": result.time}
    plain = plainly(model.f, model.h, model.copy, model.x0, model.xhat0, **options)
    np.testing.assert_allclose(result.observers["F"].xhat, plain["xhat"], rtol=0, atol=CLOSE)
    np.testing.assert_allclose(result.observers["F"].internal["eta"], plain["eta"], rtol=0, atol=CLOSE)
    assert np.array_equal(result.observers["F"].internal["eta"][0], eta0)


@pytest.mark.costly
@pytest.mark.parametrize("is_sampled", [False, True])
def test_jumping_input(is_sampled: bool, tmp_path: Path) -> None:
    """From jump to jump by the plain simulator, started again each time; a sample arrives at every jump."""

    def field(u: float) -> Field:
        return lambda t, x: van_der_pol_copy(t, x) + np.array([0.0, u])

    block = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "0.5*(1 - x1**2)*x2 - x1 + u"},
        "output": "x1",
        "inputs": {"u": "sign(sin(pi*t/0.6))"},
        "initial": {"x1": 1, "x2": 0.5},
    }
    model = replace(VAN_DER_POL, block=block)
    period = 0.15
    measurement = {"sampling": {"period": period}, "noise": SINE} if is_sampled else {"noise": SINE}
    time = {"end": END, "output_step": 0.05}
    result = run(tmp_path, configuration(model, measurement, time=time))
    for label, r in [("S", 0), ("F0", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
        x, xhat, eta = np.array(model.x0), np.array(model.xhat0), np.zeros(r)
        for piece in range(5):
            t0, t1, u = 0.6 * piece, 0.6 * (piece + 1), (-1.0) ** piece
            rows = slice(12 * piece, 12 * piece + 13)
            options: dict[str, Any] = {"theta": THETA, "gains": 1.0, "step": STEP, "t0": t0, "t_end": t1, "eta0": eta}
            arrivals = t0 + period * np.arange(4)
            seen = {"sampling": arrivals, "noise": [sine(t) for t in arrivals]} if is_sampled else {"noise": sine}
            options |= seen | {"output_times": np.clip(result.time[rows], t0, t1)}
            plain = plainly(field(u), model.h, field(u), x, xhat, r=r, **options)
            np.testing.assert_allclose(result.x[rows], plain["x"], rtol=0, atol=CLOSE)
            np.testing.assert_allclose(result.observers[label].xhat[rows], plain["xhat"], rtol=0, atol=CLOSE)
            x, xhat, eta = plain["x"][-1], plain["xhat"][-1], plain["eta"][-1]


@pytest.mark.costly
def test_two_outputs_of_two_separate_plants(tmp_path: Path) -> None:
    """Each output has its own measurement; an observer of both is two observers of one."""
    block = {
        "states": ["a1", "a2", "b1", "b2", "b3"],
        "dynamics": {
            "a1": "a2",
            "a2": "0.5*(1 - a1**2)*a2 - a1",
            "b1": "b2",
            "b2": "b3",
            "b3": "-b1 - 2*b2 - tanh(b3) + u*b1",
        },
        "output": ["a1", "b1"],
        "inputs": {"u": "cos(2*t)"},
        "initial": {"a1": 1, "a2": 0.5, "b1": 1, "b2": -0.5, "b3": 0.3},
    }
    first, second = replace(VAN_DER_POL, f=van_der_pol_copy), INTEGRATORS
    model = Model(block, first.f, first.f, [], first.xhat0 + second.xhat0)
    a = {"sampling": {"times": IRREGULAR.tolist()}, "noise": COUNTED, "delay": MIXED}
    b = {"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE}
    config = configuration(model, {"outputs": {"a1": a, "b1": b}})
    result = run(tmp_path, config)
    # All steps land on the events of both; those that the delay repeats, the plain simulator finds by itself.
    all_events = prepared(tmp_path, config).schedule.events
    samples = [*IRREGULAR, *(t - mixed(t) for t in IRREGULAR)]
    late: dict[str, Any] = {"delay": lambda t: 0.25 + 0.1 * np.sin(2 * t), "noise": sine, "events": samples}
    parts = [
        (first, slice(0, 2), 0, sampled(IRREGULAR, delay=mixed, events=all_events)),
        (second, slice(2, 5), 1, late),
    ]
    for part, states, column, options in parts:
        for label, r in [("S", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
            common: dict[str, Any] = {"theta": THETA, "gains": 1.0, "t_end": END, "step": STEP, "r": r}
            common |= options | {"output_times": result.time}
            plain = plainly(part.f, part.h, part.copy, part.x0, part.xhat0, **common)
            found = result.observers[label]
            np.testing.assert_allclose(found.xhat[:, states], plain["xhat"], rtol=0, atol=CLOSE)
            if r:
                eta = found.internal["eta"].reshape(-1, r, 2)[:, :, column]
                np.testing.assert_allclose(eta, plain["eta"], rtol=0, atol=CLOSE)
    np.testing.assert_allclose(result.x[:, 2:], plain["x"], rtol=0, atol=CLOSE)
    seen = result.measurements
    is_sample = ~np.isnan(seen.y[:, 0])
    np.testing.assert_array_equal(seen.time[is_sample], IRREGULAR)
    np.testing.assert_array_equal(seen.time[~np.isnan(seen.y[:, 1])], result.time)


@pytest.mark.costly
@pytest.mark.parametrize(
    "measurement",
    [{"noise": SINE}, PERIODIC | {"delay": MIXED}, {"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE}],
    ids=["continuous", "sampled", "delayed"],
)
def test_canonical_coordinates_are_the_original_ones_seen_through_the_map(
    measurement: dict[str, Any], tmp_path: Path
) -> None:
    config = configuration(CONTOIS, measurement, solver={"step": 0.002})
    original = run(tmp_path, config)
    for block in config["observers"].values():
        block["coordinates"] = "canonical"
    canonical = run(tmp_path, config)
    for label, found in canonical.observers.items():
        np.testing.assert_allclose(found.xhat, original.observers[label].xhat, rtol=0, atol=1e-9)


@pytest.mark.costly
def test_recorded_continuous_measurements(tmp_path: Path) -> None:
    """Of what time they speak, and the noisy value, on the output grid."""
    for name, scenario in SCENARIOS.items():
        if "sampling" in scenario.options:
            continue
        result = run(tmp_path, configuration(VAN_DER_POL, scenario.block))
        seen, options = result.measurements, scenario.options
        lag = options.get("delay", 0.0)
        lags = np.array([lag(t) for t in result.time]) if callable(lag) else lag
        taken = np.maximum(result.time - lags, 0)
        np.testing.assert_array_equal(seen.time, result.time)
        np.testing.assert_allclose(seen.taken[:, 0], taken, rtol=0, atol=1e-15)
        past = solve_ivp(VAN_DER_POL.f, (0, END), VAN_DER_POL.x0, dense_output=True, rtol=1e-11, atol=1e-12).sol(taken)[
            0
        ]
        v = np.array([options["noise"](t, t) for t in result.time])
        noisy = past * (1 + v) if options.get("multiplicative") else past + v
        np.testing.assert_allclose(seen.y[:, 0], noisy, rtol=0, atol=1e-6, err_msg=name)


@pytest.mark.costly
def test_signal_to_noise_ratio(tmp_path: Path) -> None:
    """20 dB: the variance of the noise is a hundredth of the mean square of the output over the run."""
    noise = [{"type": "gaussian", "snr_db": 20}]
    config = configuration(VAN_DER_POL, {"sampling": {"period": 0.2}, "noise": noise})
    config["time"] = {"end": END, "output_step": 0.01}
    for solver in ({"step": 0.01}, {}):
        result = run(tmp_path, config | {"solver": solver})
        y = result.y[:, 0]
        mean_square = np.trapezoid(y**2, result.time) / END
        draws = generator(0, "noise", "x1/0", 0).normal(0, 1, 16)
        np.testing.assert_allclose(result.measurements.y[:, 0] - y[::20], draws * np.sqrt(mean_square / 100), rtol=1e-4)


# ---- events that differ by a rounding error ----


def gap(a: Result, b: Result) -> float:
    return max(float(np.abs(a.observers[k].xhat - b.observers[k].xhat).max()) for k in a.observers)


@pytest.mark.costly
def test_a_phase_begins_at_an_event_that_is_a_rounding_error_earlier(tmp_path: Path) -> None:
    """1.4 - 0.8 < 0.6: the sample that arrives at 1.4 was taken just before the phase change at 0.6."""

    def config(delay: float) -> dict[str, Any]:
        second = {"until": END, "sampling": {"period": 0.2}, "delay": delay, "noise": SINE}
        return configuration(VAN_DER_POL, {"phases": [{"until": 0.6, "noise": SINE}, second]})

    assert 0.6 + 4 * 0.2 - 0.8 < 0.6
    assert gap(run(tmp_path, config(0.8)), run(tmp_path, config(0.8 - 1e-8))) < 1e-6


def test_the_first_sample_arrives_a_rounding_error_after_an_event(tmp_path: Path) -> None:
    """0.1 + 0.2 > 0.3, where the disturbance has a kink."""
    disturbance = {"x2": "0.2*abs(0.3 - t)"}
    model = replace(VAN_DER_POL, block=VAN_DER_POL.block | {"disturbance": disturbance})

    def config(offset: float | str) -> dict[str, Any]:
        return configuration(model, {"sampling": {"period": 1, "offset": offset}})

    assert gap(run(tmp_path, config("0.1+0.2")), run(tmp_path, config(0.3 + 1e-8))) < 1e-6


def test_a_listed_sample_at_the_beginning_of_a_phase_belongs_to_it(tmp_path: Path) -> None:
    def times(until: str) -> Vector:
        phases = [{"until": until}, {"until": END, "sampling": {"times": [0.6, 1.6]}}]
        return run(tmp_path, configuration(VAN_DER_POL, {"phases": phases})).measurements.time

    assert 0.1 * 6 > 0.6
    np.testing.assert_allclose(times("0.1*6")[-2:], [0.6, 1.6], rtol=0, atol=1e-15)


def test_a_jump_that_rounding_moves_off_its_event(tmp_path: Path) -> None:
    """sin(pi (t + 1000)) changes sign some hundred ulp beside the integers, where samples arrive."""
    block = {"type": "integrator_chain", "n": 2, "phi": "u", "initial": {"x1": 0, "x2": 0}}
    block["inputs"] = {"u": "sign(sin(pi*(t + 1000)))"}
    model = Model(block, van_der_pol_copy, van_der_pol_copy, [], [0.1, 0.1])
    result = run(tmp_path, configuration(model, {"sampling": {"period": 0.5}}, solver={"step": 0.1}))
    t = result.time
    speed = np.where(t < 1, t, np.where(t < 2, 2 - t, t - 2))
    np.testing.assert_allclose(result.x[:, 1], speed, rtol=0, atol=1e-11)
