"""The table of docs/qube.md on what a correction that flows costs, by Lyapunov's and Riccati's equations alone.

A double integrator, x'' white noise of density 1, samples of variance r at every T = 1. Of an innovation e at a sample
the standard observer has exp(-a t) e left after the time t, a = theta g_1, and b = theta^2 g_2. Those with filters are
linear systems of the errors, of what is left of e, and of the filters.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize_scalar

PAGE = (Path(__file__).parents[1] / "docs" / "qube.md").read_text(encoding="utf-8")
BETWEEN = (0.2, 0.4, 0.6, 0.8)
POLES = {
    "-1, -1": (-1, -1),
    "Butterworth": (-np.sqrt(0.5) * (1 + 1j), -np.sqrt(0.5) * (1 - 1j)),
    "-0.65, -1.55": (-0.65, -1.55),
    "-0.5, -2": (-0.5, -2),
    "-0.3, -3.3": (-0.3, -3.3),
}
FILTERED: dict[str, tuple[complex, ...] | float] = {  # poles of FHGO II, r = 1; delta of FHGO I
    "FHGO II, -1, -1, -1": (-1, -1, -1),
    "FHGO II, -0.35, -3 ± 3j": (-0.35, -3 + 3j, -3 - 3j),
    "FHGO II, -0.3, -4 ± 4j": (-0.3, -4 + 4j, -4 - 4j),
    "FHGO I, delta = 12": 12.0,
    "FHGO I, delta = 100": 100.0,
}
C = np.array([[1.0, 0.0]])


def moved(s: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition and covariance of the disturbance after the time s."""
    return np.array([[1, s], [0, 1.0]]), np.array([[s**3 / 3, s**2 / 2], [s**2 / 2, s]])


def mean_squares(covariances: list[np.ndarray]) -> np.ndarray:
    """Of angle and velocity between samples, and of the velocity at a sample, which comes last."""
    between = np.mean(covariances[:-1], axis=0)
    return np.array([between[0, 0], between[1, 1], covariances[-1][1, 1]])


def of_filter(r: float) -> np.ndarray:
    F, Q = moved(1)
    P = solve_discrete_are(F.T, C.T, Q, np.array([[r]]))
    after = P - P @ C.T @ C @ P / (P[0, 0] + r)
    return mean_squares([F @ after @ F.T + Q for F, Q in map(moved, BETWEEN)] + [after])


def of_flow(a: float, b: float, r: float) -> np.ndarray:
    def step(s: float) -> tuple[np.ndarray, np.ndarray]:
        F, Q = moved(s)
        gone = (1 - np.exp(-a * s)) / a
        M = np.array([[a * gone + b * (s - gone) / a], [b * gone]])
        return F - M @ C, Q + r * M @ M.T

    if np.max(np.abs(np.linalg.eigvals(step(1)[0]))) >= 1:
        return np.full(3, np.inf)
    P = solve_discrete_lyapunov(*step(1))
    return mean_squares([A @ P @ A.T + N for A, N in map(step, BETWEEN)] + [P])


def filtered(kind: tuple[complex, ...] | float, theta: float) -> np.ndarray:
    """The flow of x_1 and x_2 (estimated minus true), of e, and of eta: (3.65)-(3.66) with r = 1, (2.36)-(2.39)."""
    if isinstance(kind, tuple):  # eta' = theta (e - k_1 eta)
        _, k_1, k_2, k_3 = np.real(np.poly(kind))
        corrections, filters = [[-theta * k_2], [-(theta**2) * k_3]], [[-theta * k_1]]
    else:  # K = (2, 1), of the stationary P
        rate = kind * theta
        corrections, filters = [[-2 * theta, 0], [0, -theta]], [[-rate, 0], [rate * theta, -rate]]
    A = np.zeros((3 + len(filters), 3 + len(filters)))
    A[0, 1] = 1
    A[:2, 3:], A[2, 3:], A[3:, 3:] = corrections, corrections[0], filters
    A[3, 2] = theta * (1 if isinstance(kind, tuple) else kind)
    return A


def of_filtered(A: np.ndarray, r: float) -> np.ndarray:
    sample, noise, n = np.eye(len(A)), np.zeros_like(A), len(A)
    sample[2], noise[2, 2] = np.eye(n)[0], r  # e = x_1 and the noise

    def step(s: float) -> tuple[np.ndarray, np.ndarray]:
        return expm(A * s), np.pad(moved(s)[1], (0, n - 2))  # the disturbance reaches nothing else before the sample

    F, Q = step(1)
    if np.max(np.abs(np.linalg.eigvals(F @ sample))) >= 1:
        return np.full(3, np.inf)
    P = solve_discrete_lyapunov(F @ sample, F @ noise @ F.T + Q)
    after = sample @ P @ sample.T + noise
    return mean_squares([F @ after @ F.T + Q for F, Q in map(step, BETWEEN)] + [P])


def least(errors: Callable[[float, float], np.ndarray], r: float) -> np.ndarray:
    """Errors over those of the filter, with the theta that is best for the angle between samples, and this theta."""

    def angle(log_theta: float) -> float:
        return float(errors(np.exp(log_theta), r)[0])

    start = min(np.arange(-3, 3, 0.1).tolist(), key=angle)
    found = minimize_scalar(angle, bounds=(start - 0.1, start + 0.1), method="bounded")
    return np.append(np.sqrt(errors(np.exp(found.x), r) / of_filter(r)), np.exp(found.x))


def cells_of(row: str) -> list[float]:
    return [float(cell) for cell in re.findall(rf"^\| {re.escape(row)} \|(.*)\|$", PAGE, re.MULTILINE)[0].split("|")]


def of_poles(poles: str, r: float) -> np.ndarray:
    _, g_1, g_2 = np.real(np.poly(POLES[poles]))
    return least(lambda theta, r: of_flow(theta * g_1, theta**2 * g_2, r), r)


@pytest.mark.costly
@pytest.mark.parametrize("poles", POLES)
def test_the_table(poles: str) -> None:
    for place, r in enumerate((0.03, 0.3, 3)):
        ratios = of_poles(poles, r)
        np.testing.assert_allclose(ratios[:3], cells_of(poles)[place::3], rtol=0, atol=0.006)


@pytest.mark.costly
@pytest.mark.parametrize("kind", FILTERED)
def test_the_table_of_filters(kind: str) -> None:
    for place, r in enumerate((0.03, 0.3, 3)):
        ratios = least(lambda theta, r: of_filtered(filtered(FILTERED[kind], theta), r), r)
        np.testing.assert_allclose(ratios[:3], cells_of(kind)[place::3], rtol=0, atol=0.006)


@pytest.mark.costly
@pytest.mark.parametrize("r", [3, 30, 300, 3000])
def test_the_table_of_large_noise(r: int) -> None:
    """theta T of the poles apart, then angle and velocity of Butterworth poles and of those apart."""
    found = [of_poles(poles, r) for poles in ("Butterworth", "-0.65, -1.55")]
    told = cells_of(str(r))
    np.testing.assert_allclose(told[1:], np.array(found)[:, :2].T.ravel(), rtol=0, atol=0.006)
    assert told[0] == pytest.approx(found[1][-1], rel=0.03)
