"""Dynamic gain and direct reconstruction together."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.observers.base import Flow, Role, observer
from hgorun.observers.capabilities import Switching
from hgorun.observers.levant import levant_flow, levant_gains
from hgorun.observers.output_injection import Blend
from hgorun.observers.praly_gain import DynamicGain
from hgorun.symbolic.lower_triangular import LowerTriangularCopy, LowerTriangularForm
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("direct_dynamic")
class DirectDynamicObserver(Switching, DynamicGain):
    """High-gain observer with dynamic gain and direct reconstruction, for the plants of `dynamic_gain`.

        xhat'  = A xhat + g(xhat, u) + w Theta(theta) l (y - xhat_1) + (1 - w) Gamma(theta) (x^d - xhat)
        theta' = -(theta/b) (((w a + (1 - w) phi)/3) (theta - 1) - 2 (n-1)/sqrt(q) gamma(y))
        w      = exp(-mu (y - xhat_1)^2),   mu = mu_0/theta^(2b),   Gamma(theta) = A + theta (phi/2) I

    with x^d as in `direct` and l, a, b, q, gamma as in `dynamic_gain`. While the reconstruction is at work
    theta falls to 1 at the rate phi/(3b), so that the observer that takes over amplifies less noise. mu_0 > 0
    is the sharpness of the blend at theta = 1, phi > a the strength of the pull to x^d, theta phi/2 its
    rate, G > 0 the differentiator's gain. Take ``method: euler``. Figure 2 is ``{l: [2, 1], a: 1.17, b: 2.3,
    q: 0.15, gamma: 4*y, mu_0: 500, phi: 4000, G: 1, internal: {z: [0.05, 0]}}``.

    The proof of theorem 2 prints exp(mu ...) where the definition of w gives exp(-mu ...). See `dynamic_gain`
    for the constants.
    """

    reference = "Meiners, Adamy 2025, (18)-(19), theorem 2"

    mu_0: Positive = Field(description="sharpness of the blend at theta = 1, > 0")
    phi: Positive = Field(description="Gamma(theta) = A + theta (phi/2) I, phi > a")
    G: Positive = Field(description="Lipschitz constant of y^(n-1), > 0")

    @property
    def blend(self) -> Blend:
        return Blend(self.mu_0, self.phi)

    def design(self, form: LowerTriangularForm) -> dict[str, np.ndarray]:
        own = {"mu_0": np.array(self.mu_0), "phi": np.array(self.phi), "gains": levant_gains(form.n, self.G)}
        return {**super().design(form), **own}

    def states(self, form: LowerTriangularForm) -> dict[str, np.ndarray | Symmetric]:
        return {**super().states(form), "z": np.zeros(form.n)}

    def roles(self, form: LowerTriangularForm) -> dict[str, Role]:
        return {**super().roles(form), "z": "signal"}

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {**super().example(states), "mu_0": 5.0, "phi": 40.0, "G": 1.0}

    def equations(self, plant: LowerTriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        xhat, theta = s.xhat, s.theta
        y = plant.output(xhat) - e
        # theta^(-2b) with theta >= 1: a power whose exponent may be whole takes three times as long
        w = ca.exp(-k.mu_0 * ca.exp(-2 * k.b * ca.log(theta)) * e**2)
        gap = plant.reconstruct(s.z, guess=xhat) - xhat
        pull = plant.A @ gap + theta * k.phi / 2 * gap
        kappa = w * (plant.Theta(theta) @ plant.along(k.l)) * e - (1 - w) * pull
        derivatives = {
            "xhat": plant.copy(xhat) - kappa,
            "theta": self.theta_rate(theta, w * k.a + (1 - w) * k.phi, y, plant.n, k),
            "z": levant_flow(s.z, s.z[0] - y, k.gains),
        }
        return Flow(derivatives, correction=plant.measured(kappa))

    def fastest_rate(self, form: LowerTriangularForm) -> float:
        return max(super().fastest_rate(form), self._start() * self.phi / 2)
