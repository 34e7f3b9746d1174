"""Error control without an absolute tolerance: the same in all units, and no state is too small for it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import run

from hgorun.errors import SimulationError

METHODS = ("dopri5", "rodas5p")


def reaction(a: float, b: float, c: float, time: float) -> dict[str, Any]:
    """Robertson's reaction, slower so that an explicit method follows it, counted in other units."""

    def k(rate: float, product: float, *factors: float) -> str:
        return repr(rate * time * product / float(np.prod(factors)))

    fall, rise = f"{k(0.04, a, a)}*a", f"{k(0.04, b, a)}*a"
    dynamics = {
        "a": f"-{fall} + {k(10, a, b, c)}*b*c",
        "b": f"{rise} - {k(10, b, b, c)}*b*c - {k(3e3, b, b, b)}*b*b",
        "c": f"{k(3e3, c, b, b)}*b*b",
    }
    return {
        "time": {"end": 40 / time, "output_step": 1 / time},
        "plant": {"states": ["a", "b", "c"], "dynamics": dynamics, "output": "a", "initial": {"a": a, "b": 0, "c": 0}},
        "observers": {},
    }


@pytest.mark.parametrize("method", METHODS)
def test_units_that_are_powers_of_two_change_no_bit(method: str, tmp_path: Path) -> None:
    solver = {"method": method, "rtol": 1e-6}
    plain = run(tmp_path, reaction(1, 1, 1, 1) | {"solver": solver})
    units = (2.0**40, 2.0**-37, 2.0**11)
    other = run(tmp_path, reaction(*units, 2.0**-9) | {"solver": solver})
    np.testing.assert_array_equal(other.x / units, plain.x)


@pytest.mark.parametrize("method", METHODS)
def test_a_wave_that_comes_to_states_at_zero(method: str, tmp_path: Path) -> None:
    """The tenth cell of a rod rises like t^11: its relative error does not depend on a first step."""
    cells = range(1, 11)
    dynamics = {f"T{i}": f"100*(T{i - 1} - 2*T{i} + T{i + 1})" for i in cells}
    dynamics |= {"T1": "100*(sin(t) - 2*T1 + T2)", "T10": "100*(T9 - 2*T10)"}
    config = {
        "time": {"end": 5, "output_step": 0.1},
        "plant": {"states": [*dynamics], "dynamics": dynamics, "output": "T1", "initial": dict.fromkeys(dynamics, 0)},
        "observers": {},
    }
    found = run(tmp_path, config | {"solver": {"method": method, "rtol": 1e-8}}).x
    exact = run(tmp_path, config | {"solver": {"method": "rk4", "step": 0.0005}}).x
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("measurement", [{}, {"sampling": {"period": 0.13}}, {"delay": 0.1}], ids=str)
@pytest.mark.parametrize("method", METHODS)
def test_a_filter_that_holds_nothing_but_rounding(method: str, measurement: dict[str, Any], tmp_path: Path) -> None:
    """An observer that starts at the truth: its filter is noise of 1e-17, which no step resolves."""
    config = {
        "time": {"end": 10, "output_step": 0.1},
        "plant": {
            "states": ["x1", "x2"],
            "dynamics": {"x1": "x2", "x2": "(1 - x1**2)*x2 - x1 + 0.3*sin(2*t)"},
            "output": "x1",
            "initial": {"x1": 1, "x2": 0.5},
        },
        "measurement": measurement,
        "observers": {"F": {"type": "fhgo2", "r": 2, "theta": 3, "initial": {"x1": 1, "x2": 0.5}}},
        "solver": {"method": method, "rtol": 1e-8},
    }
    result = run(tmp_path, config)
    assert result.observers["F"].diverged_at is None
    np.testing.assert_allclose(result.observers["F"].xhat, result.x, atol=1e-6)


