"""High-gain observers of chains and the Kalman-Bucy filter, for the loops of `plain_observers`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from plain_observers import Array, Plain, slopes

Law = Callable[[float, float, Array], tuple[Array, Array]]  # t, e, what the law keeps -> v, how that changes


@dataclass
class Chains(Plain):
    """xhat' = f - v in chains of `length` states, v being a law of the innovation of each chain's output alone."""

    length: int = 2
    law: Law = lambda t, e, own: (np.zeros(2), own)
    kept: Sequence[float] = ()  # what the law keeps, at the start
    shrink: float | None = None  # e' = -shrink e between samples, whatever is corrected

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(xhat, np.tile(self.kept, len(self.measured)))

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        p, n = len(self.measured), len(self.measured) * self.length
        dx, own = self.f(t, z[:n], u), z[n:].reshape(p, -1)
        c, down = np.zeros(p), np.zeros_like(own)
        for i, first in enumerate(self.measured):
            v, down[i] = self.law(t, e[i], own[i])
            dx[first : first + self.length] -= v
            c[i] = v[0]
        return np.append(dx, down), c if self.shrink is None else self.shrink * e

    def xhat(self, z: Array, u: float) -> Array:
        return z[: len(self.measured) * self.length]


def binomials(n: int) -> Array:
    return np.array([math.comb(n, k) for k in range(1, n + 1)], dtype=float)


def powers(theta: float, n: int) -> Array:
    return theta ** np.arange(1.0, n + 1)


def standard(theta: float, n: int) -> Law:
    """v = theta Delta^-1 G e."""

    def law(t: float, e: float, own: Array) -> tuple[Array, Array]:
        return powers(theta, n) * binomials(n) * e, own

    return law


def treangle(theta: float, n: int) -> Law:
    """v = theta K w, w' = -theta D w + theta^2 A^T w + theta C^T e, all poles at -1."""
    k = binomials(n)

    def law(t: float, e: float, w: Array) -> tuple[Array, Array]:
        return theta * k * w, theta * (np.append(e, theta * w[:-1]) - 2 * w)

    return law


def integral(theta: float, n: int, r: int) -> Law:
    """eta' = A eta + B e - theta Delta_r^-1 K_r eta_1, v = theta^(r+1) Delta_n^-1 K_n eta_1."""
    K = binomials(r + n)

    def law(t: float, e: float, eta: Array) -> tuple[Array, Array]:
        v = theta**r * powers(theta, n) * K[r:] * eta[0]
        return v, np.append(eta[1:], e) - powers(theta, r) * K[:r] * eta[0]

    return law


def lowpass(theta: float, n: int, r: int, rho: float) -> Law:
    """eta' = theta/rho (-eta + A^T eta + C^T e), v = theta Delta^-1 G eta_r."""

    def law(t: float, e: float, eta: Array) -> tuple[Array, Array]:
        return powers(theta, n) * binomials(n) * eta[-1], theta / rho * (np.append(e, eta[:-1]) - eta)

    return law


def piecewise(theta_1: float, theta_2: float, d: float, n: int) -> Law:
    def law(t: float, e: float, own: Array) -> tuple[Array, Array]:
        inner = np.clip(e, -d, d)
        return binomials(n) * (powers(theta_1, n) * (e - inner) + powers(theta_2, n) * inner), own

    return law


def updated(theta_0: float, theta_max: float, a: float, b: float, delta: float, n: int) -> Law:
    def law(t: float, e: float, own: Array) -> tuple[Array, Array]:
        theta = own[0]
        grown = a * theta * (1 - theta / theta_max) * np.clip(abs(e) / delta - 1, 0, 1)
        return powers(theta, n) * binomials(n) * e, np.array([grown - b * (theta - theta_0)])

    return law


def zone(theta: float, lam: float, rho: float, n: int, stubborn: bool) -> Law:
    """v of the innovation outside (or within) sqrt(sigma), sigma' = -lam sigma + rho e^2."""

    def law(t: float, e: float, sigma: Array) -> tuple[Array, Array]:
        w = math.sqrt(max(sigma[0], 0.0))
        within = np.clip(e, -w, w)
        used = within if stubborn else e - within
        return powers(theta, n) * binomials(n) * used, -lam * sigma + rho * e**2

    return law


