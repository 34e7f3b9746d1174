"""Stiff plants, very high gains and what else `rodas5p` has to solve, against other integrators."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import run
from scipy.integrate import solve_ivp

from hgorun import SimulationError

ROBERTSON = {
    "states": ["a", "b", "c"],
    "dynamics": {
        "a": "-0.04*a + 1e4*b*c",
        "b": "0.04*a - 1e4*b*c - 3e7*b**2",
        "c": "3e7*b**2",
    },
    "output": "a",
    "initial": {"a": 1, "b": 0, "c": 0},
}
OSCILLATOR = {
    "states": ["x1", "x2"],
    "dynamics": {"x1": "x2", "x2": "(1 - x1**2)*x2 - x1 + 0.3*sin(2*t)"},
    "output": "x1",
    "initial": {"x1": 1, "x2": 0.5},
}
OBSERVERS = {
    "S": {"type": "shgo", "theta": 1.5, "initial": {"x1": 0.2, "x2": 0}},
    "R": {"type": "shgo_riccati", "theta": 1.2, "initial": {"x1": 0.5, "x2": 0}},
    "F": {"type": "fhgo2", "r": 1, "theta": 1.4, "initial": {"x1": 0.5, "x2": 0}},
}


def stiff(rtol: float, atol: float | None = None, **more: Any) -> dict[str, Any]:
    return {"method": "rodas5p", "rtol": rtol, "atol": rtol * 1e-2 if atol is None else atol, **more}


def robertson(t: float, x: Any) -> list[float]:
    a, b, c = x
    return [-0.04 * a + 1e4 * b * c, 0.04 * a - 1e4 * b * c - 3e7 * b**2, 3e7 * b**2]


@pytest.mark.slow
@pytest.mark.parametrize("end", [40, 4e4])
def test_robertsons_reaction(end: float, tmp_path: Path) -> None:
    """Sampled, with an observer that is singular where b is zero: it is masked, the plant is right."""
    config = {
        "time": {"end": end, "output_step": end / 40},
        "plant": ROBERTSON,
        "measurement": {"sampling": {"period": end / 40}},
        "observers": {"S": {"type": "shgo", "theta": 1, "initial": {"a": 0.9, "b": 1e-5, "c": 0.1}}},
        "solver": stiff(1e-8, 1e-12),
    }
    result = run(tmp_path, config)
    exact = solve_ivp(robertson, (0, end), [1, 0, 0], "Radau", result.time, rtol=1e-10, atol=1e-14).y.T
    np.testing.assert_allclose(result.x, exact, rtol=1e-6, atol=1e-12)
    assert np.all((result.x >= 0) & (result.x <= 1))
    np.testing.assert_allclose(result.x.sum(axis=1), 1, rtol=1e-9)


@pytest.mark.costly
def test_the_defaults_point_to_the_method_that_solves_it(tmp_path: Path) -> None:
    config = {
        "time": {"end": 40, "output_step": 1},
        "plant": ROBERTSON,
        "observers": {"S": {"type": "shgo", "theta": 1, "initial": {"a": 0.9, "b": 1e-5, "c": 0.1}}},
        "solver": {"step": 0.01},
    }
    with pytest.raises(SimulationError, match=r"solver: \{method: rodas5p\}"):
        run(tmp_path, config)


@pytest.mark.slow
def test_van_der_pol_with_jumps_between_slow_arcs(tmp_path: Path) -> None:
    """mu = 1e5, two periods: x creeps along the arcs and jumps within 1e-5 of a period."""
    mu = 1e5

    def flow(t: float, x: Any) -> list[float]:
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]]

    def slope(t: float, x: Any) -> list[list[float]]:
        return [[0, 1], [-2 * mu * x[0] * x[1] - 1, mu * (1 - x[0] ** 2)]]

    end = 3.2 * mu
    config = {
        "time": {"end": end, "output_step": end / 64},
        "plant": {
            "states": ["x", "v"],
            "dynamics": {"x": "v", "v": "mu*(1 - x**2)*v - x"},
            "parameters": {"mu": mu},
            "output": "x",
            "initial": {"x": 2, "v": 0},
        },
        "observers": {},
        "solver": stiff(1e-8),
    }
    result = run(tmp_path, config)
    exact = solve_ivp(flow, (0, end), [2, 0], "Radau", result.time, jac=slope, rtol=1e-9, atol=1e-11).y.T
    np.testing.assert_allclose(result.x[:, 0], exact[:, 0], atol=1e-5)


@pytest.mark.costly
@pytest.mark.parametrize("theta", [1e3, 1e5, 1e7])
def test_very_high_gains(theta: float, tmp_path: Path) -> None:
    """The error is that of a linear system but for phi, and dies out within some 1/theta: after 0.1, xhat = x.

    It peaks at theta/e, so that rounding leaves 1e-14 theta^2 of it.
    """
    config = {
        "time": {"end": 5, "output_step": 0.1},
        "plant": OSCILLATOR,
        "observers": {"S": {"type": "shgo", "theta": theta, "initial": {"x1": 0, "x2": 0}}},
        "solver": stiff(1e-8, divergence=1e9),
    }
    result = run(tmp_path, config)
    plain = run(tmp_path, config | {"observers": {}, "solver": {"method": "dopri5", "rtol": 1e-12, "atol": 1e-12}})
    np.testing.assert_allclose(result.x, plain.x, atol=1e-6)
    assert result.observers["S"].diverged_at is None
    np.testing.assert_allclose(result.observers["S"].xhat[1:], result.x[1:], rtol=0, atol=max(1e-6, 1e-14 * theta**2))


MEASUREMENTS: dict[str, dict[str, Any]] = {
    "continuous": {},
    "sampled, late": {"sampling": {"period": 0.23}, "delay": 0.1},
    "held noise": {"noise": [{"type": "gaussian", "std": 0.1, "hold": 0.15}]},
    "constant delay": {"delay": 0.2},
    "varying delay": {"delay": "0.2 + 0.1*sin(t)"},
    "delay with kinks": {"delay": "0.1 + 0.1*abs(sin(t))"},
    "vanishing delay": {"delay": "0.1*(1 - cos(t))"},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MEASUREMENTS)
def test_the_same_as_an_explicit_method(name: str, tmp_path: Path) -> None:
    config = {
        "time": {"end": 6, "output_step": 0.07},
        "plant": OSCILLATOR,
        "measurement": MEASUREMENTS[name],
        "observers": OBSERVERS,
    }
    exact = run(tmp_path, config | {"solver": {"method": "dopri5", "rtol": 1e-12, "atol": 1e-12}})
    gaps = []
    for rtol in (1e-6, 1e-9):
        found = run(tmp_path, config | {"solver": stiff(rtol, rtol)})
        pairs = [(found.x, exact.x), *((found.observers[k].xhat, exact.observers[k].xhat) for k in OBSERVERS)]
        gaps.append(max(float(np.abs(a - b).max()) for a, b in pairs))
    assert gaps[0] < 1e-4
    assert gaps[1] < 1e-7


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [{}, {"delay": 0.3}], ids=["continuous", "late"])
@pytest.mark.parametrize("rate", [1e2, 1e5, 1e8])
def test_the_error_follows_the_tolerance_where_a_state_follows_time(
    rate: float, measurement: dict[str, Any], tmp_path: Path
) -> None:
    """x' = rate (sin t - x): both ends of a step of any length are right, what lies between is not."""
    config = {
        "time": {"end": 4, "output_step": 0.01},
        "plant": {
            "states": ["x1"],
            "dynamics": {"x1": "rate*(sin(t) - x1)"},
            "parameters": {"rate": rate},
            "output": "x1",
            "initial": {"x1": 0},
        },
        "measurement": measurement,
        "observers": {"S": {"type": "shgo", "theta": 1, "initial": {"x1": 0}}},
    }
    for rtol in (1e-4, 1e-6, 1e-8):
        result = run(tmp_path, config | {"solver": stiff(rtol, rtol)})
        t = result.time
        exact = (rate**2 * np.sin(t) - rate * np.cos(t) + rate * np.exp(-rate * t)) / (rate**2 + 1)
        assert np.abs(result.x[:, 0] - exact).max() < 10 * rtol
        assert np.abs(result.observers["S"].xhat[:, 0] - exact).max() < 10 * rtol


