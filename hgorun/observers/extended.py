"""The extended high-gain observer, which estimates an unknown input as well."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.constant_gain import ConstantGain
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import A, inv_Delta
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("extended")
class ExtendedObserver(ConstantGain):
    """Extended high-gain observer for uniformly observable plants with an unknown input.

    The last equation of the chain has an unknown term, x_n' = phi_n(u, x) + d(t): a disturbance, or what the
    model does not know of phi_n. It is estimated as one more state, sigma. With e the innovation,

        xhat_i' = xhat_(i+1) + phi_i - theta^i g_i e,    i < n
        xhat_n' = phi_n + sigma - theta^n g_n e
        sigma'  = -theta^(n+1) g_(n+1) e

    and in the plant's own coordinates xhat' = f(xhat, u) - J^-1(xhat) (theta Delta_n^-1(theta) G_n e - B_n sigma).
    A_(n+1) - G C_(n+1) has the given n + 1 poles. ``extend: m`` takes a chain of m integrators in place of sigma,
    whose first state enters: a polynomial of degree m - 1 in t is followed without error. With several outputs there
    is one sigma an output, each at the end of its chain.

    A d that grows like s t leaves the errors xhat - x = -s (1, k_1, ..., k_n) / k_(n+1), k_i = theta^i g_i
    (extend: 1). Noise of high frequency reaches component i with theta^i, sigma with theta^(n+1): where the model is
    right and nothing disturbs the plant, choose ``shgo`` or a filtered observer, whose noise is smaller. On a chain
    of integrators with the input b_0 u this is the linear extended-state observer of active disturbance rejection.
    Other observers of chains estimate an unknown input as well with their key ``extend``.

    Result files have sigma as an internal state; figures, tables, streams and exported C show states of the plant.
    With d as one of them, d' = 0, ``shgo`` gives the same estimates, and that of d everywhere.
    """

    reference = "Freidovich, Khalil 2008; Gao 2003 for the chain of integrators"

    extend: int = Field(
        default=1,
        ge=1,
        le=10,
        strict=True,
        description="integrators that follow an unknown input: m >= 1",
    )

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if not form.square:
            raise Problem(
                ("type",),
                "outputs that measure the same have one unknown input between them, and this observer has one for "
                "each: leave out the outputs that are not needed",
            )
        gains = self.gains_of_chains(form, self.extend)
        G = np.concatenate([gain[: -self.extend] for gain in gains])
        G_sigma = np.column_stack([gain[-self.extend :] for gain in gains])
        return {"theta": np.array(self.theta), "G": G, "G_sigma": G_sigma}

    def characteristics(self, form: CanonicalForm) -> list[np.ndarray]:
        return [np.array([1.0, *gain]) for gain in self.gains_of_chains(form, self.extend)]

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        return {"sigma": np.zeros((self.extend, len(form.chains)))}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * plant.along_chains(e))
        powers = ca.horzcat(*[k.theta ** (n + 1) for n in plant.chains])
        driven = inv_Delta(k.theta, self.extend) @ k.G_sigma @ ca.diag(powers.T * e)
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa - plant.at_ends(s.sigma[0, :].T), k.theta),
                "sigma": A(self.extend) @ s.sigma - driven,
            },
            correction=plant.felt(s.xhat, kappa, k.theta),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._rate(form, self.extend)
