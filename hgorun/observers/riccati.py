"""Gains that follow F(u, x) through a Riccati or a Lyapunov equation, for the time-varying observers."""

from __future__ import annotations

from collections.abc import Mapping
from math import comb

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.capabilities import HighGain, SettlingGain
from hgorun.observers.extension import Extendable
from hgorun.symbolic.forms import Form
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm, triangular_form

_ERROR = 5.0  # of theta


def riccati(P: ca.SX, F: ca.SX, C: ca.SX) -> ca.SX:
    """P + F P + P F^T - P C^T C P: P'/theta (Robles Magdaleno 2023, (2.9))."""
    gain = P @ C.T
    return P + F @ P + P @ F.T - gain @ gain.T


def lyapunov(S: ca.SX, F: ca.SX, C: ca.SX) -> ca.SX:
    """-(S + F^T S + S F - C^T C): S'/theta of S = P^-1 (Robles Magdaleno 2023, (3.90))."""
    return -(S + F.T @ S + S @ F - C.T @ C)


def gain_of(S: ca.SX, C: ca.SX) -> ca.SX:
    """S^-1 C^T by Cholesky's factors: not a number, so that the observer is undefined, once rounding
    has made S indefinite."""
    R = ca.chol(S)
    return ca.solve(R, ca.solve(R.T, C.T))


class RiccatiGain(HighGain, SettlingGain, Extendable[TriangularForm, TriangularCopy]):
    """theta, and a symmetric matrix that is integrated beside the estimate."""

    form = staticmethod(triangular_form)

    theta: Positive = Field(
        description="high gain theta > 0: where the plant is uniformly observable the error decays like exp(-theta t)"
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0}

    def error_rate(self, form: TriangularForm) -> float:
        """A few theta: :meth:`fastest_rate` is that of the peaks of P."""
        return _ERROR * self.theta

    def settled(self, form: Form) -> dict[str, np.ndarray]:
        """The gain's matrices where they come to rest on a chain of n integrators.

        S = S_inf of order n, whose S^-1 C^T are the binomial coefficients, and P = S^-1.
        """
        S = stationary(form.plant.n)
        return {"S": S, "P": np.linalg.inv(S)}

    def rate(self, order: int) -> float:
        """What ``step: auto`` goes by for a gain of this order, (r + q) for q blocks behind r integrators.

        The maximum norm of the stationary closed loop, theta (2^order - 1), the sum of the binomial
        coefficients, and not its eigenvalues -theta: on the way to it, and each time that F passes through
        zero, P runs through peaks that are as much faster. Not more than 1023 theta: above order 10 the step
        would become too short to wait for, and should be checked.
        """
        return float(self.theta * (2 ** min(order, 10) - 1))

    def require_fit(self, defaults: dict[str, np.ndarray | Symmetric]) -> None:
        """Refuse what these observers cannot do with their block.

        Raises
        ------
        Problem
            When the coordinates are not theirs, or an initial matrix is not positive definite.
        """
        if self.coordinates == "canonical":
            raise Problem(
                ("coordinates",),
                "an observer with time-varying gain computes where the plant is triangular: leave this key out",
            )
        for name, default in defaults.items():
            if isinstance(default, Symmetric) and name in self.internal:
                require_positive_definite(name, self.internal[name], default)


def require_positive_definite(name: str, given: object, default: Symmetric) -> None:
    """Refuse an initial matrix that is not positive definite.

    Raises
    ------
    Problem
        Its path starts at ``internal``.
    """
    try:
        matrix = StateBlock.of(0, default).initial(given, default.values)
    except ValueError as error:
        raise Problem(("internal", name), str(error)) from error
    smallest = float(np.min(np.linalg.eigvalsh(matrix)))
    if smallest <= 0:
        raise Problem(
            ("internal", name),
            f"{name} must be positive definite at the start; its smallest eigenvalue is {smallest:g}",
        )


def stationary(r: int) -> np.ndarray:
    """S_1inf of (3.130), shape (r, r): (-1)^(i+j) binomial(i+j-2, j-1), whose S_1inf^-1 C_r^T is (3.131)."""
    i, j = np.indices((r, r))
    return np.asarray((-1.0) ** (i + j) * np.vectorize(comb, otypes=[float])(i + j, j))
