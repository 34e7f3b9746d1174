"""The high-gain observer that converges within a prescribed time."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Number, Poles, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, Role, observer
from hgorun.observers.capabilities import Punctual
from hgorun.observers.extension import Extendable
from hgorun.observers.uneven import refuse_of_uneven_chains
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


@observer("prescribed_time")
class PrescribedTimeObserver(Punctual, Extendable):
    """High-gain observer whose gain grows so that the error vanishes at a prescribed time T.

    For uniformly observable plants. In the coordinates of the chain it subtracts

        v_i = g_i mu(t)^i e,    mu = T/(T - t), t from the start, held when it has reached mu_max

    With tau = T ln(mu) and eps_i = e_i/mu^(i-1) the error of integrators (phi = 0) obeys d eps/d tau = (A - G C -
    diag(0, .., n-1)/T) eps exactly. G gives that matrix the poles -l_i: n = 2, T = 2, poles at -3: (5.5, 6.25); n =
    3: (7.5, 15.25, 8). e_i ~ mu^(i-1-l T), so that l T > n - 1 is needed. With phi not zero its slopes have to be
    small against mu, which they are in the end; the error left at mu_max is that of the last factor. From then on it
    is ``shgo`` with theta = mu_max, and so is its noise: choose mu_max as small as the accuracy allows, or this
    observer only for the start. Samples come through the common innovation as long as mu_max times the period is
    inside the limits of ``shgo``, for which there is no theorem; late outputs are refused, since the growing gain is
    unstable with them. Explicit steps h have to keep h mu_max |pole of A - G C| < 2.7.
    """

    because = "its growing gain is unstable with any delay"

    reference = "in the spirit of Holloway, Krstic 2019; derived anew"

    T: Positive = Field(description="time in which the error vanishes, T > 0, from the start")
    poles: Poles | None = Field(
        default=None,
        description="eigenvalues of A - G C - diag(0..n-1)/T, per time: a number (for all) or a list of n, real part < "
        "-(n-1)/T; -(n+1)/T by default",
    )
    mu_max: Number = Field(default=50.0, gt=1, description="largest factor of the gain, mu_max > 1")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"T": 2.0, "mu_max": 5.0}

    def gain(self, n: int) -> np.ndarray:
        """G of a chain of n, shape (n,).

        prod_i (s + d_i) + sum_i g_i prod_(j>i) (s + d_j) with d_i = (i - 1)/T has the given roots.
        """
        d = np.arange(n) / self.T
        if isinstance(self.poles, tuple) and len(self.poles) != n:
            raise Problem(("poles",), f"expected {n} numbers, or one number for all; found {len(self.poles)}")
        default = complex(-(n + 1) / self.T)
        roots = np.resize(np.atleast_1d(np.asarray(default if self.poles is None else self.poles)), n)
        if not np.all(roots.real < -d[-1]):
            raise Problem(("poles",), f"their real parts must be below -(n - 1)/T = {-d[-1]:.4g} for n = {n}")
        rest = np.real(np.poly(roots)) - np.poly(-d)
        G = np.zeros(n)
        for i in range(n):
            G[i] = rest[i + 1]
            rest[i + 1 :] -= G[i] * np.poly(-d[i + 1 :])
        return G

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        refuse_of_uneven_chains("poles", self.poles, form, form.chains, "write one number for all")
        G = np.concatenate([self.gain(length) for length in form.chains])
        return {"T": np.array(self.T), "mu_max": np.array(self.mu_max), "G": G}

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray]:
        return {"age": np.array(0.0)}

    def roles(self, form: CanonicalForm) -> dict[str, Role]:
        return {"age": "gain"}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        mu = k.T / ca.fmax(k.T - s.age, k.T / k.mu_max)
        kappa = mu * plant.inv_Delta(mu) @ (k.G * plant.along_chains(e))
        return Flow(
            {"xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, mu), "age": ca.SX(1)},
            correction=plant.felt(s.xhat, kappa, mu),
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        """At mu_max."""
        roots = [np.roots([1.0, *self.gain(length)]) for length in form.chains]
        return self.mu_max * max(float(np.max(np.abs(r))) for r in roots)
