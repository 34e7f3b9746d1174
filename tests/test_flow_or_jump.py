"""The table of docs/qube.md on what a correction that flows costs, by Lyapunov's and Riccati's equations alone.

A double integrator, x'' white noise of density 1, samples of variance r at every T = 1. Of an innovation e at a sample
the standard observer has exp(-a t) e left after the time t, a = theta g_1, and b = theta^2 g_2.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize_scalar

PAGE = (Path(__file__).parents[1] / "docs" / "qube.md").read_text(encoding="utf-8")
BETWEEN = (0.2, 0.4, 0.6, 0.8)
POLES = {
    "-1, -1": (-1, -1),
    "Butterworth": (-np.sqrt(0.5) * (1 + 1j), -np.sqrt(0.5) * (1 - 1j)),
    "-0.65, -1.55": (-0.65, -1.55),
    "-0.4, -2.5": (-0.4, -2.5),
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


@pytest.mark.parametrize("poles", POLES)
def test_the_table(poles: str) -> None:
    _, g_1, g_2 = np.real(np.poly(POLES[poles]))
    cells = [float(cell) for cell in re.findall(rf"^\| {poles} \|(.*)\|$", PAGE, re.MULTILINE)[0].split("|")]
    for place, r in enumerate((0.03, 0.3, 3)):

        def angle(log_theta: float, r: float = r) -> float:
            theta = np.exp(log_theta)
            return float(of_flow(theta * g_1, theta**2 * g_2, r)[0])

        start = min(np.arange(-1, 3, 0.1), key=angle)
        theta = np.exp(minimize_scalar(angle, bounds=(start - 0.1, start + 0.1), method="bounded").x)
        ratios = np.sqrt(of_flow(theta * g_1, theta**2 * g_2, r) / of_filter(r))
        np.testing.assert_allclose(ratios, cells[place::3], rtol=0, atol=0.006)
