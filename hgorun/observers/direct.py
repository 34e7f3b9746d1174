"""High-gain observer for lower triangular plants, with direct reconstruction of the state."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from hgorun.config.types import NonNegative, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, Role, observer
from hgorun.observers.capabilities import HighGain, Switching
from hgorun.observers.levant import levant_flow, levant_gains
from hgorun.observers.output_injection import Blend, OutputInjection, slopes_of_l
from hgorun.symbolic.lower_triangular import LowerTriangularCopy, LowerTriangularForm
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("direct")
class DirectObserver(HighGain, Switching, OutputInjection):
    """High-gain observer for lower triangular plants, blended with a direct reconstruction of the state.

        xhat' = f(xhat, u) + w Theta l (y - yhat) + (1 - w) Gamma (x^d - xhat)
        w     = exp(-mu (y - yhat)^2),   Gamma = Theta l c + (phi/2) I,   x^d = Phi(z_0, z_1, ..., u, u', ...)

    Theta = diag(theta, ..., theta^n), c = (dh/dx_1, 0, ..., 0), and z the derivatives of y from Levant's
    differentiator (see `levant`), which runs inside. If the output error is large, the estimate is drawn to x^d,
    which converges fast but is noisy; if it is small, the high-gain observer (3) takes over. Phi is derived from the
    plant. With sampled or late outputs yhat - y is the innovation.

    theta > 0 must be so large that (3) converges for this l (or poles, at theta = 1, of a plant with slopes
    dx_i'/dx_(i+1) and dh/dx_1 of 1; where other slopes make the error grow poles are refused). mu >= 0 is the
    sharpness of the blend: 1/sqrt(mu) is an error of the output that counts as large; mu = 0 is (3) alone,
    without differentiator. phi/2 > 0 is the rate at which the estimate goes to x^d. G > 0 is the
    differentiator's gain, a bound on |y^(n)|. The differentiator is discontinuous: take ``method: euler``
    when mu > 0. Figure 1 is ``{theta: 1, l: [1, 0.5], mu: 50, phi: 4000, G: 1, internal: {z: [0.05, 0]}}``.

    The proof of theorem 1 prints Gamma with kappa/2; the line after it and the example need kappa, a value of
    dh/dx_1. It prints theta tau^2 in an exponent where e_1 = theta epsilon_1 gives theta^2 tau^2.
    """

    reference = "Meiners, Adamy 2025, (1)-(4), (13), theorem 1"

    mu: NonNegative = Field(default=0.0, description="sharpness of the blend, >= 0; 0: no reconstruction")
    phi: Positive | None = Field(default=None, description="Gamma = Theta l c + (phi/2) I, phi > 0; with mu")
    G: Positive | None = Field(default=None, description="Lipschitz constant of y^(n-1), > 0; with mu")

    @model_validator(mode="after")
    def _keys_of_the_reconstruction(self) -> DirectObserver:
        if self.mu > 0 and (self.phi is None or self.G is None):
            raise Problem(("mu",), "with mu > 0 the reconstruction needs phi and G")
        return self

    @property
    def blend(self) -> Blend | None:
        return Blend(self.mu, self.phi) if self.mu > 0 and self.phi is not None else None

    @property
    def switches(self) -> bool:
        """With the differentiator, which the reconstruction needs."""
        return self.mu > 0

    def design(self, form: LowerTriangularForm) -> dict[str, np.ndarray]:
        if self.l is None:
            self._require_stable(form)
        numbers = {"theta": np.array(self.theta), "l": self.injection(form)}
        if self.mu > 0 and self.phi is not None and self.G is not None:
            numbers |= {
                "mu": np.array(self.mu),
                "phi": np.array(self.phi),
                "gains": levant_gains(form.n, self.G),
            }
        return numbers

    def _require_stable(self, form: LowerTriangularForm) -> None:
        """Refuse poles, which are meant for slopes of 1, where the plant's own slopes make the error grow.

        With l_i over what it counts with there (:func:`slopes_of_l`) the eigenvalues are the poles.
        """
        l, usable = self.injection(form), slopes_of_l(form)  # noqa: E741  # the paper's letter
        largest = [float(np.max(np.roots([1.0, *(l * row)]).real)) for row in usable]
        if not largest or min(largest) < 0:
            return
        row = usable[int(np.argmin(largest))]
        slopes = ", ".join(f"{value:.4g}" for value in row / np.concatenate([[1.0], row[:-1]]))
        right = ", ".join(f"{value:.4g}" for value in l / row)
        raise Problem(
            ("poles",) if "poles" in self.model_fields_set else ("type",),
            f"poles are those of a plant with slopes of 1; here the slopes of y in x_1, x_1' in x_2, ... are {slopes} "
            f"near the start, and the error of the gain l = [{', '.join(f'{v:.4g}' for v in l)}] grows: give l, "
            f"for these slopes [{right}]",
        )

    def states(self, form: LowerTriangularForm) -> dict[str, np.ndarray | Symmetric]:
        return {"z": np.zeros(form.n)} if self.mu > 0 else {}

    def roles(self, form: LowerTriangularForm) -> dict[str, Role]:
        return {"z": "signal"} if self.mu > 0 else {}

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {"theta": 2.0, "mu": 5.0, "phi": 40.0, "G": 1.0}

    def equations(self, plant: LowerTriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        xhat, c = s.xhat, plant.slope(s.xhat)
        Theta_l = plant.Theta(k.theta) @ plant.along(k.l)
        correction, derivatives = -Theta_l * e, {}
        if "z" in vars(s):
            y = plant.output(xhat) - e
            w = ca.exp(-k.mu * e**2)
            gap = plant.reconstruct(s.z, guess=xhat) - xhat
            correction = w * correction + (1 - w) * (Theta_l @ (c @ gap) + k.phi / 2 * gap)
            derivatives["z"] = levant_flow(s.z, s.z[0] - y, k.gains)
        derivatives["xhat"] = plant.copy(xhat) + correction
        return Flow(derivatives, correction=-c @ correction)

    def fastest_rate(self, form: LowerTriangularForm) -> float:
        return max(self.theta * self._rate(form), (self.phi or 0.0) / 2 if self.mu > 0 else 0.0)
