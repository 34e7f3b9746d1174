"""The proofs' bounds against closed forms, and against the exact limits that they are far from."""

from typing import Any

import numpy as np
import pytest
from examples import chain, experiment, said
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from hgorun import Experiment
from hgorun.analysis.convergence import bounds
from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.gains import ErrorDynamics, error_dynamics
from hgorun.analysis.convergence.lipschitz import Lipschitz
from hgorun.analysis.report import analyze

BETA, CHI = 1 / (2 * (2 + np.sqrt(2))), 3 + 2 * np.sqrt(2)  # n = 2, poles -1


def dynamics(n: int, r: int) -> ErrorDynamics:
    made = experiment(chain(n, start=0), {"observer": {"type": "fhgo2", "theta": 1, "r": r}})
    return error_dynamics(made.observers["observer"], made.forms["observer"])


def slopes(M: Any) -> Lipschitz:
    M = np.asarray(M, dtype=float)
    return Lipschitz(M, M, "interval over box", "", {}, np.arange(len(M)))


def second_order(phi: str, theta: float = 100, **measurement: Any) -> Experiment:
    observer = {"type": "shgo", "theta": theta}
    plant = chain(2, phi, [1, 0.5])
    return experiment(plant, {"observer": observer}, end=0.1, output_step=0.01, measurement=measurement)


def exact_limit(dynamics: ErrorDynamics) -> float:
    """The smallest theta d with a pole on the imaginary axis: z' = A z + B f (integral of z over the last d).

    1 = G(jw) (1 - exp(-jwd))/(jw), G = f (sI - A)^-1 B: exp(-jwd) = 1 - jw/G(jw).
    """

    def turned(w: float) -> complex:
        G = dynamics.flux @ np.linalg.solve(1j * w * np.eye(len(dynamics.A)) - dynamics.A, dynamics.B)
        return complex(1 - 1j * w / G[0, 0])

    grid = np.linspace(1e-2, 20, 4000)
    sizes = np.array([abs(turned(w)) - 1 for w in grid])
    crossings = [
        brentq(lambda w: abs(turned(w)) - 1, grid[i], grid[i + 1]) for i in np.flatnonzero(sizes[1:] * sizes[:-1] < 0)
    ]
    return float(min((-np.angle(turned(w)) % (2 * np.pi)) / w for w in crossings))


@pytest.mark.parametrize(("r", "exact", "bound"), [
    (0, 0.927, 2.612e-3), (1, 1.103, 2.545e-4), (2, 1.255, 2.174e-5), (3, 1.400, 1.733e-6),
])  # fmt: skip
def test_sufficient_and_exact_delays_of_a_chain(r: int, exact: float, bound: float) -> None:
    """n = 3, phi = 0: (3.68) is 350 to 800,000 times too strict."""
    found = dynamics(3, r)
    none = slopes(np.zeros((3, 3)))
    for theta in (1.0, 5.0):
        limit = bounds.delayed(found, none, theta).longest
        assert limit * theta == pytest.approx(bound, rel=1e-3)
        sharp = bounds.delayed_sharply(found, none, theta).longest
        assert limit < sharp < exact / theta
    assert exact_limit(found) == pytest.approx(exact, abs=5e-4)


@pytest.mark.costly
def test_theta_bound_by_hand() -> None:
    """phi_2 = L sin x_2: c_1 = L; phi_2 = L x_1: c_1 = L/theta, so that theta^2 = L/beta."""
    found = said(analyze(second_order("3*sin(x2)")).observers["observer"])
    assert found["lipschitz"] == pytest.approx(3, rel=0.02)
    assert found["theta_bound"] == pytest.approx(found["lipschitz"] / BETA, rel=1e-9)
    assert found["theta_bound_printed"] == pytest.approx(2 * found["lipschitz"] / BETA, rel=1e-9)
    found = said(analyze(second_order("-3*x1")).observers["observer"])
    assert found["lipschitz"] == 3
    assert found["theta_bound"] == pytest.approx(np.sqrt(3 / BETA), rel=1e-9)
    found = said(analyze(second_order("0")).observers["observer"])
    assert (found["lipschitz"], found["theta_bound"]) == (0, 1)


