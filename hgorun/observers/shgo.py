"""The standard high-gain observer."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.observers.base import Flow, observer
from hgorun.observers.constant_gain import ConstantGain
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


@observer("shgo")
class StandardObserver(ConstantGain):
    """Standard high-gain observer (SHGO) for uniformly observable plants.

    In the coordinates of the chain, with e the innovation,

        xhat' = A_n xhat + phi^s(u, xhat) - theta Delta_n^-1(theta) G e

    and in the plant's own coordinates xhat' = f(xhat, u) - theta J^-1(xhat) Delta_n^-1(theta) G e, J the
    Jacobian of z = (h, L_f h, ..., L_f^(n-1) h). A_n - G C_n has the given poles; the error decays at theta
    times their value. theta >= 1 buys speed and amplifies the noise in component i by theta^i: choose a
    filtered observer (fhgo2) where that matters.

    With sampled or late outputs e subtracts what the observer has corrected since the time of which the
    measurement speaks, (3.29). The thesis prints Delta_n(theta) in (3.63), and diag(1, theta) for Delta_2
    in (3.141); the inverse of (3.29) is right, since with the printed one theta gives no high gain.
    """

    reference = "Robles Magdaleno 2023, (3.20), (3.29), (3.142)"

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        _, G = self.chain_gains(form)
        return {"theta": np.array(self.theta), "G": G}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * plant.along_chains(e))
        return Flow(
            {"xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta)},
            correction=plant.felt(s.xhat, kappa, k.theta),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._rate(form)
