"""Whether an estimate is lost: the rule, and runs that confirm it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import chain as integrators
from examples import run, simulated
from scipy.integrate import solve_ivp

import hgorun
from hgorun.result.evaluation.estimated import Estimated
from hgorun.simulation.divergence.verdict import estimates_near, left_for_good, may_have_left

T = np.linspace(0, 10, 1001)


def rows(*columns: Any) -> np.ndarray:
    return np.column_stack([np.broadcast_to(c, T.shape) for c in columns])


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_the_rule_knows_no_units(unit: float) -> None:
    x = unit * rows(np.cos(T), 0 * T)
    peaks = unit * rows(1e9 * np.exp(-10 * T), 1e12 * np.exp(-20 * T))
    grows = unit * rows(1e-3 * np.exp(5 * T), 0 * T)
    noise = unit * rows(0 * T, np.sin(30 * T))  # of a state that is zero
    assert left_for_good(x, x + peaks) is None
    assert left_for_good(x, x + noise) is None
    first = left_for_good(x, x + grows)
    assert first is not None
    assert T[first] == pytest.approx(np.log(1e9) / 5, abs=0.011)
    for gap in (peaks, noise):
        assert left_for_good(x, x + gap) is None
    both = np.stack([x + grows, x + peaks], axis=2)
    assert may_have_left(x[[0, -1], :, None], both[[0, -1]]).tolist() == [True, False]


def test_rounding_of_a_state_at_rest_is_no_size() -> None:
    x = rows(np.cos(T), 1e-16 * T)
    noise = rows(0 * T, 0.02 * np.sin(30 * T) + 0.001)
    assert left_for_good(x, x + noise) is None
    assert left_for_good(x, x + rows(0 * T, 1e-6 * np.exp(5 * T))) is not None


def test_errors_that_fade_end_in_rounding() -> None:
    """Of a state at rest: far above the smallest of them, and far below those at the start."""
    faded = 1e-9 * T * np.exp(-50 * T)
    faded[-3:] = 1e-28
    assert left_for_good(rows(0 * T), rows(faded)) is None
    assert left_for_good(rows(0 * T), rows(1e-28 * T * np.exp(20 * T))) is not None


@pytest.mark.parametrize("last", [0.0, 1.0, 2e6, -3e6, 1e300, np.inf, np.nan])
def test_what_is_near_at_the_end_may_not_have_left(last: float) -> None:
    x = np.array([[1.0, 0.5], [2.0, 1.0]])
    xhat = np.array([[5.0, 0.0, 1.0, 0.5], [2.0, 1.0, 2.0, last]])
    near = estimates_near(Estimated.same(x, 2), Estimated(xhat, [[0, 1], [2, 3]]))
    left = may_have_left(x[:, :, None], xhat.reshape(2, 2, 2).swapaxes(1, 2))
    assert near == (abs(last) < 1.1e6)
    assert not (near and left.any())


def test_what_is_not_a_number_is_beyond_every_bound() -> None:
    x = rows(np.cos(T))
    xhat = x + 0.1
    xhat[700:] = np.nan
    assert left_for_good(x, xhat) == 700
    assert left_for_good(x, np.full_like(x, np.nan)) == 0
    assert left_for_good(x, np.where(T[:, None] < 5, np.nan, x)) is None


def chain(theta: float, step: float, unit: float = 1.0) -> dict[str, Any]:
    """Four integrators, whose estimate peaks like theta^3, in another unit."""
    return {
        "time": {"end": 2, "output_step": 0.001},
        "plant": {"type": "integrator_chain", "n": 4, "phi": "-x1", "initial": {"x1": unit, "x2": 0, "x3": 0, "x4": 0}},
        "observers": {"S": {"type": "shgo", "theta": theta}},
        "solver": {"step": step},
    }


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_a_peak_is_no_divergence(unit: float, tmp_path: Path) -> None:
    """theta = 300: against DOP853 on the observer's equations."""
    theta, K = 300.0, np.array([4.0, 6.0, 4.0, 1.0])
    plant, shift = np.diag(np.ones(3), 1), np.diag(np.ones(3), 1)
    plant[3, 0] = shift[3, 0] = -1

    def slopes(t: float, z: np.ndarray) -> np.ndarray:
        x, xhat = z[:4], z[4:]
        return np.concatenate([plant @ x, shift @ xhat - theta ** np.arange(1, 5) * K * (xhat[0] - x[0])])

    result = run(tmp_path, chain(theta, 1e-4, unit))
    observer = result.observers["S"]
    early = result.time <= 0.05
    exact = (
        solve_ivp(slopes, (0, 0.05), [1, 0, 0, 0, 0, 0, 0, 0], "DOP853", result.time[early], rtol=1e-11, atol=1e-9)
        .y[4:]
        .T
    )
    assert observer.status == result.status == "ok"
    assert np.max(np.abs(exact[:, 3])) > 4.2e6
    np.testing.assert_allclose(observer.xhat[early] / unit, exact, atol=1e-5 * np.max(np.abs(exact)))
    assert np.max(np.abs(observer.xhat[-1] - result.x[-1])) < 5e-9 * unit


