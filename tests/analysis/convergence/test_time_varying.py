"""Observers whose gain follows F(u, xhat): the transient that their S promises, and the constants of the theorems."""

from typing import Any

import numpy as np
import pytest
from examples import findings, said
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun import Experiment
from hgorun.analysis.convergence import time_varying
from hgorun.analysis.convergence.lipschitz import Lipschitz
from hgorun.analysis.convergence.time_varying import Gramian
from hgorun.analysis.report import analyze
from hgorun.observers.riccati import stationary
from hgorun.simulation.simulate import simulate

ASKED = findings("decay", "convergence")
FAMILIES: list[dict[str, Any]] = [
    {"type": "shgo_riccati"},
    {"type": "shgo_riccati", "equation": "lyapunov"},
    {"type": "fhgo2_nuos", "r": 1},
    {"type": "fhgo2_nuos", "r": 2},
    {"type": "fhgo2_nuos", "r": 2, "gain": "full"},
]


def config(rng: np.random.Generator, block: dict[str, Any], theta: float, *, noisy: bool) -> dict[str, Any]:
    """Links that vary between 0.6 and 1.4; weak nonlinearities, since theta_bound is 4 sqrt(chi) c_1."""
    a, b, c = rng.uniform(-0.02, 0.02, 3) / (1 + 3 * block.get("r", 0))
    plant: dict[str, Any] = {
        "states": ["x1", "x2"],
        "dynamics": {
            "x1": f"(1 + 0.4*sin(t))*x2 + ({a:.4f})*sin(x1)",
            "x2": f"({b:.4f})*tanh(x1) + ({c:.4f})*cos(x2)",
        },
        "output": "x1",
        "initial": {"x1": float(rng.uniform(-1, 1)), "x2": float(rng.uniform(-1, 1))},
    }
    measurement: dict[str, Any] = {}
    if noisy:
        plant["disturbance"] = {"x2": "0.1*cos(t)"}
        measurement["noise"] = [{"type": "sinusoids", "terms": [{"amplitude": 0.05, "omega": 20}]}]
    return {
        "time": {"end": 6, "output_step": 0.01},
        "plant": plant,
        "measurement": measurement,
        "observers": {"observer": {"theta": theta, "initial": {"x1": 2, "x2": -2}, **block}},
    }


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("block", FAMILIES)
@settings(max_examples=4)
@given(seed=st.integers(0, 2**32 - 1), noisy=st.booleans())
def test_no_error_is_above_its_bound(block: dict[str, Any], seed: int, noisy: bool) -> None:
    rng = np.random.default_rng(seed)
    theta = float(rng.uniform(4, 8))
    analysis = analyze(Experiment(config(rng, block, theta, noisy=noisy)), ASKED)
    found, transient = analysis.observers["observer"], analysis.transients.get("observer")
    assert transient is not None
    assert transient.holds, found.reasons
    assert np.all(transient.error <= transient.bound)
    assert np.all(transient.bound[-1] < transient.bound[0])
    if not noisy:
        assert np.all(transient.bound[-1] < 0.05 * transient.bound[0])
    assert said(found)["eta_theta"] == pytest.approx(theta / 4)


def test_the_reduced_matrices_are_those_of_the_full_equation() -> None:
    rng = np.random.default_rng(3)
    both = []
    for gain in ("full", "reduced"):
        block = {"type": "fhgo2_nuos", "r": 2, "gain": gain}
        result = simulate(Experiment(config(rng, block, 5, noisy=False)))
        both.append(time_varying.gramian(result.observers["observer"]))
        rng = np.random.default_rng(3)
    assert both[0].chi == pytest.approx(both[1].chi, rel=1e-4)
    assert np.allclose(both[0].first, both[1].first, atol=1e-9)


def test_the_gramian_of_a_chain_settles_where_it_is_known() -> None:
    made = {
        "time": {"end": 40, "output_step": 0.1},
        "plant": {"type": "integrator_chain", "n": 2, "initial": {"x1": 0, "x2": 0}},
        "observers": {"observer": {"type": "shgo_riccati", "theta": 2}},
    }
    result = simulate(Experiment(made))
    P = result.observers["observer"].internal["P"][-1]
    assert np.allclose(np.linalg.inv(P), stationary(2), rtol=1e-6)


def test_bounds_in_numbers() -> None:
    S = Gramian(0.25, 4.0, np.eye(2))
    L = Lipschitz(np.diag([1.0, 3.0]), np.zeros((2, 2)), "interval over box", "", {}, np.arange(2))
    assert time_varying.smallest_theta(S, L) == pytest.approx(4 * 4 * 3)
    theta = 50.0
    # sqrt(chi) = 4 and F_1 = 1: the print is the stricter one
    printed = 1 / (16 * (3 + theta))
    assert time_varying.delayed(S, True, 1.0, L, theta).longest == pytest.approx(min(printed, 0.25 / (4 * (theta + 3))))
    # with long links it is not
    proved = 0.25 / (4 * (10 * theta + 3))
    assert time_varying.delayed(S, True, 10.0, L, theta).longest == pytest.approx(proved)


def test_the_period_of_fhgo1() -> None:
    """(2.82) put right: falls like 1/theta with L theta fixed, falls with delta and with L."""
    S = Gramian(0.4, 2.5, np.eye(2))

    def tau(theta: float, delta: float, slope: float) -> float:
        L = Lipschitz(np.diag([0.0, slope]), np.zeros((2, 2)), "interval over box", "", {}, np.arange(2))
        return time_varying.filter_theorem(S, 2, delta, (1.0, 1.0), L, theta).tau

    assert tau(100, 1e4, 1) > 0
    assert tau(200, 1e4, 2) == pytest.approx(tau(100, 1e4, 1) / 2, rel=0.05)
    assert tau(100, 1e6, 1) < 0.1 * tau(100, 1e4, 1)
    assert tau(100, 1e4, 10) < tau(100, 1e4, 1)
    assert tau(100, 1.0, 1) == 0  # too narrow a filter
    assert tau(1, 1e4, 1) == 0  # too small a theta


def test_fhgo1_says_what_its_theorem_lacks() -> None:
    made = config(np.random.default_rng(0), {"type": "fhgo1", "delta": 3}, 5, noisy=False)
    found = analyze(Experiment(made), ASKED).observers["observer"]
    assert said(found)["tau_bound"] is None
    assert "larger theta or delta" in found.reasons["tau_bound"]
    made["observers"]["observer"]["delta"] = 1e5
    made["solver"] = {"method": "rk4", "step": 2e-6}
    made["time"] = {"end": 0.5, "output_step": 0.01}
    made["observers"]["observer"]["theta"] = 1000
    values = said(analyze(Experiment(made), ASKED).observers["observer"])
    assert values["tau_bound"] is not None
    assert 0 < values["tau_bound"] < 1e-5
