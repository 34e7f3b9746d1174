"""A clock that began long ago: the same samples and draws, in spite of the digits that its times have lost."""

from __future__ import annotations

from typing import Any

import examples
import numpy as np
import pytest

import hgorun

CHAIN = {"states": ["x1", "x2"], "dynamics": {"x1": "x2", "x2": "-x1"}, "output": "x1", "initial": {"x1": 1, "x2": 0}}
DRAWN: dict[str, Any] = {"type": "gaussian", "std": 0.1}


def simulated(start: float, measurement: dict[str, Any], phases: tuple[float, ...] = ()) -> hgorun.Result:
    if phases:
        parts = [measurement | {"until": start + until} for until in (*phases, 10)]
        measurement = {"phases": parts}
    e = examples.experiment(CHAIN, {"S": {"type": "shgo", "theta": 2}}, end=10, step=1e-3, measurement=measurement)
    return hgorun.simulate(e.varied({"time.start": start, "time.end": start + 10, "time.output_step": 0.005}))


@pytest.mark.slow
@pytest.mark.parametrize("start", [1e6, 1.7e9, -1.7e9])
@pytest.mark.parametrize(
    "measurement",
    [
        {"noise": [DRAWN | {"hold": 0.01}]},
        {"sampling": {"period": 0.01}, "noise": [DRAWN]},
        {"sampling": {"period": 0.1, "jitter": 0.02, "dropout": 0.3}, "delay": 0.05, "noise": [DRAWN]},
    ],
    ids=["held", "sampled", "jitter"],
)
@pytest.mark.parametrize("phases", [(), (3.3,)], ids=["whole", "phases"])
def test_the_clock_changes_neither_draws_nor_samples(
    start: float, measurement: dict[str, Any], phases: tuple[float, ...]
) -> None:
    early, late = simulated(0, measurement, phases), simulated(start, measurement, phases)
    assert early.time.size == late.time.size
    assert early.measurements.time.size == late.measurements.time.size
    digits = 20 * np.spacing(abs(start))
    np.testing.assert_allclose(late.measurements.y, early.measurements.y, atol=digits)
    np.testing.assert_allclose(late.observers["S"].xhat, early.observers["S"].xhat, atol=200 * digits)


@pytest.mark.parametrize("start", [0, 1e6, 1.7e9])
def test_the_observer_gets_what_is_recorded(start: float) -> None:
    """Held noise on a continuous output: as many draws in the file as there are."""
    result = simulated(start, {"noise": [DRAWN | {"hold": 0.01}]})
    noise = result.measurements.y[:, 0] - result.x[:, 0]
    assert np.count_nonzero(np.abs(np.diff(noise)) > 1e-6) == 1000


SAMPLED: dict[str, Any] = {"sampling": {"period": 0.1}, "delay": 0.03, "noise": [DRAWN]}


@pytest.mark.costly
@pytest.mark.parametrize("start", [1e6, 1.7e9, -1.7e9])
@pytest.mark.parametrize("measurement", [{}, SAMPLED, {"delay": 0.02}], ids=["continuous", "sampled", "late"])
def test_what_does_not_read_the_clock_has_the_same_bits_at_any_time(start: float, measurement: dict[str, Any]) -> None:
    early, late = (simulated(at, measurement) for at in (0, start))
    np.testing.assert_array_equal(late.x, early.x)
    np.testing.assert_array_equal(late.observers["S"].xhat, early.observers["S"].xhat)
    for name, values in late.observers["S"].metrics.items():
        moments = start if name == "settling" else 0
        np.testing.assert_array_equal(values, early.observers["S"].metrics[name] + moments)
    np.testing.assert_array_equal(late.time, start + early.time)


def test_the_clock_that_functions_read_is_that_of_the_configuration() -> None:
    """An input, a disturbance, noise, a delay and a phase, each a function of the clock: the closed form of x."""
    origin = 1000.0
    plant = {
        "states": ["x"],
        "dynamics": {"x": "u"},
        "inputs": {"u": f"2*(t - {origin})"},
        "disturbance": {"x": f"where(t > {origin + 1}, 1, 0)"},
        "output": "x",
        "initial": {"x": 0},
    }
    noise = [{"type": "expression", "value": f"0.001*(t - {origin})"}]
    phases = [
        {"until": origin + 1, "sampling": {"times": [origin + 0.5]}, "delay": f"0.1*(t - {origin})", "noise": noise},
        {"until": origin + 2, "noise": noise},
    ]
    e = examples.experiment(
        plant, {"S": {"type": "shgo", "theta": 2}}, end=2, step=1e-3, measurement={"phases": phases}
    )
    result = hgorun.simulate(e.varied({"time.start": origin, "time.end": origin + 2, "time.output_step": 0.25}))
    since = result.time - origin
    np.testing.assert_allclose(result.x[:, 0], since**2 + np.clip(since - 1, 0, None), atol=1e-12)
    assert result.measurements.time[0] == origin + 0.5
    assert result.measurements.taken[0, 0] == pytest.approx(origin + 0.45, abs=1e-12)
    assert result.measurements.y[0, 0] == pytest.approx(0.45**2 + 0.0005, abs=1e-9)
    np.testing.assert_allclose(result.measurements.time[1:], origin + np.arange(1, 2.01, 0.25))
    np.testing.assert_allclose(result.measurements.y[-1, 0], result.y[-1, 0] + 0.002)
    steady = result.windows["steady"]
    assert steady[0] == pytest.approx(origin + 2 / 3)


@pytest.mark.slow
def test_analysis_does_not_depend_on_the_clock() -> None:
    from hgorun.analysis.report import analyze

    observers = {"S": {"type": "shgo", "theta": 2}, "R": {"type": "shgo_riccati", "theta": 2}}
    e = examples.experiment(CHAIN, observers, end=10, step=1e-3, measurement=SAMPLED)
    late = e.varied({"time.start": 1.7e9, "time.end": 1.7e9 + 10})
    found, same = analyze(e).as_json()["observers"], analyze(late).as_json()["observers"]
    for label, values in found.items():
        for key, value in values.items():
            if isinstance(value, float):
                moment = 1.7e9 if key == "excitation_at" else 0
                assert same[label][key] == pytest.approx(value + moment, rel=1e-9), key