def test_long_steps_are_told_from_divergence(tmp_path: Path) -> None:
    result = run(tmp_path, chain(300, 0.02))
    observer = result.observers["S"]
    assert observer.status == result.status == "inaccurate"
    assert observer.reason == "diverges with steps of 0.02, but not with shorter ones: give a step of at most 0.005"
    assert observer.lost
    assert np.all(np.isinf(observer.metrics["rmse"]))


@pytest.mark.parametrize("step", [0.02, 0.005, 0.001])
def test_a_far_first_estimate_converges(step: float, tmp_path: Path) -> None:
    """van der Pol from (25, 0): x1^2 x2 is stiff there, and steps of 0.02 are too long for it."""
    config = {
        "time": {"end": 20, "output_step": 0.1},
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
        "observers": {"S": {"type": "shgo", "theta": 1, "initial": {"x1": 25, "x2": 0}}},
        "solver": {"step": step},
    }
    observer = run(tmp_path, config).observers["S"]
    if step == 0.02:
        assert observer.status == "inaccurate"
        assert observer.reason is not None
        assert observer.reason.endswith("give a step of at most 0.005")
    else:
        assert observer.status == "ok"
        assert observer.metrics["peak"][1] == pytest.approx(1.183, abs=2e-3)


@pytest.mark.parametrize("stiff", [True, False])
def test_a_stiff_plant_is_told_from_one_that_diverges(stiff: bool, tmp_path: Path) -> None:
    """Robertson's reaction stays in [0, 1]; steps of 0.01 are 20 times too long for it. x' = x^2 has a pole at 1."""
    robertson = {
        "states": ["a", "b", "c"],
        "dynamics": {"a": "-0.04*a + 1e4*b*c", "b": "0.04*a - 1e4*b*c - 3e7*b**2", "c": "3e7*b**2"},
        "output": "a",
        "initial": {"a": 1, "b": 0, "c": 0},
    }
    pole = {"states": ["x"], "dynamics": {"x": "x**2"}, "output": "x", "initial": {"x": 1}}
    config = {
        "time": {"end": 2, "output_step": 0.1},
        "plant": robertson if stiff else pole,
        "observers": {},
        "solver": {"method": "rk4", "step": 0.01},
    }
    with pytest.raises(hgorun.SimulationError) as error:
        run(tmp_path, config)
    if stiff:
        assert "it diverges with steps of 0.01, but not with shorter ones: give a step of at most" in str(error.value)
        given = float(str(error.value).split("at most ")[1].split(",")[0])
        x = run(tmp_path, config | {"solver": {"step": given}}).x
        assert np.all((x >= -1e-9) & (x <= 1 + 1e-9))
    else:
        assert "the plant itself diverged at t = 1" in str(error.value)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_divergence_is_said_in_any_unit(unit: float, tmp_path: Path) -> None:
    """x1' = -x1 with xhat' = -xhat + 12 e grows like exp(11 t) in units of x."""
    config = {
        "time": {"end": 4, "output_step": 0.01},
        "plant": {"states": ["x"], "dynamics": {"x": "-x"}, "output": "x", "initial": {"x": unit}},
        "observers": {"S": {"type": "shgo", "theta": 1, "gains": [-12]}},
        "solver": {"step": 0.01},
    }
    result = run(tmp_path, config)
    observer = result.observers["S"]
    assert observer.status == "diverged"
    assert observer.diverged_at is not None
    assert 1.2 < observer.diverged_at < 4
    assert np.all(np.isnan(observer.xhat[result.time >= observer.diverged_at]))
    assert np.all(np.isfinite(observer.xhat[result.time < observer.diverged_at - 0.02]))
    assert np.all(np.isinf(observer.metrics["sup"]))


RELAYS: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({"type": "super_twisting", "f": 1e12}, {"solver": {"method": "euler", "step": 1e-3}}),
    ({"type": "super_twisting", "f": 1e300}, {"solver": {"method": "euler", "step": 1e-3}}),
    ({"type": "red", "L": 1e9, "discretisation": "explicit"}, {"measurement": {"sampling": {"period": 0.01}}}),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("block", "how"), RELAYS)
def test_a_relay_that_swamps_the_state_is_not_ok(block: dict[str, Any], how: dict[str, Any]) -> None:
    """It chatters by gain times step from the first step on, and has not left anything."""
    found = simulated(integrators(2, "-sin(t)", [0, 1]), {"O": block}, end=2, **how).observers["O"]
    assert found.status == "inaccurate"
    assert "gains are too large for the step" in str(found.verdict.reason)
    assert np.all(np.isfinite(found.xhat))


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_relay_that_follows_is_ok_in_every_unit(size: float) -> None:
    block = {"type": "super_twisting", "f": 2 * size}
    how = {"solver": {"method": "euler", "step": 1e-3}}
    assert (
        simulated(integrators(2, f"-{size}*sin(t)", [0, size]), {"O": block}, end=2, **how).observers["O"].status
        == "ok"
    )
