"""The high-gain observer that is homogeneous in two limits."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Number
from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import NotLinear
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.extension import Extendable
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


@observer("homogeneous")
class HomogeneousObserver(NotLinear, Extendable, ConstantGain):
    """High-gain observer of one degree of homogeneity for small errors and another for large ones (bi-limit).

    For uniformly observable plants. Powers of the innovation e take the place of the linear correction: in the
    coordinates of a chain of n it subtracts

        v_i = theta^i g_i w_i,    w_0 = e,    w_i = (|w_(i-1)|^a_i + |w_(i-1)|^b_i) sign(w_(i-1))/2
        a_i = r_(i+1)/r_i at d0, b_i the same at dinf,    r_i(d) = 1 - d (n - i), r_(n+1) = 1 + d

    with degrees -1 < d0 <= 0 <= dinf < 1/(n - 1). d0 < 0 makes small errors vanish in finite time (phi = 0, no
    noise), dinf > 0 brings errors of any size down in a time that does not depend on it; together, a fixed time. With
    d0 = dinf = d and phi = 0 the error e_i(t) from lambda^r_i e_i(0) is lambda^r_i e_i(lambda^d t). d0 = dinf = 0 is
    ``shgo``; d0 = -1 is the discontinuous limit, for which take ``levant``. For n = 2 it is stable for all theta, g >
    0 (phi = 0; V = int_0^e v_2 ds + e_2^2/2, V' = -v_1 v_2); for n >= 3 the publication proves it for gains that are
    large recursively. With the default gains, binomials, random starts of up to 1e3 to 1e4 all converged for n = 3,
    -d0 = dinf = 0.1, 0.2, 0.3 and n = 4, 0.1, which is no proof.

    The innovation is in the units of the output, and errors of 1 are neither small nor large: scale the output. The
    correction has an infinite slope at e = 0 for d0 < 0: explicit steps h leave a ripple of the size h^(1/(1-a_1)),
    and noise is amplified more than by the linear correction of the same theta where it is small, so choose this
    observer for clean outputs and large initial errors. Samples and late outputs come through the common innovation;
    there is no theorem for them. Two powers a state at every evaluation cost time: for a chain of three a run takes
    about five times as long as with ``shgo``, and a member of a sweep nine times (in C, with its library, over ten
    and twenty).
    """

    reference = "Andrieu, Praly, Astolfi 2008, nested form, quoted from memory; the factor 1/2 is our own"

    d0: Number = Field(default=-0.1, gt=-1, le=0, description="degree for small errors, -1 < d0 <= 0")
    dinf: Number = Field(default=0.1, ge=0, description="degree for large errors, 0 <= dinf < 1/(n - 1)")

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        longest = max(form.chains)
        if longest > 1 and not self.dinf < 1 / (longest - 1):
            raise Problem(("dinf",), f"must be below 1/(n - 1) = {1 / (longest - 1):.4g} for n = {longest}")
        _, G = self.chain_gains(form)
        a, b = (np.concatenate([powers(d, n) for n in form.chains]) for d in (self.d0, self.dinf))
        return {"theta": np.array(self.theta), "G": G, "a": a, "b": b}

    @property
    def not_linear(self) -> str | None:
        if self.d0 < 0:
            return "the slope of the correction is infinite where the error is zero (d0 < 0)"
        return "the correction is a power of the innovation"

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        w, place = [], 0
        for i, length in enumerate(plant.chains):
            one = e[i]
            for _ in range(length):
                size = ca.fabs(one)
                one = (size ** k.a[place] + size ** k.b[place]) * ca.sign(one) / 2
                w.append(one)
                place += 1
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * ca.vertcat(*w))
        return Flow(
            {"xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta)},
            correction=plant.felt(s.xhat, kappa, k.theta),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        """That of errors of size 1; smaller and larger ones move faster."""
        return self._rate(form)


def powers(d: float, n: int) -> np.ndarray:
    """r_(i+1)/r_i of a chain of n at degree d, i = 1..n."""
    r = np.append(1 - d * np.arange(n - 1, -1, -1), 1 + d)
    return np.asarray(r[1:] / r[:-1])
