"""Plants with unknown inputs: chains, or blocks of a triangular model, that go on with integrators behind the plant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeGuard

import casadi as ca
import numpy as np

from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.forms import Form
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm


class LongerForm(CanonicalForm):
    """Chains that go on with the states of unknown inputs."""


class LongerBlocks(TriangularForm):
    """A triangular model that goes on with m blocks as large as its last one, F = I: the states of unknown inputs."""


def unknown_inputs(form: Form) -> int:
    """How many there are: one at the end of every chain, or one for every state of the last block."""
    if isinstance(form, TriangularForm):
        return len(_last(form))
    assert isinstance(form, CanonicalForm)
    return len(form.chains)


def longer(form: Form, m: int) -> LongerForm | LongerBlocks:
    """The form of the plant with m integrators behind it for each unknown input; their states stand behind the plant's.

    Those of one unknown input stand together. Where the plant is made of chains the model is there for its size and
    names: what the equations ask for is what :class:`LongerCopy` says.
    """
    if isinstance(form, LongerForm | LongerBlocks):
        return form
    if isinstance(form, TriangularForm):
        return _longer_blocks(form, m)
    assert isinstance(form, CanonicalForm)
    sigma = ca.SX.sym("sigma", m * len(form.chains))
    model = _with_integrators(form.plant, sigma, ca.SX.zeros(sigma.numel()), ca.SX.zeros(form.plant.n))
    phi = interleaved(ca.vertsplit(form.phi_map), ca.vertsplit(sigma), form.chains, m)
    identity = form.identity and len(form.chains) == 1
    return LongerForm(model, tuple(n + m for n in form.chains), phi, ca.jacobian(phi, model.x), identity)


def interleaved(of_plant: list[ca.SX], added: list[ca.SX], chains: tuple[int, ...], m: int) -> ca.SX:
    """The components of every chain, and behind them those that were added to it."""
    parts, first = [], 0
    for i, n in enumerate(chains):
        parts += [*of_plant[first : first + n], *added[i * m : (i + 1) * m]]
        first += n
    return ca.vertcat(*parts)


def _longer_blocks(form: TriangularForm, m: int) -> LongerBlocks:
    """x_i' = f_i + sigma_1 in the last block, sigma_1' = sigma_2, ..., sigma_m' = 0."""
    last, top = _last(form), max(form.block)
    sigma = ca.SX.sym("sigma", m, len(last))
    entering = ca.SX.zeros(form.n)
    entering[last] = sigma[0, :].T
    shifted = ca.vertcat(sigma[1:, :], ca.SX.zeros(1, len(last)))
    model = _with_integrators(form.model, ca.vec(sigma), ca.vec(shifted), entering)
    block = (*form.block, *(top + 1 + i for _ in last for i in range(m)))
    plant = form.plant if form.plant.transform is not None else model
    return LongerBlocks(plant, model, block, form.measured)


def _last(form: TriangularForm) -> list[int]:
    """The states of the last block."""
    return np.flatnonzero(np.array(form.block) == max(form.block)).tolist()


def _with_integrators(plant: PlantModel, sigma: ca.SX, rates: ca.SX, entering: ca.SX) -> PlantModel:
    """The plant with more states."""
    return replace(
        plant,
        states=(*plant.states, *(f"sigma_{i + 1}" for i in range(sigma.numel()))),
        x=ca.vertcat(plant.x, sigma),
        dynamics=ca.vertcat(plant.dynamics + entering, rates),
    )


def longer_copy(plant: PlantCopy | TriangularCopy, m: int) -> LongerCopy | LongerTriangularCopy:
    """The copy of the plant with m integrators behind it for each unknown input."""
    form = longer(plant.form, m)
    if isinstance(plant, TriangularCopy):
        assert isinstance(form, LongerBlocks)
        return LongerTriangularCopy(form, plant.t, plant.u, plant.p, plant.bounds, own=plant)
    assert isinstance(form, LongerForm)
    return LongerCopy(form, plant.t, plant.u, plant.p, plant.canonical, plant.bounds, own=plant, added=m)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LongerCopy(PlantCopy):
    """A copy of a plant whose chains go on with m states each, behind those of the plant.

    Attributes
    ----------
    own : PlantCopy
        The copy of the plant itself.
    added : int
        m.
    """

    own: PlantCopy
    added: int

    def earlier(self, lag: ca.SX) -> LongerCopy:
        own = self.own.earlier(lag)
        return replace(self, t=own.t, u=own.u, own=own)

    def copy(self, xhat: ca.SX) -> ca.SX:
        x, sigma = self._split(xhat)
        entering = self.own.at_ends(ca.vertcat(*[one[0] for one in sigma]))
        shifted = [ca.vertcat(*ca.vertsplit(one)[1:], 0) for one in sigma]
        return ca.vertcat(self.own.copy(x) + self.own.lift(x, entering), *shifted)

    def lift(self, xhat: ca.SX, kappa: ca.SX, theta: ca.SX | float = 1.0) -> ca.SX:
        of_plant, added, first = [], [], 0
        for n in self.own.chains:
            of_plant.append(kappa[first : first + n])
            added.append(kappa[first + n : first + n + self.added])
            first += n + self.added
        x, _ = self._split(xhat)
        return ca.vertcat(self.own.lift(x, ca.vertcat(*of_plant), theta), *added)

    def output(self, xhat: ca.SX) -> ca.SX:
        return self.own.output(self._split(xhat)[0])

    def state(self, xhat: ca.SX) -> ca.SX:
        x, sigma = self._split(xhat)
        return ca.vertcat(self.own.state(x), *sigma)

    def _split(self, xhat: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
        """The plant's estimate, and what belongs to each output's unknown input."""
        n, m = self.own.n, self.added
        return xhat[:n], [xhat[n + i * m : n + (i + 1) * m] for i in range(len(self.own.chains))]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LongerTriangularCopy(TriangularCopy):
    """A copy of a triangular model that goes on with the states of unknown inputs.

    Attributes
    ----------
    own : TriangularCopy
        The copy of the plant itself.
    """

    own: TriangularCopy

    def state(self, xhat: ca.SX) -> ca.SX:
        n = self.own.n
        return ca.vertcat(self.own.state(xhat[:n]), xhat[n:])


def has_unknown_inputs(form: Form) -> TypeGuard[CanonicalForm | TriangularForm]:
    """Whether it is known where unknown inputs enter: outputs that measure the same have one between them."""
    return isinstance(form, TriangularForm) or (isinstance(form, CanonicalForm) and form.square)