@pytest.mark.parametrize("start", [0.0, 1e9])
@pytest.mark.parametrize("method", METHODS)
def test_a_state_at_zero_that_moves_at_once_in_a_long_run(method: str, start: float, tmp_path: Path) -> None:
    """y' = exp(-t) from zero: all of it happens within 1e-8 of the run."""
    config = {
        "time": {"start": start, "end": start + 1e9, "output_step": 1e8},
        "plant": {"states": ["y"], "dynamics": {"y": f"exp({start!r} - t)"}, "output": "y", "initial": {"y": 0}},
        "observers": {},
        "solver": {"method": method, "rtol": 1e-8},
    }
    np.testing.assert_allclose(run(tmp_path, config).x[1:, 0], 1, rtol=1e-5 if start else 1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("kink", [1e-9, 1e-6])
@pytest.mark.parametrize("method", METHODS)
def test_states_that_rise_from_below_the_smallest_numbers(method: str, kink: float, tmp_path: Path) -> None:
    """The first of twenty states in a row is t^20/20! at first, which is nothing after the first step."""
    states = [f"x{i}" for i in range(20)]
    dynamics = dict(zip(states, [*states[1:], f"where(t >= {kink}, 1, 2)"], strict=True))
    config = {
        "time": {"end": 10, "output_step": 1},
        "plant": {"states": states, "dynamics": dynamics, "output": "x0", "initial": dict.fromkeys(states, 0)},
        "observers": {},
        "solver": {"method": method, "rtol": 1e-8},
    }
    result = run(tmp_path, config)
    np.testing.assert_allclose(result.x[1:, 0], result.time[1:] ** 20 / math.factorial(20), rtol=1e-4)


@pytest.mark.costly
@pytest.mark.parametrize("jump", [1e-12, 1e-9])
@pytest.mark.parametrize("method", METHODS)
def test_a_jump_just_after_the_start(method: str, jump: float, tmp_path: Path) -> None:
    """States at zero do not move before it, and no step begins on one side of it and is evaluated on the other."""
    config = {
        "time": {"end": 1, "output_step": 0.1},
        "plant": {
            "states": ["x1", "x2"],
            "dynamics": {"x1": "x2", "x2": f"where(t >= {jump}, cos(t), 0)"},
            "output": "x1",
            "initial": {"x1": 0, "x2": 0},
        },
        "measurement": {"sampling": {"times": [jump, 2 * jump, 0.5]}},
        "observers": {},
        "solver": {"method": method, "rtol": 1e-10},
    }
    result = run(tmp_path, config)
    np.testing.assert_allclose(result.x, np.stack([1 - np.cos(result.time), np.sin(result.time)], 1), atol=1e-8)


@pytest.mark.parametrize("before", [1e-20, 1e-9])
@pytest.mark.parametrize("method", METHODS)
def test_a_jump_that_a_state_brings_about_for_one_that_has_been_tiny(
    method: str, before: float, tmp_path: Path
) -> None:
    """y' is 1 once x > 0.5: no step meets that to a part of 1e-8 of what y has been."""
    config = {
        "time": {"end": 2, "output_step": 0.1},
        "plant": {
            "states": ["x", "y"],
            "dynamics": {"x": "1 - x/10", "y": "where(x > 0.5, 1, 0)"},
            "output": "x",
            "initial": {"x": 0, "y": before},
        },
        "observers": {},
        "solver": {"method": method, "rtol": 1e-8},
    }
    exact = 2 + 10 * math.log(0.95)
    assert run(tmp_path, config).x[-1, 1] == pytest.approx(exact, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("rate", ["x**2", "-1/x", "1/(2 - x)", "-1/sqrt(x)"])
@pytest.mark.parametrize("method", METHODS)
def test_no_step_leads_over_a_singularity(method: str, rate: str, tmp_path: Path) -> None:
    config = {
        "time": {"end": 3, "output_step": 0.1},
        "plant": {"states": ["x"], "dynamics": {"x": rate}, "output": "x", "initial": {"x": 1}},
        "observers": {},
        "solver": {"method": method, "rtol": 1e-8},
    }
    with pytest.raises(SimulationError):
        run(tmp_path, config)


def test_what_decays_is_known_to_its_own_size(tmp_path: Path) -> None:
    """x' = -x from 1 to exp(-10): to the digits of what is left, and not of what has been."""
    plant = {"states": ["x"], "dynamics": {"x": "-x"}, "output": "x", "initial": {"x": 1}}
    time, solver = {"end": 10, "output_step": 1}, {"method": "dopri5", "rtol": 1e-6}
    found = run(tmp_path, {"time": time, "plant": plant, "observers": {}, "solver": solver}).x[:, 0]
    np.testing.assert_allclose(found, np.exp(-np.arange(11.0)), rtol=2e-5)
