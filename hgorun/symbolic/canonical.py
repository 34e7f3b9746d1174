"""The coordinates in which a constant-gain observer corrects, and the copy of the plant that it runs there.

A chain, x_i' = x_{i+1} + phi_i(u, x_1..x_i) with y = x_1, is taken as it is. Any other model
x' = f(x, u), y = h(x) is seen through z = Phi(x) = (h, L_f0 h, ..., L_f0^(n-1) h) with
f0(x) = f(x, 0), the drift with the inputs at zero: the map of Gauthier and Bornard. With J = dPhi/dx a
correction kappa made in z is J(x)^-1 kappa in x (Robles Magdaleno 2023, (3.142)). With q outputs there is
one chain an output.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic.evaluate import at
from hgorun.symbolic.forms import Bounds, saturate
from hgorun.symbolic.matrices import A, inv_Delta
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.triangular import blocks_of, superdiagonal


def singular_value_ratio(jacobian: np.ndarray) -> float:
    """Smallest over largest singular value after scaling rows and columns to one; 0 when singular."""
    if not np.all(np.isfinite(jacobian)):
        return float("nan")
    rows = np.linalg.norm(jacobian, axis=1)
    if np.any(rows == 0):
        return 0.0
    scaled = jacobian / rows[:, None]
    columns = np.linalg.norm(scaled, axis=0)
    if np.any(columns == 0):
        return 0.0
    values = np.linalg.svd(scaled / columns, compute_uv=False)
    return float(values[-1] / values[0])


@dataclass(frozen=True)
class CanonicalForm:
    """z = Phi(x): chains of lengths ``chains`` (their sum is n), one after the other.

    Attributes
    ----------
    chains : tuple of int
        Length of each output's chain.
    phi_map, jacobian : casadi.SX
        Phi(x, p), shape (n,), and J = dPhi/dx, shape (n, n).
    identity : bool
        The plant is a chain already: z = x.
    holds : callable, optional
        (at, parameters) -> whether other numbers lead to the same coordinates; without it they always do.
    """

    plant: PlantModel
    chains: tuple[int, ...]
    phi_map: ca.SX
    jacobian: ca.SX
    identity: bool
    holds: Callable[[np.ndarray, np.ndarray], bool] | None = field(default=None, compare=False, repr=False)

    @cached_property
    def _phi(self) -> ca.Function:
        return ca.Function("Phi", [self.plant.x, self.plant.p], [self.phi_map])

    @cached_property
    def _jacobian(self) -> ca.Function:
        return ca.Function("J", [self.plant.x, self.plant.p], [self.jacobian])

    def Phi(self, x: ca.SX, p: ca.SX) -> ca.SX:
        """The map at another point."""
        return self._phi(x, p)

    def J(self, x: ca.SX, p: ca.SX) -> ca.SX:
        """The Jacobian at another point."""
        return self._jacobian(x, p)

    def jacobian_at(self, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """J as numbers, shape (n, n)."""
        return at(self._jacobian, x, parameters)[0].reshape(self.plant.n, self.plant.n)

    def again(self, at: np.ndarray, parameters: np.ndarray) -> CanonicalForm | None:
        """Itself, where other numbers lead to the same coordinates."""
        return self if self.holds is None or self.holds(at, parameters) else None

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        """The plant's states, in whichever coordinates the observer computes."""
        return self.plant.states

    def coordinates(self, canonical: bool) -> ca.SX:
        """z = Phi(x), or x."""
        return self.phi_map if canonical and not self.identity else self.plant.x

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        """The initial estimate in the observer's coordinates; ValueError where J is singular."""
        if canonical and not self.identity and self.plant.inverse is None:
            raise ValueError("this plant gives no inverse of its canonical map; use coordinates: original")
        if not singular_value_ratio(self.jacobian_at(x, parameters)) > 1e-12:
            where = ", ".join(f"{s} = {v:g}" for s, v in zip(self.plant.states, x, strict=True))
            raise ValueError(f"the Jacobian of the observability map is singular at the initial estimate ({where})")
        return at(self._phi, x, parameters)[0] if canonical else x

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> PlantCopy:
        """The copy of the plant that an observer runs."""
        return PlantCopy(self, t, u, p, canonical, bounds)

    @property
    def heads(self) -> list[int]:
        """Where in z each output's chain starts."""
        return [sum(self.chains[:i]) for i in range(len(self.chains))]

    @property
    def shift(self) -> ca.DM:
        """The block-diagonal anti-shift matrix of the chains."""
        return ca.diagcat(*[A(k) for k in self.chains])


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

        With sat the clipped estimate this is f(sat) + F(sat) (x - sat): the x that multiplies F is not
        saturated, the arguments of F and phi are. F is what leads in df/dx from one block of states to the
        next, counted from the measured ones; where no state is measured itself, the chain seen through J.
        """
        plant = self.form.plant
        if self.canonical:
            x = self._saturated(self.state(xhat))
            z = self.form.Phi(x, self.p) if self.bounds else xhat
            flow = self.form.J(x, self.p) @ plant.f(self.t, x, self.u, self.p)
            return flow + self.form.shift @ (xhat - z) if self.bounds else flow
        clipped = self._saturated(xhat)
        f = plant.f(self.t, clipped, self.u, self.p)
        return f + self._links(clipped, xhat - clipped) if self.bounds else f

    def _links(self, x: ca.SX, excess: ca.SX) -> ca.SX:
        """F(x) times what saturation has cut off."""
        try:
            block, _ = blocks_of(self.form.plant)
        except NotObservableForm:
            J = self.form.J(x, self.p)
            return ca.solve(J, self.form.shift @ (J @ excess))
        return superdiagonal(self.form.plant, block)(self.t, x, self.u, self.p) @ excess

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
        return saturate(x, self.form.plant.states, self.bounds)
