"""Observers on logs of samples as plain NumPy: what estimates of recorded data are compared with.

It shares no code with the package. A sample is (taken, known, output, value); every observer is a few lines that can be
checked by eye against its equations, of a state z that the loops below integrate from event to event by equal steps of
the classical Runge-Kutta method. The innovation of output i is

    e_i(t) = s_i(taken) - y + alpha_i(t),     s = h(xhat) - alpha,     alpha' = -c,

c being what the observer subtracts from h(xhat)'; it is zero before the first sample. A late sample is compared with
the s of the time when it was taken. To replay is to begin again, with what is known by then in the order of taking.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray
Sample = tuple[float, float, int, float]  # taken, known, the output's number, value
Field = Callable[[float, Array, float], Array]  # x' = f(t, x, u)


def without_model(t: float, x: Array, u: float) -> Array:
    raise NotImplementedError


@dataclass
class Plain:
    """An observer of the states `measured`; what it estimates besides stands behind xhat in z."""

    f: Field
    measured: Sequence[int]
    theta: float = 2.0

    def start(self, xhat: Array, u: float) -> Array:
        return xhat

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        """z' and c."""
        return self.f(t, z, u), np.zeros(len(self.measured))

    def output(self, z: Array) -> Array:
        return z[list(self.measured)]

    def corrected(self, z: Array, y: Mapping[int, float], since: Mapping[int, float], u: float) -> Array:
        """z after samples of some outputs, each a time `since` after the one before it."""
        return z

    def decided(self, z: Array, e: Array, t: float) -> Array:
        """z after a decision, at the end of every step and after every sample."""
        return z

    def xhat(self, z: Array, u: float) -> Array:
        return z


@dataclass
class Input:
    """A recorded input."""

    times: Sequence[float] = (0.0,)
    values: Sequence[float] = (0.0,)
    linear: bool = False

    def __call__(self, t: float, inside: float) -> float:
        """u at t, which belongs to the stretch between two events that `inside` lies in."""
        if self.linear:
            return float(np.interp(t, self.times, self.values))
        return self.values[int(np.searchsorted(self.times, inside, side="right")) - 1]


