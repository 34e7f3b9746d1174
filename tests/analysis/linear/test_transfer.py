"""Norms and covariances of linear systems, against sums and closed forms of a line."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.analysis.linear.linear import Linear
from hgorun.analysis.linear.transfer import discrete_covariance, h2, hinf, relevant_states, require_hurwitz
from hgorun.analysis.reasons import NoValue


def loop(A: np.ndarray, B: np.ndarray, L: np.ndarray) -> Linear:
    """xi' = A xi + B v, xhat = L xi, written with the innovation e = -v."""
    q = B.shape[1]
    return Linear(A, -B, np.zeros((q, len(A))), L, np.zeros((q, len(A))), np.zeros((q, q)))


@pytest.mark.parametrize("size", [1e-6, 0.5, 0.999])
def test_a_covariance_is_the_sum_of_all_steps(size: float) -> None:
    rng = np.random.default_rng(3)
    F, G = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    F *= size / np.max(np.abs(np.linalg.eigvals(F)))
    P = discrete_covariance(F, G @ G.T)
    np.testing.assert_allclose(P, F @ P @ F.T + G @ G.T, rtol=1e-10)
    total, power = np.zeros((3, 3)), np.eye(3)
    for _ in range(30_000 if size > 0.9 else 100):
        total += power @ G @ G.T @ power.T
        power = F @ power
    np.testing.assert_allclose(P, total, rtol=1e-9)


def test_a_covariance_that_grows_for_ever_ends_the_sum() -> None:
    """Marginal: 2^60 steps, each of which adds Q."""
    np.testing.assert_allclose(discrete_covariance(np.eye(1), np.eye(1)), 2.0**60)


def test_a_resonance_is_found_where_it_is() -> None:
    """1/(s^2 + 2 z s + 1): 1/(2 z sqrt(1 - z^2)) at sqrt(1 - 2 z^2); H2 squared 1/(4 z)."""
    z = 0.01
    system = loop(np.array([[0.0, 1.0], [-1.0, -2 * z]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]))
    norm, where = hinf(system)
    np.testing.assert_allclose(norm, 1 / (2 * z * np.sqrt(1 - z**2)), rtol=1e-12)
    np.testing.assert_allclose(where, np.sqrt(1 - 2 * z**2), rtol=1e-6)
    np.testing.assert_allclose(h2(system), np.sqrt(1 / (4 * z)), rtol=1e-9)


def test_what_noise_does_not_reach_has_the_norm_zero() -> None:
    system = loop(np.array([[-1.0, 0.0], [0.0, -2.0]]), np.array([[1.0], [0.0]]), np.array([[0.0, 1.0]]))
    assert relevant_states(system).size == 0
    norm, where = hinf(system)
    assert norm.tolist() == where.tolist() == [[0.0]]
    assert h2(system).tolist() == [0.0]


@pytest.mark.parametrize(
    ("pole", "words"), [(0.0, "not Hurwitz"), (0.1, "an eigenvalue at 0.1"), (np.nan, "no derivative")]
)
def test_what_has_no_steady_state(pole: float, words: str) -> None:
    with pytest.raises(NoValue, match=words):
        require_hurwitz(loop(np.array([[pole]]), np.eye(1), np.eye(1)))
