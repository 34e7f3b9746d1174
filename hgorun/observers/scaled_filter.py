"""Kalman filters whose process noise is scaled with theta along the coordinates z of chains, or of blocks."""

from __future__ import annotations

from typing import Annotated

import casadi as ca
import numpy as np
from pydantic import Discriminator, Field, Tag

from hgorun.config.types import Number, Positive
from hgorun.observers.covariance import BeginsWithCovariance
from hgorun.observers.extension import Extendable
from hgorun.observers.gaussian import spread_along
from hgorun.observers.kalman import SensorNoise, by_output, require_covariance
from hgorun.observers.riccati import require_positive_definite
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form
from hgorun.symbolic.scaled import ScaledCopy, scaled_form
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols

Weight = Annotated[
    Annotated[Positive, Tag("a number")] | Annotated[tuple[tuple[Number, ...], ...], Tag("rows")],
    Discriminator(lambda value: "rows" if isinstance(value, (list, tuple)) else "a number"),
]


class ScaledFilter(BeginsWithCovariance, Extendable[Form, ScaledCopy]):
    """The weights of such a filter, and P between samples."""

    form = scaled_form

    Q: Weight = Field(
        default=1.0,
        description="weight of the model's errors in z, at theta = 1: a multiple of the identity, or the rows of a "
        "matrix",
    )
    R: SensorNoise = Field(
        default=1.0, description="weight of the noise, at theta = 1: a number for all outputs, or output: number"
    )

    def design(self, form: Form) -> dict[str, np.ndarray]:
        if "P" in self.internal:
            require_positive_definite("P", self.internal["P"], Symmetric(np.eye(form.plant.n)))
        return {"Q": self.weight(form.plant.n), "R": by_output(self.R, form)}

    def weight(self, n: int) -> np.ndarray:
        """Q, shape (n, n)."""
        if not isinstance(self.Q, tuple):
            return self.Q * np.eye(n)
        return require_covariance(self.Q, n, "a multiple of the identity")

    def at_rest(self, chains: tuple[int, ...], R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """On chains of integrators with theta = 1 the P at which Riccati's equation rests, and the error's matrix."""
        from scipy.linalg import block_diag, solve_continuous_are

        shift = block_diag(*[np.eye(length, k=1) for length in chains])
        C = np.eye(len(shift))[np.cumsum([0, *chains[:-1]])]
        P = solve_continuous_are(shift.T, C.T, self.weight(len(shift)), np.diag(R))
        return P, shift - P @ C.T @ np.diag(1 / R) @ C

    def spread(self, plant: ScaledCopy, s: Symbols, k: Symbols, theta: ca.SX) -> ca.SX:
        """F P + P F^T + Q_theta, F the whole Jacobian of the copy."""
        scale = theta * plant.inv_Delta(theta) @ k.Q @ plant.inv_Delta(theta)
        back = ca.horzcat(*[plant.lift(s.xhat, ca.SX(unit)) for unit in ca.horzsplit(ca.DM.eye(scale.size1()))])
        return spread_along(ca.jacobian(plant.copy(s.xhat), s.xhat), s.P, back @ scale @ back.T)

    def flow(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols, theta: ca.SX) -> dict[str, ca.SX]:
        """xhat' and P' of an output that is measured all the time."""
        H = ca.jacobian(plant.output(s.xhat), s.xhat)
        K = s.P @ H.T @ ca.diag(theta / k.R)
        return {"xhat": plant.copy(s.xhat) - K @ e, "P": self.spread(plant, s, k, theta) - K @ (H @ s.P)}

    def rate(self, form: Form, theta: float) -> float:
        """That of P' = -P^2 theta/R at the start, or of chains at rest, whichever is faster."""
        chains = form.chains if isinstance(form, CanonicalForm) else (form.plant.n,)
        R = np.resize(by_output(self.R, form), len(chains))
        _, closed = self.at_rest(chains, R)
        default = Symmetric(np.eye(form.plant.n))
        start = StateBlock.of(0, default).initial(self.internal.get("P", 1.0), default.values)
        rest = float(np.max(np.abs(np.linalg.eigvals(closed))))
        return theta * max(rest, 2 * float(np.max(np.linalg.eigvalsh(start))) / float(np.min(R)))
