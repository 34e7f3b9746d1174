"""Conditions (6) and (9), and the bounds on mu of the observers with direct reconstruction."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, chain, experiment

from hgorun import Experiment
from hgorun.analysis.papers.lmi import certificate, feasible_exactly, infeasible_exactly
from hgorun.analysis.papers.meiners import Theorem1, Theorem2, meiners_conditions, slope_bound
from hgorun.analysis.reasons import NoValue
from hgorun.simulation.simulate import prepare, simulate_prepared

PRINTED = (1.17, 2.3, 0.15)


def reactor(observer: dict[str, Any], end: float = 1.0) -> Experiment:
    plant = {"type": "bioreactor_gauthier", "inputs": {"u": 0.08}, "initial": {"eta1": 0.05, "eta2": 0.05}}
    observer = {**observer, "initial": {"eta1": 0.05, "eta2": 0.01}}
    solver = {"method": "euler", "step": 1e-3}
    return experiment(plant, {"o": observer}, end=end, output_step=end / 1000, solver=solver)


DYNAMIC = {"type": "dynamic_gain", "l": [2, 1], "a": 1.17, "b": 2.3, "q": 0.15, "gamma": "4*y"}


def conditions(config: Experiment) -> Any:
    run = prepare(config)
    return meiners_conditions(run, "o", simulate_prepared(run))


def determinants(M: list[list[Fraction]]) -> tuple[Fraction, Fraction]:
    """A symmetric 2 x 2 matrix is positive definite where both are positive."""
    return M[0][0], M[0][0] * M[1][1] - M[0][1] * M[1][0]


@pytest.mark.parametrize(("a", "b"), [("1.17", "2.42"), ("1.06", "2.3")])
def test_the_constants_that_do_fulfil_9(a: str, b: str) -> None:
    """Exactly, by determinants of 2 x 2 matrices written out by hand, for Q rounded to six decimals."""
    found = certificate((2, 1), float(a), float(b), 0.15)
    assert found.feasible
    assert found.exact
    assert found.Q is not None
    x, y, z = (Fraction(f"{v:.6f}") for v in (found.Q[0, 0], found.Q[0, 1], found.Q[1, 1]))
    A, B, q = Fraction(a), Fraction(b), Fraction("0.15")
    # Q (A - l c), A - l c = [[-2, 1], [-1, 0]]
    decay = [[4 * x + 2 * y - A * x, -x + 2 * y + z - A * y], [-x + 2 * y + z - A * y, -2 * y - A * z]]
    for M in (
        decay,
        [[x - q, y], [y, z - q]],
        [[1 - x, -y], [-y, 1 - z]],
        [[B * x, (B - 1) * y], [(B - 1) * y, (B - 2) * z]],
        [[B * x, (B + 1) * y], [(B + 1) * y, (B + 2) * z]],
    ):
        assert min(determinants(M)) > 0


@pytest.mark.parametrize("b", ["2.3", "2.4"])
def test_that_the_printed_constants_do_not(b: str) -> None:
    """Exactly: Z_i > 0, made rational, with sum <Z_i, M_i(Q)> = tr Z_3 - q tr Z_2 < 0 for every Q."""
    found = certificate((2, 1), 1.17, float(b), 0.15)
    assert found.feasible is False
    assert found.exact
    assert found.Z is not None
    assert found.margin < -1e-3
    shift = Fraction(1, 10**7)
    Z = []
    for block in found.Z:
        x, y, z = (Fraction(f"{v:.12f}") for v in (block[0, 0], block[0, 1], block[1, 1]))
        Z.append([[x + shift, y], [y, z + shift]])
    A, B, q = Fraction("1.17"), Fraction(b), Fraction("0.15")

    def condition(Q: list[list[int]]) -> list[list[list[Fraction]]]:
        (x, y), (_, z) = Q
        off = -x + 2 * y + z - A * y
        F = Fraction
        return [
            [[4 * x + 2 * y - A * x, off], [off, -2 * y - A * z]],
            [[F(x), F(y)], [F(y), F(z)]],
            [[F(-x), F(-y)], [F(-y), F(-z)]],
            [[B * x, (B - 1) * y], [(B - 1) * y, (B - 2) * z]],
            [[B * x, (B + 1) * y], [(B + 1) * y, (B + 2) * z]],
        ]

    def paired(Q: list[list[int]]) -> Fraction:
        return sum(
            (Z[k][i][j] * condition(Q)[k][i][j] for k in range(5) for i in range(2) for j in range(2)), Fraction(0)
        )

    # what is left of the sum for Q = e_1 e_1^T, e_2 e_2^T, and off the diagonal goes into Z_3
    Z[2][0][0] += paired([[1, 0], [0, 0]])
    Z[2][1][1] += paired([[0, 0], [0, 1]])
    off = paired([[0, 1], [1, 0]]) / 2
    Z[2][0][1] += off
    Z[2][1][0] += off
    assert paired([[1, 0], [0, 0]]) == paired([[0, 1], [1, 0]]) == paired([[0, 0], [0, 1]]) == 0
    assert all(min(determinants(block)) > 0 for block in Z)
    assert Z[2][0][0] + Z[2][1][1] - q * (Z[1][0][0] + Z[1][1][1]) < 0


def test_the_checks_in_rational_arithmetic_say_no() -> None:
    """To a Q of other constants, and to a Z that proves nothing."""
    good, bad = certificate((2, 1), 1.17, 2.42, 0.15), certificate((2, 1), *PRINTED)
    assert good.Q is not None
    assert bad.Z is not None
    assert not feasible_exactly(good.Q, (2, 1), *PRINTED)
    assert not infeasible_exactly(bad.Z, (2, 1), 1.17, 2.42, 0.15)
    assert not infeasible_exactly([np.eye(2)] * 5, (2, 1), *PRINTED)
    # at a given b the largest a is where the margin changes its sign
    low, high = 1.06, 1.17
    while high - low > 1e-4:
        a = 0.5 * (low + high)
        low, high = (a, high) if certificate((2, 1), a, 2.3, 0.15).feasible else (low, a)
    assert 1.06 < low < 1.10


def test_gamma_of_the_paper_at_the_equilibrium() -> None:
    """|d f_2/d x_2| of (22) is 7.5 times 4 y there."""
    run = prepare(reactor(DYNAMIC, 300))
    found = slope_bound(run, "o", simulate_prepared(run))
    u = 0.08
    eta_2 = 0.1 * u / 3
    x_1 = 0.1 - eta_2
    x_2 = u * x_1
    slope = 2 * (0.1 * u / (3 * x_1**2) + 2 / x_1) * x_2 - (3 + u + 0.2 * u / x_1)
    assert found.at_end == pytest.approx(abs(slope) / (4 * x_1), rel=1e-3)
    assert found.at_end == pytest.approx(7.5, abs=0.02)
    assert not found.holds
    assert found.what == "d g_2 / d x_2"
    assert found.ratio >= found.at_end
    assert found.box_ratio >= found.ratio
    assert found.excess == pytest.approx(found.slope - found.gamma, rel=0.05)


@pytest.mark.parametrize(("factor", "holds"), [(1.01, True), (0.99, False)])
def test_gamma_of_a_plant_in_closed_form(factor: float, holds: bool) -> None:
    """Van der Pol: d g_2/d x_2 = (1 - y^2)/2."""
    observer = {**DYNAMIC, "gamma": f"{factor}*abs(1 - y**2)/2 + 1e-9"}
    run = prepare(experiment(VAN_DER_POL, {"o": observer}, end=15, output_step=0.01))
    found = slope_bound(run, "o", simulate_prepared(run))
    assert found.holds is holds
    assert found.ratio == pytest.approx(1 / factor, rel=1e-3)


def test_theorem_2_of_the_paper() -> None:
    observer = {**DYNAMIC, "type": "direct_dynamic", "mu_0": 500, "phi": 4000, "G": 1, "internal": {"z": [0.05, 0]}}
    found = conditions(reactor(observer))
    assert isinstance(found, Theorem2)
    assert found.inequality.feasible is False
    assert found.k is None
    assert found.mu_0_proof is None
    assert found.phi_above_a
    repaired = conditions(reactor({**observer, "b": 2.42}))
    Q = repaired.inequality.Q
    assert repaired.k == pytest.approx(1.17 * np.linalg.eigvalsh(Q)[0])
    assert 0 < repaired.mu_0_proof < repaired.mu_0_exact
    # with W = I the condition at theta = 1: (1 - exp(-mu_0 tau^2))^2 c < k tau^2
    Gamma = np.array([[2000.0, 1], [0, 2000]])
    c = np.trace(Q @ Gamma @ Gamma.T)
    tau = np.geomspace(1e-3, 1e5, 200_001)
    for mu, holds in ((0.999 * repaired.mu_0_exact, True), (1.01 * repaired.mu_0_exact, False)):
        assert bool(np.all((1 - np.exp(-mu * tau**2)) ** 2 * c < repaired.k * tau**2)) is holds


def test_theorem_1_on_a_chain() -> None:
    """f_1 = x_2, f_2 = 0: L = 0, every slope is 1, so that k = theta."""
    theta, phi = 3.0, 4.0
    observer = {"type": "direct", "theta": theta, "l": [2, 1], "mu": 0.1, "phi": phi, "G": 1}
    solver = {"method": "euler", "step": 1e-4}
    found = conditions(experiment(chain(2, start=0), {"o": observer}, end=0.1, output_step=0.001, solver=solver))
    assert isinstance(found, Theorem1)
    closed = np.array([[-2.0, 1], [-1, 0]])
    S = np.linalg.solve(np.kron(np.eye(2), closed.T) + np.kron(closed.T, np.eye(2)), -np.eye(2).ravel()).reshape(2, 2)
    np.testing.assert_allclose(found.S, S, atol=1e-12)
    assert found.decay == pytest.approx(1)
    assert (found.L, found.L_h) == (0, 1)
    assert found.k == pytest.approx(theta)
    Theta = np.diag([theta, theta**2])
    Gamma = Theta @ np.outer([2, 1], [1, 0]) + phi / 2 * np.eye(2)
    c = np.trace(S @ np.linalg.inv(Theta) @ Gamma @ Gamma.T @ np.linalg.inv(Theta))
    assert found.mu_proof == pytest.approx(2 * theta / (theta**2 * c))
    # for W = I: (1 - exp(-mu theta^2 tau^2))^2 c < k tau^2 for every tau up to the exact bound, and not beyond
    tau = np.geomspace(1e-3, 1e3, 200_001)
    assert found.mu_exact is not None
    for mu, holds in ((0.999 * found.mu_exact, True), (1.01 * found.mu_exact, False)):
        assert bool(np.all((1 - np.exp(-mu * theta**2 * tau**2)) ** 2 * c < found.k * tau**2)) is holds


def test_theorem_1_of_the_paper_does_not_apply_to_its_example() -> None:
    """L is about 3 sqrt(2), theta = 1: k is negative, and nothing is promised for any mu."""
    observer = {"type": "direct", "theta": 1, "l": [1, 0.5], "mu": 50, "phi": 4000, "G": 1}
    found = conditions(reactor({**observer, "internal": {"z": [0.05, 0]}}))
    assert isinstance(found, Theorem1)
    assert found.L > 3
    assert found.k < 0
    assert found.mu_proof is None
    plain = conditions(reactor({"type": "direct", "theta": 1, "l": [1, 0.5]}))
    assert plain.mu == 0
    assert plain.k == pytest.approx(found.k, rel=1e-6)


def test_other_observers() -> None:
    with pytest.raises(NoValue, match="the theorems are for direct"):
        conditions(reactor({"type": "shgo", "theta": 1}))