def test_a_slope_that_is_infinite_is_left_out_of_the_matrix(tmp_path: Path) -> None:
    """x' = -sign(x) sqrt(|x|) from 1: (1 - t/2)^2 until t = 2, then zero, where the slope of sqrt is infinite."""
    config = {
        "time": {"end": 3, "output_step": 0.1},
        "plant": {
            "states": ["x", "y"],
            "dynamics": {"x": "-sign(x)*sqrt(abs(x))", "y": "-sign(y)*sqrt(abs(y)) + 0*x"},
            "output": "x",
            "initial": {"x": 1, "y": 0},
        },
        "observers": {},
        "solver": stiff(1e-6, 1e-8),
    }
    result = run(tmp_path, config)
    exact = np.where(result.time < 2, (1 - result.time / 2) ** 2, 0)
    np.testing.assert_allclose(result.x[:, 0], exact, atol=1e-5)
    np.testing.assert_array_equal(result.x[:, 1], 0)


@pytest.mark.costly
def test_many_observers_have_the_bits_of_one(tmp_path: Path) -> None:
    """Where there are many states they are computed in vectors and loops; with few, one by one."""
    config = {"time": {"end": 2, "output_step": 0.1}, "plant": OSCILLATOR, "measurement": {"sampling": {"period": 0.3}}}
    solver = {"method": "rodas5p", "step": 0.05}
    crowd = {f"S{i}": OBSERVERS["S"] | {"theta": 1 + 0.1 * i} for i in range(13)}
    together = run(tmp_path, config | {"observers": crowd, "solver": solver})
    for label in ("S0", "S12"):
        alone = run(tmp_path, config | {"observers": {label: crowd[label]}, "solver": solver})
        np.testing.assert_array_equal(together.observers[label].xhat, alone.observers[label].xhat)
        np.testing.assert_array_equal(together.x, alone.x)


@pytest.mark.costly
@pytest.mark.parametrize("start", [0.0, -4e11])
def test_output_points_long_before_the_end_are_where_they_stand(start: float, tmp_path: Path) -> None:
    """The first step is shorter than 1e-4: times are rounded like those of the step, not like the end of the run."""
    config = {
        "time": {"start": start, "end": start + 4e11, "output_step": 1e10},
        "plant": ROBERTSON | {"initial": {"a": 1, "b": 1e-9, "c": 1e-9}},
        "observers": {},
        "solver": {"method": "rodas5p", "rtol": 1e-10},
    }
    np.testing.assert_array_equal(run(tmp_path, config).x[0], [1, 1e-9, 1e-9])
