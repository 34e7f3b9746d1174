"""The coordinates in which a constant-gain observer corrects, and the copy of the plant that it runs there.

A chain, x_i' = c_i x_(i+1) + phi_i(u, x_1..x_i) with y = c_0 x_1, is taken as it is but for the units of its
links: z_i = c_0 ... c_(i-1) x_i. Any other model x' = f(x, u), y = h(x) is seen through z = Phi(x) =
(h, L_f0 h, ..., L_f0^(n-1) h) with f0(x) = f(x, 0), the drift with the inputs at zero: the map of Gauthier and
Bornard. With J = dPhi/dx a correction kappa made in z is J(x)^-1 kappa in x (Robles Magdaleno 2023, (3.142)).
With q outputs there is one chain an output. Where outputs measure the same, z has more components than x, and
the correction in x is the one that comes nearest to kappa, in units of the outputs' noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.memo import Memo, same
from hgorun.symbolic.chains import Chain
from hgorun.symbolic.evaluate import at
from hgorun.symbolic.forms import Bounds, saturate
from hgorun.symbolic.matrices import A, inv_Delta
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.ranks import is_regular
from hgorun.symbolic.triangular import blocks_of, superdiagonal

_SINGULAR_START = 1e-12  # of J at the initial estimate
_REGULAR: Memo[bool] = Memo(64)  # the runs of a family often start at the same estimate


@dataclass(frozen=True, eq=False, repr=False)
class CanonicalForm:
    """z = Phi(x): chains of lengths ``chains``, one after the other.

    Attributes
    ----------
    chains : tuple of int
        Length of each output's chain. Their sum is n, or more where outputs measure the same.
    phi_map, jacobian : casadi.SX
        Phi(x, p), shape (sum(chains),), and J = dPhi/dx, shape (sum(chains), n).
    identity : bool
        z = x.
    links : tuple of Chain
        Where the plant is made of chains, the states of each; empty where z are derivatives of the outputs.
    weights : tuple of float
        Of the outputs where they measure the same: one over the standard deviation of the noise.
    holds : callable, optional
        (at, parameters) -> whether other numbers lead to the same coordinates; without it they always do.
    """

    plant: PlantModel
    chains: tuple[int, ...]
    phi_map: ca.SX
    jacobian: ca.SX
    identity: bool
    links: tuple[Chain, ...] = ()
    weights: tuple[float, ...] = ()
    holds: Callable[[np.ndarray, np.ndarray], bool] | None = field(default=None, compare=False, repr=False)

    @property
    def map(self) -> Literal["chain", "derivatives"]:
        """Whether z are the plant's own states, but for their units, or derivatives of its outputs."""
        return "chain" if self.identity or self.links else "derivatives"

    @property
    def taken(self) -> dict[str, int]:
        """The outputs with the lengths of their chains."""
        return dict(zip(self.plant.outputs, self.chains, strict=True))

    @property
    def square(self) -> bool:
        """Whether z has as many components as x."""
        return sum(self.chains) == self.plant.n

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
        """J as numbers, shape (sum(chains), n)."""
        return at(self._jacobian, x, parameters)[0].reshape(-1, self.plant.n)

    @property
    def invertible(self) -> bool:
        """Whether x is known as a function of z."""
        return self.no_inverse is None

    @property
    def no_inverse(self) -> str | None:
        """Why x is not known as a function of z; None where it is."""
        if not self.square:
            return "there are more chain components than states"
        if not (self.identity or self.links or self.plant.inverse is not None):
            return "this plant gives no inverse of its canonical map"
        return None

    def inverse(self, z: ca.SX, p: ca.SX) -> ca.SX:
        """x of z, where it is :attr:`invertible`."""
        if self.identity:
            return z
        if self.links:
            return ca.substitute(self._along_states(z), self.plant.p, p)
        assert self.plant.inverse is not None
        return self.plant.inverse(z, p)

    def lift(self, x: ca.SX, p: ca.SX, kappa: ca.SX, theta: ca.SX | float) -> ca.SX:
        """J(x)^-1 kappa; with more rows than states the least squares, rows in units of theta and the noise."""
        if self.identity:
            return kappa
        if self.square and self.links:
            return ca.substitute(self._along_states(kappa), self.plant.p, p)
        J = self.J(x, p)
        if self.square:
            return ca.solve(J, kappa)
        units = [
            weight * unit
            for weight, length in zip(self.weights, self.chains, strict=True)
            for unit in ca.vertsplit(ca.diag(inv_Delta(1 / ca.SX(theta), length)))
        ]
        W = ca.diag(ca.vertcat(*units))
        return ca.solve((W @ J).T @ (W @ J), (W @ J).T @ (W @ kappa))

    def _along_states(self, z: ca.SX) -> ca.SX:
        """x_(state i) = z_i / scale_i: the links undone, in the plant's own parameters."""
        x, first = [ca.SX(0)] * self.plant.n, 0
        for chain in self.links:
            for k, (state, scale) in enumerate(zip(chain.states, chain.scales, strict=True)):
                x[state] = z[first + k] / scale
            first += len(chain.states)
        return ca.vertcat(*x)

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
        """The initial estimate in the observer's coordinates; ValueError where J is singular or not finite."""
        if canonical and self.no_inverse is not None:
            raise ValueError(self.no_inverse)
        key = same(self), x.tobytes(), parameters.tobytes()
        if not _REGULAR.get(key, lambda: is_regular(self.jacobian_at(x, parameters), _SINGULAR_START)):
            where = ", ".join(f"{s} = {v:g}" for s, v in zip(self.plant.states, x, strict=True))
            what = "singular" if np.all(np.isfinite(self.jacobian_at(x, parameters))) else "not finite"
            raise ValueError(f"the Jacobian of the observability map is {what} at the initial estimate ({where})")
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