def homogeneous(theta: float, d0: float, dinf: float, n: int) -> Law:
    def weight(i: int, d: float) -> float:
        return 1 + d if i == n + 1 else 1 - d * (n - i)

    def law(t: float, e: float, own: Array) -> tuple[Array, Array]:
        v, w = np.zeros(n), e
        for i in range(1, n + 1):
            a, b = (weight(i + 1, d) / weight(i, d) for d in (d0, dinf))
            w = (abs(w) ** a + abs(w) ** b) * np.sign(w) / 2
            v[i - 1] = theta**i * math.comb(n, i) * w
        return v, own

    return law


def prescribed_time(T: float, mu_max: float, n: int) -> Law:
    """Poles of A - G C - diag(0..n-1)/T at -l = -(n + 1)/T; t from the start."""
    shift = np.diag(np.arange(n)) / T
    A, target = np.diag(np.ones(n - 1), 1) - shift, np.poly([-(n + 1) / T] * n)
    G = np.zeros(n)
    for i in range(n):  # the characteristic polynomial is affine in G, and G_i stands first in its coefficient i + 1
        reached = np.poly(A - np.outer(G, np.eye(n)[0]))
        G[i] += target[i + 1] - reached[i + 1]

    def law(t: float, e: float, own: Array) -> tuple[Array, Array]:
        mu = min(T / (T - t), mu_max) if t < T else mu_max
        return powers(mu, n) * G * e, own

    return law


def super_twisting(f: float) -> Law:
    def law(t: float, e: float, own: Array) -> tuple[Array, Array]:
        return np.array([1.5 * math.sqrt(f * abs(e)) * np.sign(e), 1.1 * f * np.sign(e)]), own

    return law


@dataclass
class LowPower(Plain):
    """Blocks of two states xi_i, with the bounds M where they are used; n = 3, all poles at -1."""

    phi: Callable[[float, Array, float], float] = lambda t, x, u: 0.0
    M: Sequence[float] = (math.inf, math.inf)
    k: Sequence[Sequence[float]] = ((2, 2), (2, 0.5))

    def start(self, xhat: Array, u: float) -> Array:
        return np.array([xhat[0], xhat[1], xhat[1], xhat[2]])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        (k11, k12), (k21, k22) = self.k
        theta, x = self.theta, self.xhat(z, u)
        e1, e2 = -e[0], np.clip(z[1], -self.M[0], self.M[0]) - z[2]
        dz = [
            z[1] + theta * k11 * e1,
            np.clip(z[3], -self.M[1], self.M[1]) + theta**2 * k12 * e1,
            z[3] + theta * k21 * e2,
            self.phi(t, x, u) + theta**2 * k22 * e2,
        ]
        return np.array(dz), np.array([-theta * k11 * e1])

    def xhat(self, z: Array, u: float) -> Array:
        return np.array([z[0], z[2], np.clip(z[3], -self.M[1], self.M[1])])


@dataclass
class KalmanBucy(Plain):
    """xhat' = f - P H^T R^-1 e, P' = F P + P F^T + Q - P H^T R^-1 H P, with the slopes F, H at xhat."""

    Q: Array = field(default_factory=lambda: np.eye(1))
    R: Array = field(default_factory=lambda: np.eye(1))
    h: Callable[[float, Array, float], Array] | None = None

    def n(self, z: Array) -> int:
        return self.Q.shape[0]

    def output(self, z: Array) -> Array:
        x = z[: self.n(z)]
        return x[list(self.measured)] if self.h is None else self.h(0.0, x, 0.0)

    def H(self, x: Array) -> Array:
        return np.eye(x.size)[list(self.measured)] if self.h is None else slopes(self.h, 0.0, x, 0.0)

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(xhat, np.eye(xhat.size))

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = self.n(z)
        x, P = z[:n], z[n:].reshape(n, n)
        F, H = slopes(self.f, t, x, u), self.H(x)
        K = P @ H.T @ np.linalg.inv(self.R)
        dP = F @ P + P @ F.T + self.Q - K @ H @ P
        return np.append(self.f(t, x, u) - K @ e, dP), H @ K @ e

    def xhat(self, z: Array, u: float) -> Array:
        return z[: self.n(z)]
