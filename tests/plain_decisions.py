"""Observers that decide at the ends of steps, and those with a reconstruction, for the loops of `plain_observers`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from plain_corrections import KalmanBucy, binomials, powers
from plain_observers import Array, Plain, slopes


@dataclass
class InChains(Plain):
    """Plants in chains of `length` states, each beginning with a measured one."""

    length: int = 2

    @property
    def n(self) -> int:
        return self.length * len(self.measured)

    def lifted(self, gain: Array, e: Array) -> Array:
        """What is subtracted from f: the gain of a chain times the innovation of its output."""
        v = np.zeros(self.n)
        for first, own in zip(self.measured, e, strict=True):
            v[first : first + self.length] = gain * own
        return v

    def xhat(self, z: Array, u: float) -> Array:
        return z[: self.n]


@dataclass
class Switched(InChains):
    """z has (xhat, mode, how long |e| <= delta has been so)."""

    thetas: tuple[float, float] = (2.0, 1.0)
    delta: Sequence[float] = (1.0,)
    dwell: float = 1.0

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(xhat, [1.0, 0.0])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        theta = self.thetas[int(z[-2]) - 1]
        v = self.lifted(powers(theta, self.length) * binomials(self.length), e)
        return np.append(self.f(t, z[: self.n], u) - v, [0.0, 1.0]), v[list(self.measured)]

    def decided(self, z: Array, e: Array, t: float) -> Array:
        mode, calm = z[-2:]
        if np.any(np.abs(e) > self.delta):
            mode, calm = 1.0, 0.0
        elif calm >= self.dwell * (1 - 1e-9):
            mode = 2.0
        return np.append(z[:-2], [mode, calm])


@dataclass
class Bank(InChains):
    """Standard observers of several thetas; z has (each xhat, each innovation, each cost, mode)."""

    thetas: Sequence[float] = ()
    nu: float = 1.0
    lam: tuple[float, float] = (1.0, 0.0)
    eps: float = 0.9
    reset: bool = False

    def parts(self, z: Array) -> tuple[Array, Array, Array, int]:
        N, n, p = len(self.thetas), self.n, len(self.measured)
        x, e, eta = np.split(z[:-1], [N * n, N * (n + p)])
        return x.reshape(N, n).copy(), e.reshape(N, p).copy(), eta.copy(), int(z[-1])

    def whole(self, x: Array, e: Array, eta: Array, mode: float) -> Array:
        return np.concatenate([x.ravel(), e.ravel(), eta, [mode]])

    def start(self, xhat: Array, u: float) -> Array:
        N = len(self.thetas)
        return self.whole(np.tile(xhat, (N, 1)), np.zeros((N, len(self.measured))), np.ones(N), 0)

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        x, own, eta, _ = self.parts(z)
        dx, down, deta = np.zeros_like(x), np.zeros_like(own), np.zeros_like(eta)
        for k, theta in enumerate(self.thetas):
            v = self.lifted(powers(theta, self.length) * binomials(self.length), own[k])
            dx[k], down[k] = self.f(t, x[k], u) - v, -v[list(self.measured)]
            deta[k] = -self.nu * eta[k] + self.lam[0] * own[k] @ own[k] + self.lam[1] * v @ v
        return self.whole(dx, down, deta, 0), np.zeros(len(self.measured))

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        x, e, eta, mode = self.parts(z)
        for i, value in y.items():
            e[:, i] = x[:, self.measured[i]] - value
        return self.whole(x, e, eta, mode)

    def decided(self, z: Array, e: Array, t: float) -> Array:
        x, own, eta, mode = self.parts(z)
        others = [k for k in range(eta.size) if k != mode]
        best = min(others, key=lambda k: (eta[k], k), default=mode)
        if others and eta[best] <= self.eps * eta[mode]:
            mode = best
            if self.reset:
                x[1:], own[1:], eta[1:] = x[best], own[best], eta[best]
        return self.whole(x, own, eta, mode)

    def xhat(self, z: Array, u: float) -> Array:
        x, _, _, mode = self.parts(z)
        return x[mode]

    def output(self, z: Array) -> Array:
        return np.zeros(len(self.measured))


@dataclass
class Adaptive(KalmanBucy):
    """A high-gain Kalman filter whose theta follows I; z has (xhat, P, theta, I, copies, J, when copy k begins, k)."""

    length: int = 2
    theta_1: float = 2.0
    d: float = 1.0
    N: int = 5
    dT: float = 0.1
    lam: float = 0.1
    m: float = 0.1
    beta: float = 100.0

    def n(self, z: Array) -> int:
        return self.length * len(self.measured)

    def parts(self, z: Array) -> list[Array]:
        n, N = self.n(z), self.N
        x, P, theta, cost, copies, J, due, k = np.split(z.copy(), np.cumsum([n, n * n, 1, 1, N * n, N, 1]))
        return [x, P.reshape(n, n), theta, cost, copies.reshape(N, n), J, due, k]

    @staticmethod
    def whole(*parts: ArrayLike) -> Array:
        return np.concatenate([np.ravel(one) for one in parts])

    def start(self, xhat: Array, u: float) -> Array:
        N = self.N
        first = [self.d / N, 1.0]  # copy 0 has begun
        return self.whole(xhat, np.eye(xhat.size), [1.0, 0.0], np.tile(xhat, (N, 1)), np.zeros(N), first)

    def scaled(self, theta: float) -> Array:
        D = np.zeros(self.n(np.zeros(0)))
        for first in self.measured:
            D[first : first + self.length] = theta ** np.arange(self.length)
        return theta * D[:, None] * self.Q * D

    def theta_slope(self, theta: float, cost: float) -> float:
        mu = 1 / (1 + math.exp(-self.beta * (cost - self.m)))
        F0 = theta**2 / self.dT if theta <= self.theta_1 else (theta - 2 * self.theta_1) ** 2 / self.dT
        return mu * F0 + (1 - mu) * self.lam * (1 - theta)

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        x, P, (theta,), (cost,), copies, _, _, _ = self.parts(z)
        F, H = slopes(self.f, t, x, u), self.H(x)
        K = P @ H.T @ np.linalg.inv(self.R / theta)
        dP = F @ P + P @ F.T + self.scaled(theta) - K @ H @ P
        y = self.output(x) - e
        dcopies = [self.f(t, one, u) for one in copies]
        dJ = [np.sum((y - self.output(one)) ** 2) for one in copies]
        dz = self.whole(self.f(t, x, u) - K @ e, dP, [self.theta_slope(theta, cost), 0.0], dcopies, dJ, [0.0, 0.0])
        return dz, H @ K @ e

    def decided(self, z: Array, e: Array, t: float) -> Array:
        x, P, theta, cost, copies, J, due, k = self.parts(z)
        if t >= due[0] - 1e-9 * self.d / self.N:
            j = int(k[0]) % self.N
            if k[0] >= self.N:
                cost[0] = J[j]
            copies[j], J[j] = x, 0.0
            due[0] += self.d / self.N
            k[0] += 1
        return self.whole(x, P, theta, cost, copies, J, due, k)


@dataclass
class AdaptiveAtSamples(Adaptive):
    """Corrected at samples of the period d/N, where copies begin."""

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(super().start(xhat, u)[:-1], 0.0)

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        x, P, (theta,), (cost,), copies, J, _, _ = self.parts(z)
        F = slopes(self.f, t, x, u)
        dP = F @ P + P @ F.T + self.scaled(theta)
        dcopies = [self.f(t, one, u) for one in copies]
        dz = self.whole(
            self.f(t, x, u), dP, [self.theta_slope(theta, cost), 0.0], dcopies, np.zeros_like(J), [0.0, 0.0]
        )
        return dz, np.zeros(len(self.measured))

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        x, P, theta, cost, copies, J, due, k = self.parts(z)
        T, rows = self.d / self.N, sorted(y)
        measured = np.array([y[i] for i in rows])
        H = self.H(x)[rows]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + self.R[np.ix_(rows, rows)] / (theta * T))
        J += [T * np.sum((measured - self.output(one)[rows]) ** 2) for one in copies]
        x, P = x + K @ (measured - self.output(x)[rows]), P - K @ H @ P
        j = int(k[0]) % self.N
        if k[0] >= self.N:
            cost[0] = J[j]
        copies[j], J[j] = x, 0.0
        return self.whole(x, P, theta, cost, copies, J, due, k + 1)

    def decided(self, z: Array, e: Array, t: float) -> Array:
        return z


def levant(z: Array, y: float, G: float) -> Array:
    """v_i = z_(i+1) - lambda_(n-1-i) G^(1/(n-i)) |z_i - v_(i-1)|^((n-1-i)/(n-i)) sign(z_i - v_(i-1)), v_(-1) = y."""
    n, before, found = z.size, y, []
    for i in range(n):
        d = z[i] - before
        gain = (1.1, 1.5, 2.0, 3.0)[n - 1 - i] * G ** (1 / (n - i))
        before = (z[i + 1] if i + 1 < n else 0.0) - gain * abs(d) ** ((n - 1 - i) / (n - i)) * np.sign(d)
        found.append(before)
    return np.array(found)


@dataclass
class Reconstructed(Plain):
    """Meiners and Adamy's observers of one output; z has (xhat, theta, z of the differentiator)."""

    l: Array = field(default_factory=lambda: np.ones(2))  # noqa: E741  # the paper's letter
    h: Callable[[Array], float] = lambda x: float(x[0])
    c: Callable[[Array], float] = lambda x: 1.0  # dh/dx_1
    back: Callable[[Array, float], Array] = lambda z, u: z  # the state of y, y', ...
    mu: float = 0.0
    phi: float = 0.0
    G: float = 1.0
    dynamic: tuple[float, float, float] | None = None  # a, b, q
    gamma: Callable[[float], float] = lambda y: 0.0

    def start(self, xhat: Array, u: float) -> Array:
        return np.concatenate([xhat, [self.theta], np.zeros(self.l.size)])

    def output(self, z: Array) -> Array:
        return np.array([self.h(z[: self.l.size])])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = self.l.size
        x, theta, own = z[:n], z[n], z[n + 1 :]
        c, y, Theta_l = self.c(x), self.h(x) - e[0], theta ** np.arange(1.0, n + 1) * self.l
        mu = self.mu if self.dynamic is None else self.mu / theta ** (2 * self.dynamic[1])
        w = math.exp(-mu * e[0] ** 2)
        gap = self.back(own, u) - x if self.mu > 0 else np.zeros(n)
        if self.dynamic is None:
            pull, dtheta = Theta_l * c * gap[0] + self.phi / 2 * gap, 0.0
        else:
            a, b, q = self.dynamic
            pull = np.append(gap[1:], 0.0) + theta * self.phi / 2 * gap
            decay = w * a + (1 - w) * self.phi
            dtheta = -theta / b * (decay / 3 * (theta - 1) - 2 * (n - 1) / math.sqrt(q) * self.gamma(y))
        v = w * Theta_l * e[0] - (1 - w) * pull
        return np.concatenate([self.f(t, x, u) - v, [dtheta], levant(own, y, self.G)]), np.array([c * v[0]])

    def xhat(self, z: Array, u: float) -> Array:
        return z[: self.l.size]