@dataclass(frozen=True, eq=False, repr=False)
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

    def earlier(self, lag: ca.SX) -> PlantCopy:
        """The plant as it was some time before: its inputs must be functions of time."""
        t = self.t - lag
        return replace(self, t=t, u=ca.substitute(self.u, self.t, t))

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
            return self.form.lift(x, self.p, self.form.shift @ (self.form.J(x, self.p) @ excess), 1.0)
        return superdiagonal(self.form.plant, block)(self.t, x, self.u, self.p) @ excess

    @property
    def C(self) -> ca.DM:
        """y = C z, shape (q, sum(chains))."""
        return ca.DM(np.eye(sum(self.chains))[self.form.heads])

    def links(self, xhat: ca.SX) -> ca.DM:
        """A of the chains, block-diagonal: what leads in z' from each component to the next."""
        return self.form.shift

    def inv_Delta(self, theta: ca.SX) -> ca.SX:
        """Delta^-1(theta) of every chain, block-diagonal, shape (n, n)."""
        return ca.diagcat(*[inv_Delta(theta, k) for k in self.chains])

    def along_chains(self, signal: ca.SX) -> ca.SX:
        """One number an output (q,), repeated along the output's chain (n,)."""
        return ca.vertcat(*[signal[i] for i, k in enumerate(self.chains) for _ in range(k)])

    def at_ends(self, signal: ca.SX) -> ca.SX:
        """One number an output (q,), at the end of the output's chain and zero before it (n,)."""
        return ca.vertcat(*[part for i, k in enumerate(self.chains) for part in (ca.SX.zeros(k - 1), signal[i])])

    def heads(self, z: ca.SX) -> ca.SX:
        """The first component of every chain, shape (q,)."""
        return ca.vertcat(*[z[i] for i in self.form.heads])

    def lift(self, xhat: ca.SX, kappa: ca.SX, theta: ca.SX | float = 1.0) -> ca.SX:
        """J(x)^-1 kappa: a correction made in z, in the coordinates of the estimate.

        Parameters
        ----------
        theta : casadi.SX or float
            Where outputs measure the same, the component i of a chain counts in units of theta^(i-1).
        """
        return kappa if self.canonical else self.form.lift(xhat, self.p, kappa, theta)

    def felt(self, xhat: ca.SX, kappa: ca.SX, theta: ca.SX | float = 1.0) -> ca.SX:
        """What a correction made in z takes from the derivative of each output, shape (q,)."""
        if self.form.square:
            return self.heads(kappa)
        return ca.jtimes(self.output(xhat), xhat, self.lift(xhat, kappa, theta))

    def output(self, xhat: ca.SX) -> ca.SX:
        """C xhat, the outputs of the estimate, shape (q,)."""
        return self.form.plant.h(self.t, self.state(xhat), self.u, self.p)

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        return self.form.inverse(xhat, self.p) if self.canonical else xhat

    def _saturated(self, x: ca.SX) -> ca.SX:
        return saturate(x, self.form.plant.states, self.bounds)
