"""Methods with error control against the plain simulator: samples that are late, move, overtake, change in kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from examples import run
from naive import simulate
from scipy.integrate import solve_ivp

Vector = npt.NDArray[np.float64]
END = 6.0
OSCILLATOR = {
    "states": ["x1", "x2"],
    "dynamics": {"x1": "x2", "x2": "(1 - x1**2)*x2 - x1 + 0.3*sin(2*t)"},
    "output": "x1",
    "initial": {"x1": 1, "x2": 0.5},
}
NOISE = [{"type": "gaussian", "std": 0.1}]
MEASUREMENTS: dict[str, dict[str, Any]] = {
    "shifted": {"sampling": {"period": 0.37, "offset": 0.11}},
    "jitter": {"sampling": {"period": 0.4, "jitter": 0.3}},
    "late": {"sampling": {"period": 0.23}, "delay": 0.31},
    "later and later": {"sampling": {"period": 0.3}, "delay": "0.1 + 0.1*t"},
    "overtaking": {"sampling": {"period": 0.25}, "delay": "where(sin(4*t) > 0, 0.55, 0.05)"},
    "jitter, shifted, late, noise": {
        "sampling": {"period": 0.4, "jitter": 0.2, "offset": 0.13},
        "delay": "0.3 + 0.25*sin(5*t)",
        "noise": NOISE,
    },
    "phases": {
        "phases": [
            {"until": 2.1, "sampling": {"period": 0.2}, "delay": 0.1, "noise": NOISE},
            {"until": 3.9, "sampling": {"period": 0.35, "jitter": 0.1}, "delay": 0.6},
            {"until": 6, "sampling": {"times": [3.95, 4.0, 4.9, 5.6]}, "delay": "0.2*abs(sin(3*t))", "noise": NOISE},
        ]
    },
}
OBSERVERS: dict[str, dict[str, Any]] = {
    "S": {"type": "shgo", "theta": 1.5, "initial": {"x1": 0.2, "x2": 0}},
    "F": {"type": "fhgo2", "r": 1, "theta": 1.5, "initial": {"x1": 0.2, "x2": 0}},
}


def field(t: float, x: Vector) -> Vector:
    return np.array([x[1], (1 - x[0] ** 2) * x[1] - x[0] + 0.3 * np.sin(2 * t)])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dopri5", "rodas5p"])
@pytest.mark.parametrize("name", MEASUREMENTS)
def test_samples(name: str, method: str, tmp_path: Path) -> None:
    """The plain simulator gets the times and noise of the run; all that follows from them is its own."""
    config = {
        "time": {"end": END, "output_step": 0.07},
        "plant": OSCILLATOR,
        "measurement": MEASUREMENTS[name],
        "observers": OBSERVERS,
        "solver": {"method": method, "rtol": 1e-9},
    }
    result = run(tmp_path, config)
    plant = solve_ivp(field, (0, END), [1.0, 0.5], "DOP853", rtol=1e-12, atol=1e-12, dense_output=True).sol
    np.testing.assert_allclose(result.x, plant(result.time).T, rtol=0, atol=1e-6)
    got = result.measurements
    delay, noise = got.time - got.taken[:, 0], got.y[:, 0] - plant(got.taken[:, 0])[0]
    for label, r in (("S", 0), ("F", 1)):
        plain = simulate(
            field, lambda x: float(x[0]), field, [1.0, 0.5], [0.2, 0.0],
            theta=1.5, gains=1.0, r=r, t_end=END, step=0.01, output_times=result.time,
            sampling=got.time, delay=delay, noise=noise,
        )  # fmt: skip
        np.testing.assert_allclose(result.observers[label].xhat, plain["xhat"], rtol=0, atol=1e-6, err_msg=label)
