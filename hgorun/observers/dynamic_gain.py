"""High-gain observer whose gain is a state of its own, after Praly."""

from __future__ import annotations

import casadi as ca

from hgorun.observers.base import Flow, observer
from hgorun.observers.praly_gain import DynamicGain
from hgorun.symbolic.lower_triangular import LowerTriangularCopy
from hgorun.symbolic.symbols import Symbols


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

    which ``hgorun.analysis.papers.lmi.certificate(l, a, b, q)`` finds, or proves not to exist. Take `direct` with mu
    = 0 if a constant theta is enough.

    The paper's constants, l = (2, 1), a = 1.17, b = 2.3, q = 0.15, are said to fulfil (9): no Q does; with b
    = 2.42, or a = 1.06, there is one. The observer runs with any.
    """

    reference = "Praly 2003; Meiners, Adamy 2025, (5)-(9)"

    def equations(self, plant: LowerTriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        y = plant.output(s.xhat) - e
        kappa = plant.Theta(s.theta) @ plant.along(k.l) * e
        theta_rate = self.theta_rate(s.theta, k.a, y, plant.n, k)
        return Flow({"xhat": plant.copy(s.xhat) - kappa, "theta": theta_rate}, correction=plant.measured(kappa))
