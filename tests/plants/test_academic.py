"""The academic example: its model, and the numbers that its figures show."""

from __future__ import annotations

from typing import Any

import examples
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError

START = {"x1": 1, "x2": 1, "x3": 1}
ACADEMIC = {"type": "academic", "initial": START, "disturbance": {"x3": "0.1*sin(0.1*t)"}}
WRITTEN_OUT = {
    "states": ["x1", "x2", "x3"],
    "dynamics": {
        "x1": "f_1*x2 - 0.1*x1",
        "x2": "f_2*x3 - 0.1*x2 + tanh(x1*x2)",
        "x3": "-0.1*x3 + tanh(x1*x2) + u",
    },
    "output": "x1",
    "inputs": {"f_1": "sin(0.5*t)", "f_2": "sin(2.7*t)", "u": "5*sin(0.5*pi*t)"},
    "initial": START,
    "disturbance": {"x3": "0.1*sin(0.1*t)"},
}
NOISE = [{"type": "sinusoids", "terms": [{"amplitude": 0.25, "omega": 387}, {"amplitude": 0.5, "omega": 987}]}]


def experiment(plant: dict[str, Any], observer: dict[str, Any], end: float, **more: Any) -> hgorun.Experiment:
    return examples.experiment(plant, {"o": observer}, end=end, **more)


@pytest.mark.costly
@pytest.mark.parametrize("observer", [{"type": "shgo_riccati"}, {"type": "fhgo1", "delta": 3}, {"type": "fhgo2_nuos"}])
def test_the_model_is_the_one_written_out(observer: dict[str, Any]) -> None:
    one, two = (
        hgorun.simulate(experiment(p, {**observer, "theta": 3}, 5, solver={"step": 0.005}))
        for p in (ACADEMIC, WRITTEN_OUT)
    )
    np.testing.assert_allclose(one.x, two.x, atol=1e-12)
    np.testing.assert_allclose(one.observers["o"].xhat, two.observers["o"].xhat, atol=1e-9)


def test_parameters_change_links_and_input() -> None:
    parameters = {"a": 0.3, "c_1": 2, "omega_1": 1.1, "c_2": -0.5, "omega_2": 0.9, "c_u": 1, "omega_u": "pi"}
    plant = {
        **WRITTEN_OUT,
        "dynamics": {
            "x1": "2*sin(1.1*t)*x2 - 0.3*x1",
            "x2": "-0.5*sin(0.9*t)*x3 - 0.3*x2 + tanh(x1*x2)",
            "x3": "-0.3*x3 + tanh(x1*x2) + sin(pi*t)",
        },
        "inputs": {},
    }
    observer = {"type": "shgo_riccati", "theta": 3}
    runs = [experiment(p, observer, 5, solver={"step": 0.01}) for p in ({**ACADEMIC, "parameters": parameters}, plant)]
    np.testing.assert_allclose(hgorun.simulate(runs[0]).x, hgorun.simulate(runs[1]).x, atol=1e-12)


def test_it_is_not_for_observers_of_constant_gain() -> None:
    with pytest.raises(ConfigError) as error:
        hgorun.simulate(experiment(ACADEMIC, {"type": "shgo", "theta": 2}, 1))
    assert error.value.key == "plant"


CONTINUOUS = {
    # figure: observer, rmse, sup, hf
    "2.2": ({"type": "fhgo1", "theta": 5, "delta": 3},
            (4.1e-4, 0.0070, 0.048), (0.0017, 0.031, 0.094), (3.0e-4, 1.8e-4, 1.1e-4)),
    "2.3": ({"type": "shgo_riccati", "theta": 5},
            (0.0091, 0.144, 0.403), (0.030, 1.54, 3.3), (0.0093, 0.148, 0.41)),
    "3.2": ({"type": "fhgo2_nuos", "theta": 10, "r": 2},
            (3.0e-4, 0.0051, 0.046), (0.0012, 0.019, 0.098), (4.0e-5, 7.1e-4, 2.1e-3)),
    "3.3": ({"type": "shgo_riccati", "theta": 10},
            (0.0179, 0.736, 3.95), (0.057, 11.4, 50), (0.018, 0.755, 4.04)),
}  # fmt: skip


def within(found: np.ndarray, expected: tuple[float, ...], name: str) -> None:
    """Within 2 %, or what two digits leave open."""
    digits = [0.5 * 10 ** (np.floor(np.log10(v)) - 1) for v in expected]
    for value, number, slack in zip(found, expected, digits, strict=True):
        assert abs(value - number) <= max(0.02 * number, slack), f"{name}: {found} beside {expected}"


@pytest.mark.parametrize("figure", CONTINUOUS)
def test_numbers_of_the_figures_with_continuous_output(figure: str) -> None:
    observer, *expected = CONTINUOUS[figure]
    metrics = {"window": [10, 30], "transient": [0, 10], "average": 0.05}
    more = {
        "measurement": {"noise": NOISE},
        "metrics": metrics,
        "solver": {"step": 5e-4},
        "output_step": 1e-3,
    }
    found = hgorun.simulate(experiment(ACADEMIC, observer, 30, **more)).observers["o"].metrics
    for name, numbers in zip(("rmse", "sup", "hf"), expected, strict=True):
        within(found[name], numbers, name)


@pytest.mark.costly
def test_numbers_of_figure_3_6() -> None:
    """T_e = 0.2, d_M = 0.1: the time-varying delay d_1 = d_M |cos(k T_e)|."""
    metrics = {"window": [10, 40], "transient": [0, 10], "average": 1}
    measurement = {"sampling": {"period": 0.2}, "delay": "0.1*abs(cos(t))", "noise": NOISE}
    more = {"measurement": measurement, "metrics": metrics, "output_step": 2e-3}
    result = hgorun.simulate(experiment(ACADEMIC, {"type": "fhgo2_nuos", "theta": 2, "r": 2}, 40, **more))
    within(result.observers["o"].metrics["rmse"], (0.026, 0.054, 0.18), "rmse")
