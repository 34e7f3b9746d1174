"""Where the theory of convergence says nothing, or less than it would: each case with its reason."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment, inline

from hgorun.analysis.convergence.charts import chart_of
from hgorun.analysis.convergence.gains import error_dynamics
from hgorun.analysis.convergence.lyapunov import Lyapunov
from hgorun.analysis.convergence.segments import _divided
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.report import Findings, analyze
from hgorun.observers.base import OBSERVERS, Flow
from hgorun.observers.shgo import StandardObserver
from hgorun.symbolic.canonical import PlantCopy
from hgorun.symbolic.symbols import Symbols

SHGO: Block = {"type": "shgo", "theta": 5}
LINEAR = chain(2, "-x1 - x2")


def found(plant: Block, block: Block, **more: Any) -> Findings:
    return analyze(experiment(plant, {"o": block}, **({"output_step": 0.01, "end": 2.0} | more))).observers["o"]


def test_an_observer_of_another_kind_has_no_lipschitz_constant() -> None:
    made = experiment(LINEAR, {"o": {"type": "levant", "G": 5}})
    with pytest.raises(NoValue, match="does not apply to this observer"):
        chart_of(made.forms["o"], made.plant)
    with pytest.raises(NoValue, match="the error of levant is not that of chains of integrators with a constant gain"):
        error_dynamics(made.observers["o"], made.forms["o"])


def test_outputs_that_measure_the_same_have_too_many_coordinates() -> None:
    plant = inline({"x1": "x2", "x2": "-x1"}, ["x1", "x2"])
    of = found(plant, SHGO | {"chains": {"x1": 2, "x2": 1}})
    assert "z has more components than x" in of.reasons["lipschitz"]


@pytest.mark.costly
def test_slopes_without_a_bound_are_those_along_the_trajectories() -> None:
    """x1' = x2^3: dz/dx is singular where x2 passes zero, which steps of 1e-3 jump over."""
    plant = inline({"x1": "x2**3 + 1", "x2": "-1 - x2"}, "x1", start=0.5)
    of = found(plant, SHGO | {"initial": {"x1": 0.4, "x2": 0.4}}, end=1.0, step=1e-3)
    assert of.values["lipschitz_kind"] == "trajectory"
    assert "known along the trajectories only" in of.reasons["peaking_bound"]


def test_a_chain_that_another_one_pushes_from_further_down() -> None:
    plant = inline({"x1": "-x1 + sin(x4)", "x2": "x3", "x3": "x4", "x4": "-x2 - x3 - x4"}, ["x1", "x2"])
    of = found(plant, SHGO | {"chains": {"x1": 1, "x2": 3}})
    assert "phi is not triangular" in of.reasons["peaking_bound"]


def test_a_plant_in_steps_is_not_the_theorems() -> None:
    measurement = {"sampling": {"period": 0.01}}
    of = found(LINEAR | {"discretise": "euler"}, SHGO | {"theta": 50}, step=0.01, measurement=measurement)
    assert "the plant is a difference equation" in of.reasons["peaking_bound"]


def test_steps_that_are_too_long_for_the_observer() -> None:
    of = found(LINEAR, SHGO | {"theta": 50}, step=0.03)
    assert "steps of 0.03 are too long for the observer's error" in of.reasons["peaking_bound"]


@pytest.mark.costly
def test_draws_without_a_bound_are_said() -> None:
    noise = [{"type": "gaussian", "std": 0.1, "hold": 0.1}]
    of = found(LINEAR, SHGO | {"theta": 50}, measurement={"noise": noise})
    assert "Gaussian noise has no bound: delta_v is the largest draw of this run" in of.remarks


def test_a_matrix_too_near_to_the_imaginary_axis_for_double_precision() -> None:
    """P_22 is (1 + 1e16)/2 times 1e16/2: its rounding is more than all of the right-hand side."""
    with pytest.raises(NoValue, match="no solution in double precision"):
        _ = Lyapunov(np.array([[-1e-8, 1.0], [0.0, -1e-8]]), np.array([-1e-8, -1e-8])).P


class OddPower(StandardObserver):
    """A gain in which theta stands with a power that no scaling has."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow({"xhat": flow.derivatives["xhat"] - ca.sqrt(k.theta) * plant.lift(s.xhat, plant.along_chains(e))})


def test_a_gain_that_no_powers_of_theta_scale() -> None:
    with OBSERVERS.replaced("odd", OddPower):
        made = experiment(chain(2, start=0.0), {"o": {"type": "odd", "theta": 3}})
        with pytest.raises(NoValue, match="no scaling with powers of theta"):
            error_dynamics(made.observers["o"], made.forms["o"])


def box(low: list[list[float]], high: list[list[float]]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([low]), np.array([high])


def test_the_quotient_of_matrices_in_boxes() -> None:
    rng = np.random.default_rng(1)
    A, B = rng.normal(size=(2, 2, 2)) + 3 * np.eye(2)
    point = _divided((A[None], A[None]), (B[None], B[None]))
    np.testing.assert_allclose(point, np.abs(A @ np.linalg.inv(B)), rtol=1e-8)
    spread = 0.01
    wide = _divided(((A - spread)[None], (A + spread)[None]), ((B - spread)[None], (B + spread)[None]))
    for _ in range(200):
        a, b = (M + rng.uniform(-spread, spread, (2, 2)) for M in (A, B))
        assert np.all(np.abs(a @ np.linalg.inv(b)) <= wide)


@pytest.mark.parametrize(
    ("A", "B"),
    [
        (box([[1, 0], [0, np.inf]], [[1, 0], [0, np.inf]]), box([[1, 0], [0, 1]], [[1, 0], [0, 1]])),
        (box([[1, 0], [0, 1]], [[1, 0], [0, 1]]), box([[1, 1], [1, 1]], [[1, 1], [1, 1]])),
        (box([[1, 0], [0, 1]], [[1, 0], [0, 1]]), box([[-1, 0], [0, 1]], [[1.5, 0], [0, 1]])),
    ],
    ids=["infinite", "singular", "singular inside"],
)
def test_a_quotient_without_a_bound(A: tuple[np.ndarray, np.ndarray], B: tuple[np.ndarray, np.ndarray]) -> None:
    assert np.all(np.isinf(_divided(A, B)))