@pytest.mark.costly
def test_delay_bound_and_rate_by_hand() -> None:
    d = 1e-5
    found = analyze(second_order("-3*x1", sampling={"period": 4e-6}, delay=6e-6)).observers["observer"]
    values, theta, L = said(found), 100, 3
    assert (values["beta"], values["chi"]) == pytest.approx((BETA, CHI), rel=1e-12)
    assert values["delay_max"] == pytest.approx(d, rel=1e-9)
    assert values["delay_bound"] == pytest.approx(BETA / (CHI * (L + theta)), rel=1e-12)
    a, b = BETA * theta, CHI * theta * (L + theta)
    assert values["eta_theta"] == pytest.approx((a - b * d) * np.exp(-a * d), rel=1e-9)


def test_a_standard_observer_with_a_large_gain_needs_more_than_chi() -> None:
    """|G|^2 > chi: sqrt(chi) |G| stands in its place."""
    found = experiment(chain(2), {"observer": {"type": "shgo", "theta": 1, "poles": [-3, -4]}})
    made = error_dynamics(found.observers["observer"], found.forms["observer"])
    chi, G = made.lyapunov.chi, np.hypot(7, 12)
    assert chi < G**2
    limit = bounds.delayed(made, slopes(np.zeros((2, 2))), 1.0).longest
    assert limit == pytest.approx(made.lyapunov.beta / (np.sqrt(chi) * G), rel=1e-9)


def test_the_euclidean_constant_of_chapter_2_is_too_small() -> None:
    """phi = L (x_1, x_1 + x_2): c_1 is the golden ratio times L, more than sqrt(2) L."""
    assert slopes([[1, 0], [1, 1]]).constant(1.0) == pytest.approx((1 + np.sqrt(5)) / 2)
    assert slopes([[1, 0], [1, 1]]).constant(1e6) == pytest.approx(1, rel=1e-6)


@given(st.floats(0.1, 100), st.floats(0.01, 10), st.floats(0.001, 0.999))
def test_the_lemma_holds_without_its_first_factor(a: float, d: float, part: float) -> None:
    """v = exp(-eta t) is an upper solution: -eta >= -a + b (exp(eta d) - 1)/eta; and p/eta >= p/(a - b d)."""
    lemma = Halanay(a, part * a / d)
    eta = lemma.rate(d)
    assert lemma.longest == pytest.approx(d / part)
    assert 0 <= eta <= a - lemma.b * d
    if eta * d > 1e-12:
        assert -eta >= (-a + lemma.b * np.expm1(eta * d) / eta) - 1e-9 * a


def test_a_bound_that_no_theta_meets() -> None:
    assert bounds.smallest_theta(0.1, lambda theta: theta) == np.inf
    assert bounds.smallest_theta(0.1, lambda theta: float(theta < 3)) == pytest.approx(3.0, rel=1e-11)
    assert bounds.smallest_theta(0.5, lambda theta: 0.1) == 1.0


@pytest.mark.parametrize(("beta", "size"), [(0.3, 2.0), (1e-4, 50.0), (0.02, 1e6)])
def test_the_smallest_theta_is_found_in_few_steps(beta: float, size: float) -> None:
    """beta theta = sqrt(size^2 + theta^(-2)): a square root, which bisection alone takes more than forty steps to."""
    tried = []

    def constant(theta: float) -> float:
        tried.append(theta)
        return float(np.hypot(size, 1 / theta))

    square = (size**2 + np.sqrt(size**4 + 4 * beta**2)) / (2 * beta**2)
    assert bounds.smallest_theta(beta, constant) == pytest.approx(np.sqrt(square), rel=3e-12)
    assert len(tried) < 20
