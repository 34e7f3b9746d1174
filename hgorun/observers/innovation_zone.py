"""A width of the innovation that follows how large it has been."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import NonNegative
from hgorun.errors import Problem
from hgorun.observers.base import Flow, Role
from hgorun.observers.capabilities import GainOfErrors, NotLinear
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.extension import Extendable
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

_TINY = 1e-300  # where the slope of sqrt is not a number, Jacobians have to be


class InnovationZone(GainOfErrors, NotLinear, Extendable, ConstantGain):
    """The standard observer, driven by what a zone of width w = sqrt(sigma) makes of the innovation.

    sigma' = -lam sigma + rho e^2, one sigma an output; the states of unknown inputs (``extend``) are d.
    """

    unknown = "d"

    lam: NonNegative | None = Field(default=None, description="rate at which the zone forgets; theta/5 by default")
    rho: NonNegative | None = Field(default=None, description="rate at which the squared innovation enters sigma")

    @abstractmethod
    def passed(self, e: ca.SX, w: ca.SX) -> ca.SX:
        """What drives the observer, shape (q,)."""

    @abstractmethod
    def rates(self) -> tuple[float, float]:
        """lam and rho.

        Raises
        ------
        Problem
            When they do not fit together.
        """

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        lam, rho = self.rates()
        start = self.internal.get("sigma", 0.0)
        if isinstance(start, float | int) and start < 0:
            raise Problem(("internal", "sigma"), f"sigma is a square and starts at 0 or above, found {start:g}")
        _, G = self.chain_gains(form)
        return {"theta": np.array(self.theta), "G": G, "lam": np.array(lam), "rho": np.array(rho)}

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray]:
        return {"sigma": np.zeros(len(form.chains))}

    def roles(self, form: CanonicalForm) -> dict[str, Role]:
        return {"sigma": "gain"}

    @property
    def not_linear(self) -> str | None:
        return "the zone is in proportion to the errors that there have been: no linear system describes small ones"

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        driving = self.passed(e, ca.sqrt(ca.fmax(s.sigma, _TINY)))
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * plant.along_chains(driving))
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta),
                "sigma": k.rho * e**2 - k.lam * s.sigma,
            },
            correction=plant.felt(s.xhat, kappa, k.theta),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._rate(form)
