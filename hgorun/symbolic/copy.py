"""The copy of the plant that an observer runs, in the coordinates where it computes."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Bounds
from hgorun.symbolic.matrices import inv_Delta


@dataclass(frozen=True)
class PlantCopy:
    """f, J and h at the estimate, without the disturbance.

    Attributes
    ----------
    form : CanonicalForm
    t, u, p : casadi.SX
        Time, the inputs' values at t, the parameters.
    canonical : bool
        Whether the estimate is z = Phi(x) instead of x.
    bounds : mapping of str to (low, high)
        Saturation of the plant's states in the arguments of F and phi (Robles Magdaleno 2023, (3.12)).
    """

    form: CanonicalForm
    t: ca.SX
    u: ca.SX
    p: ca.SX
    canonical: bool = False
    bounds: Bounds = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of states."""
        return self.form.plant.n

    @property
    def chains(self) -> tuple[int, ...]:
        """Length of each output's chain."""
        return self.form.chains

    def copy(self, xhat: ca.SX) -> ca.SX:
        """The plant's vector field at the estimate: F x + phi(u, sat x).

        With sat the clipped estimate this is f(sat) + F(sat) (x - sat), F being the superdiagonal of
        df/dx: the x that multiplies F is not saturated, the arguments of F and phi are.
        """
        plant = self.form.plant
        if not self.canonical:
            f = plant.f(self.t, self._saturated(xhat), self.u, self.p)
            if not self.bounds:
                return f
            clipped = self._saturated(xhat)
            return f + self._superdiagonal(clipped) * ca.vertcat((xhat - clipped)[1:], 0)
        x = self._saturated(self.state(xhat))
        z = self.form.Phi(x, self.p) if self.bounds else xhat
        flow = self.form.J(x, self.p) @ plant.f(self.t, x, self.u, self.p)
        return flow + self.form.shift @ (xhat - z) if self.bounds else flow

    def inv_Delta(self, theta: ca.SX) -> ca.SX:
        """Delta^-1(theta) of every chain, block-diagonal, shape (n, n)."""
        return ca.diagcat(*[inv_Delta(theta, k) for k in self.chains])

    def along_chains(self, signal: ca.SX) -> ca.SX:
        """One number an output (q,), repeated along the output's chain (n,)."""
        return ca.vertcat(*[signal[i] for i, k in enumerate(self.chains) for _ in range(k)])

    def heads(self, z: ca.SX) -> ca.SX:
        """The first component of every chain, shape (q,)."""
        return ca.vertcat(*[z[i] for i in self.form.heads])

    def lift(self, xhat: ca.SX, kappa: ca.SX) -> ca.SX:
        """J(x)^-1 kappa: a correction made in z, in the coordinates of the estimate."""
        if self.canonical or self.form.identity:
            return kappa
        return ca.solve(self.form.J(xhat, self.p), kappa)

    def output(self, xhat: ca.SX) -> ca.SX:
        """C xhat, the outputs of the estimate, shape (q,)."""
        return self.form.plant.h(self.t, self.state(xhat), self.u, self.p)

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        if not self.canonical or self.form.identity:
            return xhat
        assert self.form.plant.inverse is not None
        return self.form.plant.inverse(xhat, self.p)

    def _saturated(self, x: ca.SX) -> ca.SX:
        parts = [x[i] for i in range(self.n)]
        for name, (low, high) in self.bounds.items():
            i = self.form.plant.states.index(name)
            parts[i] = ca.fmax(low, ca.fmin(high, parts[i]))
        return ca.vertcat(*parts)

    def _superdiagonal(self, x: ca.SX) -> ca.SX:
        plant = self.form.plant
        jacobian = ca.jacobian(plant.dynamics, plant.x)
        entries = ca.vertcat(*[jacobian[i, i + 1] for i in range(self.n - 1)], 0)
        return ca.Function("F", [plant.t, plant.x, plant.u, plant.p], [ca.densify(entries)])(self.t, x, self.u, self.p)
