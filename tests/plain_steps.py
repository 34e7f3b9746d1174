"""Observers that step from sample to sample or fit the last ones, for the loops of `plain_observers`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from plain_decisions import levant
from plain_observers import Array, Plain, runge_kutta, slopes
from scipy.linalg import expm, solve_sylvester
from scipy.special import beta


@dataclass
class Derivatives(Plain):
    """Differentiators: z begins with y and its derivatives; `back` is the state that has them."""

    n: int = 2
    back: Callable[[Array, float], Array] = lambda z, u: z
    there: Callable[[Array, float], Array] = lambda x, u: x
    window: int = 2

    def start(self, xhat: Array, u: float) -> Array:
        return self.there(xhat, u)

    def output(self, z: Array) -> Array:
        return z[:1]

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        return np.zeros(z.size), np.zeros(1)

    def xhat(self, z: Array, u: float) -> Array:
        return self.back(z[: self.n], u)


@dataclass
class Windowed(Derivatives):
    """z has (derivatives, the last samples' ages and values, the newest first; NaN: none)."""

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(super().start(xhat, u), np.full(2 * self.window, np.nan))

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        rate = np.zeros(z.size)
        rate[self.n : self.n + self.window] = 1.0
        return rate, np.zeros(1)

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        own, m = z[: self.n], self.window
        age, value = z[self.n : self.n + m], z[self.n + m :]
        age, value = np.append(0.0, age[:-1]), np.append(y[0], value[:-1])
        there = ~np.isnan(age)
        found = self.fitted(age[there], value[there])
        return np.concatenate([own if found is None else found, age, value])

    def fitted(self, age: Array, y: Array) -> Array | None:
        raise NotImplementedError


@dataclass
class SavitzkyGolay(Windowed):
    """i! times the coefficients of the polynomial of least squares in t - t_k."""

    degree: int = 2

    def fitted(self, age: Array, y: Array) -> Array | None:
        if age.size <= self.degree:
            return None
        V = np.vander(-age, self.degree + 1, increasing=True)
        c = np.linalg.lstsq(V, y, rcond=None)[0]
        return np.array([math.factorial(i) * c[i] for i in range(self.n)])


@dataclass
class Algebraic(Windowed):
    """T^-i int K_i y by trapezoids, whose weights are moved least to be exact for polynomials of degree i."""

    ends: tuple[float, float] | None = None  # kappa, mu; else both i

    def kernel(self, i: int, tau: Array) -> Array:
        """d^i/dtau^i [tau^(kappa+i) (1-tau)^(mu+i)]/B for whole kappa and mu."""
        kappa, mu = (i, i) if self.ends is None else self.ends
        P = np.polynomial.Polynomial
        f = P([0, 1]) ** int(kappa + i) * P([1, -1]) ** int(mu + i)
        return np.asarray(f.deriv(i)(tau)) / beta(kappa + i + 1, mu + i + 1) if i else f(tau) / beta(kappa + 1, mu + 1)

    def fitted(self, age: Array, y: Array) -> Array | None:
        if age.size < self.n:
            return None
        T = age[-1]
        tau = age / T
        gaps = np.diff(tau)
        trapezoid = (np.append(gaps, 0) + np.append(0, gaps)) / 2
        found = []
        for i in range(self.n):
            w = trapezoid * self.kernel(i, tau) / T**i
            V = np.vander(-age, i + 1, increasing=True).T
            target = np.append(np.zeros(i), math.factorial(i))
            found.append((w + np.linalg.lstsq(V, target - V @ w, rcond=None)[0]) @ y)
        return np.array(found)


@dataclass
class Spline(Derivatives):
    """The Kalman filter of n integrators driven by white noise of density 1/smoothing, samples with variance 1."""

    smoothing: float = 1.0

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(super().start(xhat, u), 1e8 * np.eye(self.n))

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = self.n
        A, B = np.diag(np.ones(n - 1), 1), np.eye(n)[-1]
        P = z[n:].reshape(n, n)
        dP = A @ P + P @ A.T + np.outer(B, B) / self.smoothing
        return np.append(A @ z[:n], dP), np.zeros(1)

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        n = self.n
        P, C = z[n:].reshape(n, n), np.eye(n)[:1]
        K = P @ C.T / (P[0, 0] + 1)
        left = np.eye(n) - K @ C
        return np.append(z[:n] + K[:, 0] * (y[0] - z[0]), left @ P @ left.T + K @ K.T)


Step = Callable[[Array, float, float], Array]  # z, y, h -> z a time h later


@dataclass
class Recursion(Derivatives):
    """z+ from the sample before (or the one that arrives: implicit); z has (own, y, whether there is one)."""

    step: Step = lambda z, y, h: z
    implicit: bool = False
    shown: Callable[[Array, float], Array] = lambda z, h: z
    more: int = 0  # states before the derivatives

    def start(self, xhat: Array, u: float) -> Array:
        return np.concatenate([np.zeros(self.more), super().start(xhat, u), [0.0, 0.0, 0.0]])

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        own, (before, seen, h) = z[:-3], z[-3:]
        if since[0] > 0 and (self.implicit or seen):
            own, h = self.step(own, y[0] if self.implicit else before, since[0]), since[0]
        return np.append(own, [y[0], 1.0, h])

    def xhat(self, z: Array, u: float) -> Array:
        return self.back(self.shown(z[self.more : -3], z[-1]), u)


def power(s: float, a: float) -> float:
    return abs(s) ** a * float(np.sign(s))


LAMBDA = (1.1, 1.5, 2.0, 3.0, 5.0, 7.0)


def coefficients(n: int) -> list[float]:
    """lt_0..lt_n."""
    lt = [LAMBDA[n]]
    for j in reversed(range(n)):
        lt.insert(0, LAMBDA[j] * lt[0] ** (j / (j + 1)))
    return lt


def chained(z: Array, h: float, *, exact: bool) -> Array:
    A = np.diag(np.ones(z.size - 1), 1)
    return (expm(A * h) if exact else np.eye(z.size) + h * A) @ z


def red(n: int, L: float, *, exact: bool) -> Step:
    """Of n derivatives; z+ = (I + h A) z - h a |s|^.., s = z_0 - y, or e^(A h) z - ..."""
    lt = coefficients(n)
    a = [lt[n - j] * L ** ((j + 1) / (n + 1)) for j in range(n + 1)]

    def step(z: Array, y: float, h: float) -> Array:
        pulled = np.array([a[j] * power(z[0] - y, (n - j) / (n + 1)) for j in range(n + 1)])
        return chained(z, h, exact=exact) - h * pulled

    return step


def implicit_red(n: int, L: float) -> Step:
    lt = coefficients(n)
    a = [lt[n - j] * L ** ((j + 1) / (n + 1)) for j in range(n + 1)]

    def step(z: Array, y: float, h: float) -> Array:
        b = sum(h**j * z[j] for j in range(n + 1)) - y
        q = h ** (n + 1) * a[n]
        if abs(b) <= q:
            s, xi = 0.0, b / q
        else:
            p = [1.0, *(h ** (j + 1) * a[j] for j in range(n)), q - abs(b)]
            s, xi = max(r.real for r in np.roots(p) if abs(r.imag) < 1e-9 * (1 + abs(r))), float(np.sign(b))
            for _ in range(3):  # np.roots is right to some digits
                s -= np.polyval(p, s) / np.polyval(np.polyder(p), s)
        new = z.copy()
        new[n] = z[n] - h * a[n] * xi
        for j in reversed(range(n)):
            new[j] = z[j] + h * (new[j + 1] - a[j] * s ** (n - j) * xi)
        return new

    return step


def quotients(z: Array, h: float) -> Array:
    """Row j of M: coefficients of (-ln(1-x))^j times h^(i-j)."""
    n, rows = z.size, []
    log, row = np.append(0.0, 1 / np.arange(1.0, n)), np.eye(1, n)[0]
    for j in range(n):
        rows.append(sum(row[i] * h ** (i - j) * z[i] for i in range(j, n)))
        row = np.convolve(row, log)[:n]
    return np.array(rows)


def hybrid_red(n: int, L: float, M: float, *, exact: bool) -> Step:
    mu = (2, 3, 4, 7, 9)

    def step(z: Array, y: float, h: float) -> Array:
        w, pulled = z[0] - y, []
        for j in range(n + 1):
            v = LAMBDA[n - j] * L ** (1 / (n - j + 1)) * power(w, (n - j) / (n - j + 1)) + mu[n - j] * M * w
            pulled.append(v)
            w = v  # z_(j+1) - z_j'
        return chained(z, h, exact=exact) - h * np.array(pulled)

    return step


def filtering(n: int, r: int, L: float, *, exact: bool) -> Step:
    """z is (w_1..w_r, z_0..z_n)."""
    N, lt = n + r, coefficients(n + r)

    def step(z: Array, y: float, h: float) -> Array:
        w, own = z[:r], z[r:]
        s = z[0] if r else own[0] - y
        follows = np.append(w[1:], own[0] - y)[:r] if r else np.zeros(0)
        dw = follows - [lt[N + 1 - i] * L ** (i / (N + 1)) * power(s, (N + 1 - i) / (N + 1)) for i in range(1, r + 1)]
        pulled = np.array(
            [lt[n - j] * L ** ((r + 1 + j) / (N + 1)) * power(s, (n - j) / (N + 1)) for j in range(n + 1)]
        )
        return np.append(w + h * dw, chained(own, h, exact=exact) - h * pulled)

    return step


def tracking(r: float, h_0: float) -> Step:
    def step(z: Array, v: float, h: float) -> Array:
        d, a_0 = r * h_0**2, h_0 * z[1]
        y = z[0] - v + a_0
        a_1 = math.sqrt(d * (d + 8 * abs(y)))
        a = a_0 + y if abs(y) <= d else a_0 + np.sign(y) * (a_1 - d) / 2
        fhan = -r * a / d if abs(a) <= d else -r * np.sign(a)
        return np.array([z[0] + h * z[1], z[1] + h * fhan])

    return step


@dataclass
class Levant(Derivatives):
    """As a differential equation, e being the innovation of z_0."""

    G: float = 1.0

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        dz = levant(z, z[0] - e[0], self.G)
        return dz, np.array([z[1] - dz[0]])


@dataclass
class Luenberger(Plain):
    """xhat' = f; xhat+ = xhat - L e at samples of the period T, (I - L C) e^(A T) having the eigenvalues exp(p T)."""

    A: Array = field(default_factory=lambda: np.eye(2))
    C: Array = field(default_factory=lambda: np.eye(2)[:1])
    poles: Sequence[complex] = ()
    T: float = 1.0

    def gain(self) -> Array:
        E, n = expm(self.A * self.T), len(self.A)
        seen = np.array([self.C[0] @ np.linalg.matrix_power(E, k + 1) for k in range(n)])
        p = np.real(np.poly(np.exp(np.array(self.poles) * self.T)))
        shifted = np.sum([c * np.linalg.matrix_power(E, n - k) for k, c in enumerate(p)], axis=0)
        return np.asarray(shifted @ np.linalg.solve(seen, np.eye(n)[-1]))

    def output(self, z: Array) -> Array:
        return self.C @ z

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        return z - self.gain() * (self.C @ z - y[0]) if since[0] > 0 else z


@dataclass
class Kkl(Plain):
    """xi+ = exp(-theta lam T) xi + y of the sample before; xhat = T^+ xi then, and follows f; of a linear plant."""

    A: Array = field(default_factory=lambda: np.eye(2))
    C: Array = field(default_factory=lambda: np.eye(2)[:1])
    lam: Sequence[float] = ()
    T: float = 1.0

    @property
    def map(self) -> Array:
        """T e^(A T) = Lam T + Gam C."""
        Lam, E = np.diag(np.exp(-self.theta * np.array(self.lam) * self.T)), expm(self.A * self.T)
        return np.asarray(solve_sylvester(-Lam, E, np.ones((len(self.lam), 1)) @ self.C))

    def start(self, xhat: Array, u: float) -> Array:
        return np.concatenate([xhat, np.zeros(len(self.lam)), [0.0, 0.0]])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n = len(self.A)
        return np.append(self.A @ z[:n], np.zeros(z.size - n)), np.zeros(1)

    def output(self, z: Array) -> Array:
        return self.C @ z[: len(self.A)]

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        n, xi, (before, seen) = len(self.A), z[len(self.A) : -2], z[-2:]
        if not seen:
            return np.concatenate([z[:n], self.map @ z[:n], [y[0], 1.0]])
        xi = np.exp(-self.theta * np.array(self.lam) * self.T) * xi + before
        return np.concatenate([np.linalg.pinv(self.map) @ xi, xi, [y[0], 1.0]])

    def xhat(self, z: Array, u: float) -> Array:
        return z[: len(self.A)]


@dataclass
class Horizon(Plain):
    """The minimum over the last N samples by Gauss-Newton steps of dense least squares; not for two z at a time.

    What it keeps is in itself, since windows grow: z is xhat alone. `fresh` begins anew.
    """

    h: Callable[[float, Array, float], Array] = lambda t, x, u: x[:1]
    Q: Array = field(default_factory=lambda: np.eye(2))
    R: Array = field(default_factory=lambda: np.eye(1))
    N: int = 5
    iterations: int = 3
    substeps: int = 5

    def start(self, xhat: Array, u: float) -> Array:
        self.nodes: list[Array] = []
        self.y: list[Mapping[int, float]] = []
        self.gaps: list[float] = []
        self.age = 0.0
        return np.append(xhat, 0.0)

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        return np.append(self.f(t, z[:-1], u), 1.0), np.zeros(len(self.measured))

    def output(self, z: Array) -> Array:
        return self.h(0.0, z[:-1], 0.0)

    def flown(self, x: Array, T: float) -> tuple[Array, Array]:
        """phi and its slope."""

        def phi(t: float, x: Array, u: float) -> Array:
            return runge_kutta(lambda t, x: self.f(t, x, 0.0), x, 0.0, T, T / self.substeps)

        return phi(0.0, x, 0.0), slopes(phi, 0.0, x, 0.0)

    def rows(self, x: Array, y: Mapping[int, float]) -> tuple[Array, Array, Array]:
        """Weighted: slope of h and y - h; and the inverse root of R."""
        own = sorted(y)
        W = np.linalg.inv(np.linalg.cholesky(self.R[np.ix_(own, own)]))
        H = slopes(self.h, 0.0, x, 0.0)[own]
        return W @ H, W @ (np.array([y[i] for i in own]) - self.h(0.0, x, 0.0)[own]), W

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        x, age = z[:-1].copy(), z[-1]
        n = x.size
        if not self.nodes:
            self.xbar, self.Pbar = x, np.eye(n)
        else:
            self.gaps.append(age)
        self.nodes.append(x)
        self.y.append(dict(y))
        if len(self.nodes) > self.N:
            first, T, y_s = self.nodes.pop(0), self.gaps.pop(0), self.y.pop(0)
            H, r, _ = self.rows(first, y_s)
            S = H @ self.Pbar @ H.T + np.eye(len(r))
            K = self.Pbar @ H.T @ np.linalg.inv(S)
            plus = self.xbar + K @ (r - H @ (self.xbar - first))
            P = self.Pbar - K @ H @ self.Pbar
            phi, Phi = self.flown(first, T)
            self.xbar, self.Pbar = phi + Phi @ (plus - first), Phi @ P @ Phi.T + self.Q * T
        for _ in range(self.iterations):
            self.improve(n)
        return np.append(self.nodes[-1], 0.0)

    def improve(self, n: int) -> None:
        m = len(self.nodes)
        blocks, right = [], []

        def row(parts: Mapping[int, Array], r: Array) -> None:
            line = np.zeros((r.size, m * n))
            for i, part in parts.items():
                line[:, i * n : (i + 1) * n] = part
            blocks.append(line)
            right.append(r)

        W = np.linalg.inv(np.linalg.cholesky(self.Pbar))
        row({0: W}, W @ (self.xbar - self.nodes[0]))
        for i in range(m):
            H, r, _ = self.rows(self.nodes[i], self.y[i])
            row({i: H}, r)
        for i, T in enumerate(self.gaps):
            phi, Phi = self.flown(self.nodes[i], T)
            V = np.linalg.inv(np.linalg.cholesky(self.Q * T))
            row({i: -V @ Phi, i + 1: V}, -V @ (self.nodes[i + 1] - phi))
        step = np.linalg.lstsq(np.vstack(blocks), np.concatenate(right), rcond=None)[0].reshape(m, n)
        self.nodes = [x + d for x, d in zip(self.nodes, step, strict=True)]

    def xhat(self, z: Array, u: float) -> Array:
        return z[:-1]
