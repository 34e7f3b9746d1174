"""The phytoplankton model: its triangular coordinates, and the numbers that its figures show."""

from __future__ import annotations

from typing import Any

import casadi as ca
import examples
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError
from hgorun.symbolic.triangular import TriangularForm

PLANT = {
    "type": "phytoplankton",
    "inputs": {"u": "1.71*(1 + 0.6*sin(6*pi*t))"},
    "initial": {"x1": 3, "x2": 1.7, "x3": 0.03},
}
T_S = 0.02
NOISE = [
    {
        "type": "sinusoids",
        "terms": [
            {"amplitude": 0.01, "omega": f"pi*(0.95 + 0.05*{j}/25)/{T_S}", "phase": f"-pi*{j}*({j} + 1)/26"}
            for j in range(26)
        ],
    }
]
START = {
    "initial": {"x1": 2.5, "x2": 1.6, "x3": 0.05},
    "internal": {"P": 0.1},
    "saturation": {"z1": [0.5, 6], "z2": [0.2, 1], "z3": [1, 50]},
}


def experiment(observer: dict[str, Any], end: float = 6, **more: Any) -> hgorun.Experiment:
    common = {
        "time": {"end": end, "output_step": 1e-3, "unit": "d"},
        "measurement": {"sampling": {"period": T_S}, "noise": NOISE, "mode": "multiplicative"},
        "metrics": {"window": [2, 6], "transient": [0, 2], "average": 5 * T_S} if end == 6 else {},
    }
    return examples.experiment(PLANT, {"o": observer}, step=1e-3, **{**common, **more})


def test_the_model_is_triangular_in_the_coordinates_of_the_thesis() -> None:
    """F_1, F_2 and phi as printed after (2.90), and the way back to x."""
    e = experiment({"type": "shgo_riccati", "theta": 5, **START})
    form = e.forms["o"]
    assert isinstance(form, TriangularForm)
    assert (form.block, form.measured, form.saturable(False)) == ((0, 1, 2), (0,), ("z1", "z2", "z3"))
    p = ca.DM(e.plant.parameters)
    a_1, a_2, a_3 = e.plant.parameters
    z, u = ca.SX.sym("z", 3), ca.SX.sym("u")
    copy = form.copy(ca.SX(0), u, p, False, {})
    model = ca.Function("model", [z, u], [copy.F(z), copy.copy(z), copy.state(z)])
    for z1, z2, z3, value in np.random.default_rng(0).uniform([0.5, 0.2, 1, 0], [6, 1, 50, 3], (10, 4)):
        F, f, x = (np.asarray(m) for m in model([z1, z2, z3], value))
        expected = np.array([[0, -a_2 * z1, 0], [0, 0, a_1 * a_3 * z2**2], [0, 0, 0]])
        phi = [
            (a_2 - value) * z1,
            a_2 * z2 - (a_2 + a_3) * z2**2,
            -a_1 * z1 * z3**3 + z3**2 * (z1 - value * (1 + a_1)) + value * z3,
        ]
        np.testing.assert_allclose(F, expected, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(f[:, 0], expected @ [z1, z2, z3] + phi, rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(x[:, 0], [z1, 1 / z2, 1 / z3 - a_1], rtol=1e-13)
        np.testing.assert_allclose(form.start(x[:, 0], e.plant.parameters, False), [z1, z2, z3], rtol=1e-12)


def test_an_initial_estimate_without_an_image_is_refused() -> None:
    with pytest.raises(ConfigError, match="no image") as error:
        hgorun.simulate(experiment({"type": "fhgo1", "theta": 5, "delta": 7, "initial": {"x1": 2, "x3": 0.1}}))
    assert error.value.key == "observers.o.initial"


def test_saturation_is_named_in_triangular_coordinates() -> None:
    observer = {"type": "fhgo1", "theta": 5, "delta": 7, **START, "saturation": {"x2": [1, 5]}}
    with pytest.raises(ConfigError, match="z1, z2, z3"):
        hgorun.simulate(experiment(observer))


@pytest.mark.parametrize(
    ("observer", "rmse"),
    [
        ({"type": "fhgo1", "theta": 5, "delta": 7}, (0.0022, 0.00055, 8.1e-6)),
        ({"type": "shgo_riccati", "theta": 5}, (0.0101, 0.0113, 0.00064)),
    ],
    ids=["2.9", "2.10"],
)
def test_numbers_of_figures_2_9_and_2_10(observer: dict[str, Any], rmse: tuple[float, ...]) -> None:
    result = hgorun.simulate(experiment({**observer, **START}))
    np.testing.assert_allclose(result.observers["o"].metrics["rmse"], rmse, rtol=0.02)


def test_the_form_of_the_gain_does_not_matter_in_these_coordinates() -> None:
    other = {"equation": "lyapunov", "internal": {"S": 10}}
    P, S = (
        hgorun.simulate(experiment({"type": "shgo_riccati", "theta": 5, **START, **form}, end=1))
        for form in ({}, other)
    )
    np.testing.assert_allclose(P.observers["o"].xhat, S.observers["o"].xhat, rtol=1e-6)
