"""The adaptive observer, against trajectories computed elsewhere, its identity and the standard observer."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, simulated
from scipy.integrate import solve_ivp

import hgorun
from hgorun.analysis.finding import FINDINGS
from hgorun.errors import ConfigError
from hgorun.observers.adaptive import AdaptiveObserver
from hgorun.testing import check_observer

PLANT: Block = {
    "type": "van_der_pol",
    "parameters": {"mu": 0.5},
    "initial": {"x1": 1, "x2": 0},
    "disturbance": {"x2": "sin(2*t) - 0.5"},
}
ADAPTIVE: Block = {"type": "adaptive", "theta": 4, "Psi": {"x2": ["sin(2*t)", "1"]}}

# t: xhat_1, xhat_2, rho_1, rho_2; an independent simulator, RK4 with steps of 1e-3
TRAJECTORY = {
    0: (0, 0, 0, 0),
    0.1: (0.59597, 1.06131, 0.00002, 0.00038),
    0.2: (0.89664, 1.35991, 0.00014, 0.00145),
    0.5: (1.00151, 0.61316, -0.00601, -0.01590),
    1: (0.57215, -0.69880, -0.10697, -0.16684),
    2: (-0.52563, -1.46923, 0.14402, -0.27440),
    5: (-0.39300, 1.73965, 0.99522, -0.49949),
    10: (-2.12496, 0.68118, 1.00000, -0.50000),
}


def test_trajectory_computed_elsewhere() -> None:
    found = simulated(PLANT, {"A": ADAPTIVE}, end=10, step=1e-3).observers["A"]
    values = np.column_stack([found.xhat, found.internal["rho"]])
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(values[round(10 * t)], expected, atol=6e-6)


def psi(n: int, **rows: list[str]) -> Block:
    """Of a chain of n integrators, at its truth with the wrong parameters, away from which noise drives it."""
    return {"type": "adaptive", "theta": 3, "Psi": rows, "initial": dict.fromkeys(chain(n)["initial"], 0.5)}


@pytest.mark.parametrize(
    ("block", "measurement"),
    [
        (psi(2, x1=["sin(t)", "0"], x2=["1", "cos(2*t)"]), {}),
        (psi(3, x3=["sin(t)", "1"]), {"sampling": {"period": 0.1}}),
        ({**psi(2, x2=["sin(t)", "t/4"]), "poles": [-0.6, -1.5]}, {}),
    ],
)
def test_what_the_parameters_do_to_the_estimate_is_known_to_upsilon(block: Block, measurement: Block) -> None:
    """eta = Delta (xhat - x) - Upsilon (rho^ - rho) stays 0 where f and Psi do not depend on x."""
    n, rho = len(block["initial"]), np.array([0.7, -0.4])
    unknown = {x: f"{rho[0]}*({one}) + {rho[1]}*({two})" for x, (one, two) in block["Psi"].items()}
    plant = {**chain(n), "disturbance": unknown}
    result = simulated(plant, {"A": block}, end=6, step=1e-3, measurement=measurement)
    found = result.observers["A"]
    Delta = 3.0 ** -np.arange(n)
    explained = np.einsum("tij,tj->ti", found.internal["Upsilon"], found.internal["rho"] - rho)
    size = np.max(np.abs(explained))
    assert size > 1e-3
    if not measurement:  # a held innovation is not the error
        np.testing.assert_allclose(Delta * (found.xhat - result.x), explained, atol=1e-12 * max(size, 1))
    else:
        assert np.max(np.abs(found.internal["rho"][-1] - rho)) < 0.02


def test_with_P_at_zero_it_is_the_standard_observer_of_a_plant_with_other_parameters() -> None:
    """The plant is an oscillator, cos t; 0.8 sin t + 0.3 x2 is in the observer's model alone."""
    bare: Block = {"type": "integrator_chain", "n": 2, "phi": "-x1", "initial": {"x1": 1, "x2": 0}}
    fixed = {**psi(2, x2=["sin(t)", "x2"]), "internal": {"P": 0, "rho": [0.8, 0.3]}, "initial": {}}
    found = simulated(bare, {"A": fixed}, end=5, step=0.01).observers["A"]

    def rate(t: float, x: np.ndarray) -> list[float]:
        e = x[0] - np.cos(t)
        return [x[1] - 6 * e, -x[0] + 0.8 * np.sin(t) + 0.3 * x[1] - 9 * e]

    expected = solve_ivp(rate, (0, 5), [0, 0], rtol=1e-10, atol=1e-12, t_eval=[5]).y[:, 0]
    np.testing.assert_allclose(found.xhat[-1], expected, atol=1e-7)