def runge_kutta(
    slope: Callable[[float, Array], Array],
    z: Array,
    t: float,
    end: float,
    step: float,
    decided: Callable[[float, Array], Array] = lambda t, z: z,
) -> Array:
    count = max(1, math.ceil((end - t) / step * (1 - 1e-9)))
    h = (end - t) / count
    for now in t + h * np.arange(count):
        k1 = slope(now, z)
        k2 = slope(now + h / 2, z + h / 2 * k1)
        k3 = slope(now + h / 2, z + h / 2 * k2)
        k4 = slope(now + h, z + h * k3)
        z = decided(now + h, z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return z


@dataclass
class Log:
    """What is known of a plant, and how finely it is gone through."""

    samples: Sequence[Sample]
    times: Sequence[float]  # at which estimates are wanted; the first one is the start
    start: Sequence[float]
    u: Input = field(default_factory=Input)
    step: float = 0.01
    stops: Sequence[float] = ()  # further ends of steps

    def by_innovation(self, observer: Plain) -> Array:
        """Samples enter when they are known; an older one than the newest of its output does not."""
        p, begin = len(observer.measured), self.times[0]
        xhat = np.array(self.start, dtype=float)
        z = np.append(observer.start(xhat, self.u(begin, begin)), np.zeros(p))
        then: dict[tuple[float, int], float] = {}
        compared: dict[int, float] = {}
        newest = dict.fromkeys(range(p), -math.inf)
        last = dict.fromkeys(range(p), begin)
        found = []
        known = sorted(self.samples, key=lambda one: (one[1], one[0]))
        events = {*self.times, *self.u.times, *self.stops, *(t for s in self.samples for t in s[:2])}
        now = begin
        for event in sorted(t for t in events if begin <= t <= self.times[-1]):

            def innovation(z: Array) -> Array:
                return np.array([compared[i] + z[i - p] if i in compared else 0.0 for i in range(p)])

            def slope(t: float, z: Array, inside: float = (now + event) / 2) -> Array:
                dz, c = observer.slope(t, z[:-p], innovation(z), self.u(t, inside))
                return np.append(dz, -c)

            def decided(t: float, z: Array) -> Array:
                return np.append(observer.decided(z[:-p], innovation(z), t), z[-p:])

            if event > now:
                z, now = runge_kutta(slope, z, now, event, self.step, decided), event
            s = observer.output(z[:-p]) - z[-p:]
            then |= {(t, i): s[i] for t, _, i, _ in self.samples if t == event}
            at_once = {}
            for t, _, i, y in [one for one in known if one[1] == event and one[0] >= newest[one[2]]]:
                if t >= newest[i]:
                    newest[i], compared[i], at_once[i] = t, then[t, i] - y, y
            if at_once:
                since = {i: event - last[i] for i in at_once}
                last |= dict.fromkeys(at_once, event)
                z[:-p] = observer.corrected(z[:-p], at_once, since, self.u(event, event))
                z = decided(event, z)
            if event in self.times:
                found.append(observer.xhat(z[:-p], self.u(event, event)))
        return np.array(found)

    def replayed(self, observer: Plain) -> Array:
        """At each time what the observer would be if what is known by then had been known at once."""
        found = []
        stops = [t for one in self.samples for t in one[:2]]
        for t in self.times:
            known = [(taken, taken, i, y) for taken, k, i, y in self.samples if k <= t]
            so_far = Log(known, sorted({self.times[0], t}), self.start, self.u, self.step, stops)
            found.append(so_far.by_innovation(observer)[-1])
        return np.array(found)


def slopes(f: Field, t: float, x: Array, u: float) -> Array:
    """df/dx, from complex steps: right to the last digits."""
    return np.asarray(f(t, x[:, None] + 1e-30j * np.eye(x.size), u).imag / 1e-30)


@dataclass
class Blocks(Plain):
    """For triangular plants: blocks of states, each as long as there are outputs, the measured ones first."""

    delta: float = 3.0

    def blocks(self, n: int) -> Array:
        """States in the order of their blocks: the i-th of all chains, chain by chain."""
        p = len(self.measured)
        return np.array([m + k for k in range(n // p) for m in self.measured])

    def F(self, t: float, x: Array, u: float) -> Array:
        p, order = len(self.measured), self.blocks(x.size)
        J = slopes(self.f, t, x, u)[np.ix_(order, order)]
        block = np.arange(x.size) // p
        return np.where(block[None, :] == block[:, None] + 1, J, 0.0)


class StandardRiccati(Blocks):
    """xhat' = f - theta Delta^-1 P C^T e, P' = theta (P + F P + P F^T - P C^T C P)."""

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(xhat, np.eye(xhat.size))

    def P_slope(self, t: float, x: Array, P: Array, u: float) -> Array:
        F, p = self.F(t, x, u), len(self.measured)
        return self.theta * (P + F @ P + P @ F.T - P[:, :p] @ P[:p])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n, p = math.isqrt(z.size), len(self.measured)
        x, P = z[:n], z[n:].reshape(n, n)
        order = self.blocks(n)
        v = self.theta ** (1 + np.arange(n) // p) * (P[:, :p] @ e)
        dx = self.f(t, x, u)
        dx[order] -= v
        return np.append(dx, self.P_slope(t, x, P, u)), v[:p]

    def xhat(self, z: Array, u: float) -> Array:
        return z[: math.isqrt(z.size)]


class Fhgo1(StandardRiccati):
    """xhat' = f - theta K eta, eta' = delta theta (-eta + theta A^T eta + C^T e), K = diag of P C^T's blocks."""

    def n(self, z: Array) -> int:
        return next(n for n in range(1, 9) if n * (n + 2) == z.size)

    def start(self, xhat: Array, u: float) -> Array:
        return np.concatenate([xhat, np.eye(xhat.size).ravel(), np.zeros(xhat.size)])

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n, p = self.n(z), len(self.measured)
        x, P, eta = z[:n], z[n : n + n * n].reshape(n, n), z[n + n * n :].reshape(-1, p)
        v = np.concatenate([self.theta * P[k * p : (k + 1) * p, :p] @ eta[k] for k in range(n // p)])
        before = np.vstack([e, self.theta * eta[:-1]])
        dx = self.f(t, x, u)
        dx[self.blocks(n)] -= v
        deta = self.delta * self.theta * (before - eta)
        return np.concatenate([dx, self.P_slope(t, x, P, u).ravel(), deta.ravel()]), v[:p]

    def xhat(self, z: Array, u: float) -> Array:
        return z[: self.n(z)]


@dataclass
class KineticRate(Plain):
    """xi' = K r - D xi + F of all, less theta g_1 e of the measured species; r' = -theta^2 g_2 K_a^-1 e."""

    K: Array = field(default_factory=lambda: np.eye(1))
    dilution: Callable[[float, float], float] = lambda t, u: 0.0
    feed: Callable[[float, float], Array] = lambda t, u: np.zeros(1)
    gains: tuple[float, float] = (2.0, 1.0)

    def start(self, xhat: Array, u: float) -> Array:
        return np.append(xhat, np.zeros(self.K.shape[1]))

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        n, a = self.K.shape[0], list(self.measured)
        xi, r = z[:n], z[n:]
        v = self.theta * self.gains[0] * e
        dxi = self.K @ r - self.dilution(t, u) * xi + self.feed(t, u)
        dxi[a] -= v
        return np.append(dxi, -(self.theta**2) * self.gains[1] * np.linalg.solve(self.K[a], e)), v

    def xhat(self, z: Array, u: float) -> Array:
        return z[: self.K.shape[0]]


@dataclass
class Cascade(Plain):
    """xhat_1' = w - theta a_1 e, w' = -theta^2 a_2 e, then q_i = a_i theta (z_i + xhat_(i-1)), z_i' = -q_i."""

    M: Sequence[float] = ()
    alpha: Sequence[float] = ()
    of_derivatives: Callable[[Array, float], Array] = lambda z, u: z
    to_derivatives: Callable[[Array, float], Array] = lambda x, u: x

    def start(self, xhat: Array, u: float) -> Array:
        x = self.to_derivatives(xhat, u)
        return np.array([*x[:2], *(x[i] / (self.alpha[i] * self.theta) - x[i - 1] for i in range(2, x.size))])

    def chain(self, z: Array) -> tuple[list[float], list[float]]:
        x, q = [z[0], float(np.clip(z[1], -self.M[0], self.M[0]))], []
        for i in range(2, z.size):
            q.append(self.alpha[i] * self.theta * (z[i] + x[-1]))
            x.append(float(np.clip(q[-1], -self.M[i - 1], self.M[i - 1])))
        return x, q

    def slope(self, t: float, z: Array, e: Array, u: float) -> tuple[Array, Array]:
        c = self.theta * self.alpha[0] * e
        w = -(self.theta**2) * self.alpha[1] * e[0]
        return np.array([z[1] - c[0], w, *(-q for q in self.chain(z)[1])]), c

    def xhat(self, z: Array, u: float) -> Array:
        return self.of_derivatives(np.array(self.chain(z)[0]), u)
