"""The window of a moving-horizon estimator: a Gauss-Newton step on it, and the plant between its samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from hgorun.observers.gaussian import linear_update


@dataclass(frozen=True, eq=False, repr=False)
class Carried:
    """Where the plant is some time later, shape (n,), and the slope of that, shape (n, n)."""

    x: ca.SX
    Phi: ca.SX


class Flight:
    """How the plant moves from a sample to the next: RK4, and its slope, which is RK4 on the variational equation.

    Parameters
    ----------
    rate : casadi.SX, shape (n,)
        The plant's vector field, an expression of ``t`` and ``x``.
    t, x : casadi.SX
        Symbols of time and of the state.
    steps : int
        From a sample to the next.
    """

    def __init__(self, rate: ca.SX, t: ca.SX, x: ca.SX, steps: int) -> None:
        own = [t, *ca.vertsplit(x)]
        self._numbers = [one for one in ca.symvar(rate) if not any(ca.is_equal(one, other) for other in own)]
        self._steps, h = steps, ca.SX.sym("h")
        f = ca.Function("f", [t, x, *self._numbers], [rate])
        a = f(t, x, *self._numbers)
        b = f(t + h / 2, x + h / 2 * a, *self._numbers)
        c = f(t + h / 2, x + h / 2 * b, *self._numbers)
        d = f(t + h, x + h * c, *self._numbers)
        after = x + h / 6 * (a + 2 * b + 2 * c + d)
        self._step = ca.Function("step", [t, x, h, *self._numbers], [after, ca.jacobian(after, x)])

    def carried(self, t: ca.SX, x: ca.SX, T: ca.SX) -> Carried:
        """x(t + T) from x(t)."""
        Phi, h = ca.SX.eye(x.numel()), T / self._steps
        for i in range(self._steps):
            x, slope = self._step(t + i * h, x, h, *self._numbers)
            Phi = slope @ Phi
        return Carried(x, Phi)


@dataclass(frozen=True, eq=False, repr=False)
class Window:
    """N samples, the newest last; those that have not been taken yet stand before them, without time and output.

    Attributes
    ----------
    y, fresh : list of casadi.SX, shape (q,)
        What was measured at every sample, and 1 for the outputs that were.
    xbar, Pbar : casadi.SX, shapes (n,), (n, n)
        What is known of the state at the first sample without it and all later ones.
    carry : callable
        (i, x) -> x at sample i + 1 from that at sample i, and its slope.
    noise : callable
        (i, x) -> covariance of what the model does not know in between, shape (n, n).
    measured : callable
        x -> outputs, their slopes, and their variances: shapes (q,), (q, n), (q,).
    """

    y: list[ca.SX]
    fresh: list[ca.SX]
    xbar: ca.SX
    Pbar: ca.SX
    carry: Callable[[int, ca.SX], Carried]
    noise: Callable[[int, ca.SX], ca.SX]
    measured: Callable[[ca.SX], tuple[ca.SX, ca.SX, ca.SX]]

    def updated(self, i: int, x: ca.SX, mean: ca.SX, P: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Mean and covariance with sample i, its output linearised at x."""
        y, H, R = self.measured(x)
        shift, P = linear_update(P, self.y[i] - y - H @ (mean - x), H, R, self.fresh[i])
        return mean + shift, P

    def predicted(self, i: int, x: ca.SX, mean: ca.SX, P: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Mean and covariance at the next sample, the plant linearised at x, and the slope."""
        moved = self.carry(i, x)
        P = moved.Phi @ P @ moved.Phi.T + self.noise(i, x)
        return moved.x + moved.Phi @ (mean - x), (P + P.T) / 2, moved.Phi

    def improved(self, nodes: list[ca.SX]) -> tuple[list[ca.SX], ca.SX]:
        """One full Gauss-Newton step: the smoother of the problem that is linearised at the nodes.

        Also the covariance of the newest node, shape (n, n).
        """
        means, covariances, predictions = [], [], []
        mean, P = self.xbar, self.Pbar
        for i, x in enumerate(nodes):
            mean, P = self.updated(i, x, mean, P)
            means.append(mean)
            covariances.append(P)
            if i < len(nodes) - 1:
                mean, P, Phi = self.predicted(i, x, mean, P)
                predictions.append((mean, P, Phi))
        found = [means[-1]]  # the newest first
        for i in reversed(range(len(nodes) - 1)):
            ahead, P, Phi = predictions[i]
            R = ca.chol(P)
            gap = ca.solve(R, ca.solve(R.T, found[-1] - ahead))
            found.append(means[i] + covariances[i] @ (Phi.T @ gap))
        found.reverse()
        return found, covariances[-1]