def test_parameters_of_a_plant_that_is_no_chain() -> None:
    """Contois' kinetics, in its own coordinates and through J^-1: an unknown feed of substrate."""
    plant: Block = {
        "type": "contois",
        "inputs": {"D": "0.3 + 0.1*sin(t)"},
        "initial": {"x1": 1.5, "x2": 15},
        "disturbance": {"x2": "0.4"},
    }
    block: Block = {"type": "adaptive", "theta": 3, "Psi": {"x2": [1]}, "initial": {"x1": 1.4, "x2": 14}}
    both = {"A": block, "Z": {**block, "coordinates": "canonical"}}
    for found in simulated(plant, both, end=25).observers.values():
        assert found.internal["rho"][-1] == pytest.approx(0.4, abs=1e-3)


def test_two_outputs_share_their_parameters() -> None:
    plant = inline(
        {"a": "b", "b": "-a", "c": "-c"}, ["a", "c"], disturbance={"b": "0.6*sin(3*t)", "c": "0.6*cos(t) - 0.2*t"}
    )
    block: Block = {"type": "adaptive", "theta": 4, "Psi": {"b": ["sin(3*t)", 0], "c": ["cos(t)", "t"]}}
    found = simulated(plant, {"A": block}, end=15).observers["A"]
    np.testing.assert_allclose(found.internal["rho"][-1], [0.6, -0.2], atol=1e-6)


@pytest.mark.costly
def test_what_nothing_excites_does_not_grow_for_ever_and_can_be_learned_later() -> None:
    plant = {**chain(2), "disturbance": {"x2": "where(t > 12, 0.5, 0)"}}
    block = {**psi(2, x2=["where(t > 12, 1, 0)"]), "p_max": 1e4}
    result = simulated(plant, {"A": block}, end=25)
    found = result.observers["A"]
    P = found.internal["P"].ravel()
    assert 9e3 < P[110] < 1e4 + 1e-3
    assert found.internal["rho"][-1] == pytest.approx(0.5, abs=1e-6)
    assert P[-1] == pytest.approx(9**2, rel=1e-3)  # 1/Upsilon_1^2, Upsilon_1 = 1/theta^2


def test_analysis_says_how_well_parameters_were_excited() -> None:
    blocks = {"seen": psi(2, x2=["sin(2*t)", "1"]), "not": psi(2, x2=["1", "2"])}
    made = experiment(chain(2), blocks, end=30, output_step=0.01, metrics={"window": [30 - 10 * np.pi / 2, 30]})
    named = [one for one in FINDINGS.all().values() if one.name in ("parameter_excitation", "poles")]
    found = hgorun.analyze(made, named).observers
    # five periods of Upsilon_1 = Im(e^(2jt)/((3 + 2j)^2)) and 1/9, orthogonal over them
    expected = min(0.5 / 13**2, 1 / 81) * 5 * np.pi
    assert found["seen"].values["parameter_excitation"] == pytest.approx(expected, rel=2e-3)
    assert found["not"].values["parameter_excitation"] == pytest.approx(0, abs=1e-9)
    assert "declares no rest of it on chains" in found["seen"].reasons["poles"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"Psi": {"x3": ["1"]}}, "unknown state 'x3'"),
        ({"Psi": {"x1": ["1"], "x2": ["1", "t"]}}, "expected 1 expressions, one a parameter, as for x1; found 2"),
        ({"Psi": {"x2": ["z"]}}, "z"),
        ({"Psi": {}}, "Psi"),
        ({"p_max": 0.5}, "no less than the trace of P"),
        ({"internal": {"P": -1}}, "without negative eigenvalues"),
        ({"internal": {"P": [1, 2]}}, "expected a number or 1 numbers"),
        ({"poles": [-1, -2, -3]}, "expected 2 numbers"),
    ],
)
def test_what_does_not_fit_is_refused(change: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(chain(2), {"A": {**psi(2, x2=["1"]), **change}}))


def test_outputs_that_measure_the_same_are_refused() -> None:
    plant = inline({"a": "b", "b": "-a"}, ["a", "b"])
    block = {"type": "adaptive", "theta": 3, "Psi": {"b": [1]}, "chains": {"a": 2, "b": 1}}
    with pytest.raises(ConfigError, match="more chain components than there are states"):
        hgorun.simulate(experiment(plant, {"A": block}))


@pytest.mark.slow
def test_it_keeps_the_contract_with_two_parameters() -> None:
    """But for the decay on a plant that rests at 0, where nothing excites them."""
    check_observer(
        AdaptiveObserver, {"Psi": {"x2": ["x1", "sin(t)*y"]}}, plants=[chain(2, "-x1 - x2")], skip=["the error decays"]
    )
