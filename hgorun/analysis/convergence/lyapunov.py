"""The Lyapunov matrix P of the error's matrix at theta = 1, which shows its decay."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.analysis.reasons import NoValue

MU = 1.0  # of P A~ + A~^T P = -2 mu I


@dataclass(frozen=True)
class Lyapunov:
    """What P A~ + A~^T P = -2 mu I with mu = 1 says of a matrix A~.

    beta = mu/(2 lambda_max(P)) and chi = cond(P), (3.23) and (3.35) of Robles Magdaleno 2023. With
    V = zbar^T P zbar and |Phi~| <= c |zbar|

        V' <= -2 theta mu |zbar|^2 + 2 |P zbar| |Phi~| <= -2 (theta mu - c lambda_max(P)) |zbar|^2
        (sqrt V)' <= -(2 beta theta - c) sqrt V

    and |zbar(t)| <= sqrt(chi) exp(-(2 beta theta - c) t) |zbar(0)|. The thesis keeps half of the decay for Phi~:
    c <= beta theta leaves exp(-beta theta t). It has chi for sqrt(chi) from (3.44) on, which is true, too.
    """

    A: np.ndarray
    known: np.ndarray | None = None

    @cached_property
    def poles(self) -> np.ndarray:
        """Eigenvalues, by real part, then imaginary part."""
        values = np.linalg.eigvals(self.A) if self.known is None else self.known
        return np.asarray(values[np.lexsort((values.imag, values.real.round(9)))])

    @property
    def hurwitz(self) -> bool:
        return bool(np.max(self.poles.real) < 0)

    @cached_property
    def P(self) -> np.ndarray:
        """The solution, symmetric and positive definite.

        Raises
        ------
        NoValue
            When A~ is not Hurwitz, or too near to it for double precision.
        """
        from scipy.linalg import solve_continuous_lyapunov

        if not self.hurwitz:
            raise NoValue("the error's matrix is not Hurwitz: no P exists")
        right = -2 * MU * np.eye(len(self.A))
        P = solve_continuous_lyapunov(self.A.T, right)
        P = 0.5 * (P + P.T)
        for _ in range(2):  # refined: its condition number is high for long filters
            rest = right - (P @ self.A + self.A.T @ P)
            P = P + solve_continuous_lyapunov(self.A.T, 0.5 * (rest + rest.T))
            P = 0.5 * (P + P.T)
        off = np.max(np.abs(P @ self.A + self.A.T @ P - right))
        if not (np.all(np.isfinite(P)) and off < 1e-3 and np.min(np.linalg.eigvalsh(P)) > 0):
            raise NoValue("the Lyapunov equation of the error's matrix has no solution in double precision")
        return np.asarray(P)

    @cached_property
    def eigenvalues(self) -> tuple[float, float]:
        """(smallest, largest) of P."""
        values = np.linalg.eigvalsh(self.P)
        return float(values[0]), float(values[-1])

    @property
    def beta(self) -> float:
        return MU / (2 * self.eigenvalues[1])

    @property
    def chi(self) -> float:
        return self.eigenvalues[1] / self.eigenvalues[0]
