"""Observers of samples by differences, and by a map that is fitted in a box, for the loops of `plain_observers`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement

import numpy as np
from plain_observers import Array, Plain
from plain_steps import Recursion, Step
from scipy.integrate import solve_ivp


def forward_differences(eps: float, H: Sequence[float]) -> Step:
    """q+ = q + h/eps (A_0 q + H y), q = diag(1, eps, ...) xhat, A_0 = A - H C."""
    n = len(H)
    D = np.diag(eps ** np.arange(n))
    A_0 = np.diag(np.ones(n - 1), 1) - np.outer(H, np.eye(n)[0])

    def step(z: Array, y: float, h: float) -> Array:
        q = D @ z
        return np.asarray(np.linalg.solve(D, q + h / eps * (A_0 @ q + np.array(H) * y)))

    return step


def implicit_levant(n: int, G: float) -> Step:
    """z+ = z + h v(z+) for n states, whatever |z_0 - y| is: the root of a function that rises, by halving."""
    gains = np.array([(1.1, 1.5, 2.0, 3.0, 5.0, 8.0)[n - 1 - i] * G ** (1 / (n - i)) for i in range(n)])

    def reached(z: Array, s: float, xi: float, h: float) -> Array:
        """z+ where z_0+ - y = s and its sign is xi."""
        pulled, size = [], abs(s)
        for i in range(n):  # |z_i - v_(i-1)| is what the equation before subtracts
            size = gains[i] * size ** ((n - 1 - i) / (n - i)) if i < n - 1 else gains[i]
            pulled.append(size * xi)
        new = np.append(z, 0.0)
        for i in reversed(range(n)):
            new[i] = z[i] + h * (new[i + 1] - pulled[i])
        return new[:n]

    def step(z: Array, y: float, h: float) -> Array:
        free = reached(z, 0.0, 0.0, h)[0] - y
        most = h**n * gains[-1]
        if abs(free) <= most:
            return reached(z, 0.0, free / most, h)
        sign, low, high = float(np.sign(free)), 0.0, abs(free)
        while (middle := (low + high) / 2) not in (low, high):
            left = (reached(z, middle, sign, h)[0] - y) * sign - middle
            low, high = (middle, high) if left > 0 else (low, middle)
        return reached(z, low, sign, h)

    return step


class FromTheFirstSample(Recursion):
    """The step to the first sample is none: what is estimated at the start stands there."""

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        return super().corrected(z, y, since, u) if z[-2] else np.append(z[:-3], [y[0], 1.0, 0.0])


@dataclass
class ReducedOrder(Plain):
    """zhat+ = (I - T H) zhat + T (H Psi + f_2(y, Psi, u)) with y and u of the sample before; H None: H = I/T.

    Psi is the least-squares solution of g Psi = (y+ - y)/T - f_1. z has (xhat, y, u, whether there is one).
    """

    H: Sequence[float] | None = None
    f_1: Callable[[Array, float], Array] = lambda y, u: y
    g: Callable[[Array, float], Array] = lambda y, u: np.eye(1)
    f_2: Callable[[Array, Array, float], Array] = lambda y, z, u: z
    hidden: Sequence[int] = field(default_factory=list)

    def start(self, xhat: Array, u: float) -> Array:
        return np.concatenate([xhat, np.zeros(len(self.measured)), [0.0, 0.0]])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        return np.zeros(z.size), np.zeros(len(self.measured))

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        p, T = len(self.measured), since[0]
        xhat, (before, u_before, seen) = z[: -p - 2].copy(), (z[-p - 2 : -2], z[-2], z[-1])
        new = np.array([y[i] for i in range(p)])
        if seen:
            known = list(self.hidden)
            rate = (new - before) / T - self.f_1(before, u_before)
            Psi = np.linalg.lstsq(self.g(before, u_before), rate, rcond=None)[0]
            H = np.eye(len(known)) / T if self.H is None else np.diag(self.H)
            xhat[known] = xhat[known] - T * H @ xhat[known] + T * (H @ Psi + self.f_2(before, Psi, u_before))
            xhat[list(self.measured)] = new
        return np.concatenate([xhat, new, [u, 1.0]])

    def xhat(self, z: Array, u: float) -> Array:
        return z[: -len(self.measured) - 2]


@dataclass
class KklOfBox(Plain):
    """xi+ = exp(-lam T) xi + y of the sample before; xhat is a cubic in xi then, fitted at points, and follows f.

    The map is the sum over the past of exp(-lam T j) y, back to exp(-20). z has (xhat, xi, y, whether there is one).
    """

    lam: Array = field(default_factory=lambda: np.ones(1))
    T: float = 1.0
    points: Array = field(default_factory=lambda: np.zeros((1, 2)))

    def __post_init__(self) -> None:
        known = self.map(self.points)
        self.middle, self.size = known.mean(axis=0), known.std(axis=0)
        self.W = np.linalg.lstsq(self.monomials(known), self.points, rcond=1e-12)[0]

    def map(self, x: Array) -> Array:
        times = self.T * np.arange(1, 1 + np.ceil(20 / np.min(self.lam) / self.T))

        def back(s: float, flat: Array) -> Array:
            return -self.f(0.0, flat.reshape(x.T.shape), 0.0).ravel()

        past = solve_ivp(back, (0, times[-1] + 1e-9), x.T.ravel(), "DOP853", times, rtol=1e-9, atol=1e-10).y
        y = past.reshape(*x.T.shape, times.size)[self.measured[0]]
        return np.asarray(y @ np.exp(-np.outer(times - self.T, self.lam)))

    def monomials(self, xi: Array) -> Array:
        w = (xi - self.middle) / self.size
        chosen = [c for d in range(4) for c in combinations_with_replacement(range(self.lam.size), d)]
        return np.stack([np.prod(w[..., list(one)], axis=-1) for one in chosen], axis=-1)

    def start(self, xhat: Array, u: float) -> Array:
        return np.concatenate([xhat, np.zeros(self.lam.size), [0.0, 0.0]])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = self.points.shape[1]
        return np.append(self.f(t, z[:n], u), np.zeros(z.size - n)), np.zeros(1)

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        n = self.points.shape[1]
        x, xi, (before, seen) = z[:n], z[n:-2], z[-2:]
        if seen:
            xi = np.exp(-self.lam * self.T) * xi + before
            x = self.monomials(xi) @ self.W
        else:
            xi = self.map(x[None])[0]
        return np.concatenate([x, xi, [y[0], 1.0]])

    def xhat(self, z: Array, u: float) -> Array:
        return z[: self.points.shape[1]]
