"""The standard high-gain observer."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.observers.base import Flow, observer
from hgorun.observers.extension import Extendable
from hgorun.observers.nested import NESTED_FROM, NestedSaturation, nested
from hgorun.observers.sampled_poles import SampledPoles
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


@observer("shgo")
class StandardObserver(NestedSaturation, Extendable, SampledPoles):
    """Standard high-gain observer (SHGO) for uniformly observable plants.

    In the coordinates of the chain, with e the innovation,

        xhat' = A_n xhat + phi^s(u, xhat) - theta Delta_n^-1(theta) G e

    and in the plant's own coordinates xhat' = f(xhat, u) - theta J^-1(xhat) Delta_n^-1(theta) G e, J the Jacobian of
    z = (h, L_f h, ..., L_f^(n-1) h). A_n - G C_n has the given poles; the error decays at theta times their value. A
    larger theta >= 1 is faster, and amplifies the noise in component i by theta^i: choose a filtered observer (fhgo2)
    if that matters.

    An initial error of size 1 in x_1 makes x_i peak like theta^(i-1). ``nested: {M: [M_1, ..., M_(n-1)]}`` bounds
    that: with v_i, which is subtracted in z_i',

        v_1 = theta g_1 e,    v_i = theta (g_i/g_(i-1)) sat_(M_(i-1))(v_(i-1)),

    the linear observer to the last bit as long as |v_i| < M_i. v_i estimates the error of z_(i+1) in the fast limit,
    so M_i is a bound of z_(i+1), in its units and, for plants that are not chains, of the output's derivatives: at
    least twice sup |z_(i+1)|, and not less than the initial error. Peaks then grow like ln(theta) only. While v_i is
    saturated, the error of x_(i+1) is corrected at the speed theta (g_(i+1)/g_i) M_i: a small M is a slow recovery.
    For n = 2 and phi = 0 the error converges to zero from every start, for every M > 0 (V = int_0^e (g_2/g_1) theta
    sat(theta g_1 s) ds + e_2^2/2 does not increase); for n >= 3 that is proved for small errors only, by
    linearisation. In simulations (phi = 0, theta = 5, M = 1, poles -1) no start was found for n = 3 from which it
    does not converge, but for n = 4 from errors above 5 M.

    With sampled or late outputs, e takes into account what the observer has corrected since the sample was taken,
    (3.29). The thesis prints Delta_n(theta) in (3.63), and diag(1, theta) for Delta_2 in (3.141); the inverse of
    (3.29) is right, since with the printed one theta gives no high gain.
    """

    reference = "Robles Magdaleno 2023, (3.20), (3.29), (3.142)"
    key_references = NESTED_FROM

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        _, G = self.chain_gains(form)
        return {"theta": np.array(self.theta), "G": G, **self.nested_limits(form, self.theta, G)}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * nested(plant, e, k))
        return Flow(
            {"xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta)},
            correction=plant.felt(s.xhat, kappa, k.theta),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._rate(form)
