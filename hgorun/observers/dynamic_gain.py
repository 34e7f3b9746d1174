"""High-gain observer whose gain is a state of its own, after Praly."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
from pydantic import Field, field_validator

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.types import ExpressionText, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.direct import OutputInjection
from hgorun.symbolic.lower_triangular import LowerTriangularCopy, LowerTriangularForm, state_affine_form
from hgorun.symbolic.states import Symmetric


class DynamicGain(OutputInjection):
    """The keys of the gain's dynamics: a, b, q of (9), and gamma of (6)."""

    form = staticmethod(state_affine_form)

    a: Positive = Field(description="a > 0: how fast theta falls back to 1; of the inequality (9)")
    b: Positive = Field(description="b > 0: how slowly theta moves; of the inequality (9)")
    q: Positive = Field(le=1, description="0 < q <= 1: lower bound q I <= Q in (9)")
    gamma: ExpressionText = Field(description="expression of y, >= 0: bounds the slopes of g at this output (6)")

    @field_validator("gamma")
    @classmethod
    def _of_y(cls, text: str) -> str:
        try:
            parse(text, names=("y",))
        except ExpressionError as error:
            raise ValueError(str(error)) from error
        return text

    def design(self, form: LowerTriangularForm) -> dict[str, np.ndarray]:
        start = self._start()
        if start < 1:
            raise Problem(("internal", "theta"), f"theta starts at 1 or above, found {start:g}: (8) keeps it there")
        return {
            "l": self.injection(form),
            "a": np.array(self.a),
            "b": np.array(self.b),
            "q": np.array(self.q),
        }

    def states(self, form: LowerTriangularForm) -> dict[str, np.ndarray | Symmetric]:
        return {"theta": np.array(1.0)}

    def theta_rate(self, theta: ca.SX, decay: ca.SX, y: ca.SX, n: int, k: SimpleNamespace) -> ca.SX:
        """(8), with ``decay`` in the place of a."""
        growth = 2 * (n - 1) / ca.sqrt(k.q) * parse(self.gamma, names=("y",)).symbol({"y": y})
        return -theta / k.b * (decay / 3 * (theta - 1) - growth)

    def _start(self) -> float:
        """theta(0); 1 where what is given is no number, which is reported elsewhere."""
        try:
            return float(np.min(np.asarray(self.internal.get("theta", 1.0), dtype=float)))
        except (TypeError, ValueError):
            return 1.0

    def fastest_rate(self, form: LowerTriangularForm) -> float:
        return self._start() * self._rate(form)


@observer("dynamic_gain")
class DynamicGainObserver(DynamicGain):
    """High-gain observer with dynamic gain, for x_i' = x_(i+1) + g_i(x_1..x_i, u), y = x_1 (5).

        xhat'  = A xhat + g(xhat, u) + Theta(theta) l (y - xhat_1),     Theta = diag(theta, ..., theta^n)
        theta' = -(theta/b) ((a/3) (theta - 1) - 2 (n-1)/sqrt(q) gamma(y))

    The slopes of g need no bound that holds everywhere: gamma(y) bounds them at the present output, |g_i(xhat, u)
    - g_i(x, u)| <= gamma(y) (|xhat_1 - x_1| + ... + |xhat_i - x_i|) (6), and theta follows it: at
    constant y it goes to 1 + 6 (n-1) gamma(y)/(a sqrt(q)). theta(0) >= 1, by ``internal: {theta: 1}``, stays above
    1. l (or poles) makes A - l c Hurwitz; a, b, q > 0 must be such that some Q, q I <=
    Q <= I, satisfies (9) with Delta = diag(0, ..., n-1),

        Q (A - l c) + (A - l c)^T Q <= -a Q,    -b Q <= Q Delta + Delta Q <= b Q

    which ``hgorun.analysis.papers.lmi.certificate(l, a, b, q)`` finds or denies, with proof. Take `direct` with mu = 0
    where one theta will do.

    The paper's constants, l = (2, 1), a = 1.17, b = 2.3, q = 0.15, are said to fulfil (9): no Q does; with b
    = 2.42, or a = 1.06, there is one. The observer runs with any.
    """

    reference = "Praly 2003; Meiners, Adamy 2025, (5)-(9)"

    def equations(self, plant: LowerTriangularCopy, s: SimpleNamespace, e: ca.SX, k: SimpleNamespace) -> Flow:
        y = plant.output(s.xhat) - e
        kappa = plant.Theta(s.theta) @ plant.along(k.l) * e
        theta_rate = self.theta_rate(s.theta, k.a, y, plant.n, k)
        return Flow({"xhat": plant.copy(s.xhat) - kappa, "theta": theta_rate}, correction=plant.measured(kappa))
