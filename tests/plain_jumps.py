"""Observers that samples correct at once, for the loops of `plain_observers`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from plain_corrections import KalmanBucy
from plain_observers import Array, Blocks, Plain, slopes


def kappa(n: int, w: float) -> Array:
    """All eigenvalues of (I - kappa C) e^A at w, by Ackermann's formula for the pair (e^A, C e^A)."""
    A = np.diag(np.ones(n - 1), 1)
    E = np.sum([np.linalg.matrix_power(A, k) / math.factorial(k) for k in range(n)], axis=0)
    C = E[0]
    observed = np.array([C @ np.linalg.matrix_power(E, k) for k in range(n)])
    return np.linalg.matrix_power(E - w * np.eye(n), n) @ np.linalg.solve(observed, np.eye(n)[-1])


@dataclass
class Impulsive(Plain):
    """z+ = z - D_T kappa(e^(-theta T)) e in the chain of each output, of states or behind a map."""

    length: int = 2
    lift: Callable[[Array, Array, float], Array] | None = None  # xhat, what is subtracted in z, u -> xhat

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        v = np.zeros(z.size)
        for i, value in y.items():
            if (T := since[i]) > 0:
                e = z[self.measured[i]] - value
                own = self.measured[i] + np.arange(self.length)
                v[own] = kappa(self.length, math.exp(-self.theta * T)) / T ** np.arange(self.length) * e
        return z - v if self.lift is None else self.lift(z, v, u)


@dataclass
class ImpulsiveRiccati(Blocks):
    """P' = theta P + F P + P F^T; at samples K = P C^T (C P C^T + r)^-1, P+ = P - K C P, xhat+ = xhat - K e."""

    r: float = 1.0

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(xhat, np.eye(xhat.size))

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = math.isqrt(z.size)
        P, F = z[n:].reshape(n, n), self.F(t, z[:n], u)
        return np.append(self.f(t, z[:n], u), self.theta * P + F @ P + P @ F.T), np.zeros(len(self.measured))

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        n = math.isqrt(z.size)
        x, P, order = z[:n].copy(), z[n:].reshape(n, n), self.blocks(n)
        C = np.eye(n)[sorted(y)]
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + self.r * np.eye(len(y)))
        x[order] -= K @ (C @ x[order] - np.array([y[i] for i in sorted(y)]))
        return np.append(x, P - K @ C @ P)

    def xhat(self, z: Array, u: float) -> Array:
        return z[: math.isqrt(z.size)]


class ExtendedKalman(KalmanBucy):
    """Between samples P' = F P + P F^T + Q; at samples K = P H^T (H P H^T + R)^-1, P+ = P - K H P."""

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = self.n(z)
        P, F = z[n:].reshape(n, n), slopes(self.f, t, z[:n], u)
        return np.append(self.f(t, z[:n], u), F @ P + P @ F.T + self.Q), np.zeros(len(self.measured))

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        n, own = self.n(z), sorted(y)
        x, P = z[:n], z[n:].reshape(n, n)
        H = self.H(x)[own]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + self.R[np.ix_(own, own)])
        return np.append(x + K @ (np.array([y[i] for i in own]) - self.output(z)[own]), P - K @ H @ P)


@dataclass
class Unscented(KalmanBucy):
    """Means and covariances of f and h from 2 n + 1 points, drawn again from (xhat, P) whenever they are needed."""

    alpha: float = 1.0
    beta: float = 0.0
    spread: float = 0.0  # kappa

    def points(self, z: Array) -> tuple[Array, Array, Array, Array]:
        n = self.n(z)
        lam = self.alpha**2 * (n + self.spread) - n
        x, P = z[:n], z[n:].reshape(n, n)
        root = np.linalg.cholesky((n + lam) * (P + P.T) / 2).T
        mean = np.array([lam / (n + lam), *[1 / (2 * (n + lam))] * (2 * n)])
        spread = mean.copy()
        spread[0] += 1 - self.alpha**2 + self.beta
        return np.vstack([x, x + root, x - root]), mean, spread, P

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        X, mean, spread, _ = self.points(z)
        f = np.array([self.f(t, x, u) for x in X])
        dx = mean @ f
        M = (X - X[0]).T @ (spread[:, None] * (f - dx))
        return np.append(dx, M + M.T + self.Q), np.zeros(len(self.measured))

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        X, mean, spread, P = self.points(z)
        own = sorted(y)
        h = np.array([self.output(x) for x in X])[:, own]
        d = h - mean @ h
        S = d.T @ (spread[:, None] * d) + self.R[np.ix_(own, own)]
        K = (X - X[0]).T @ (spread[:, None] * d) @ np.linalg.inv(S)
        return np.append(X[0] + K @ (np.array([y[i] for i in own]) - mean @ h), P - K @ S @ K.T)
