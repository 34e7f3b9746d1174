"""Observers of chains that estimate an unknown input at the end of every chain as well: the key ``extend``.

The last equation of a chain has an unknown term, z_n' = phi_n + d(t). With ``extend: m`` the chain that an observer is
for goes on with m integrators, z_(n+1) = sigma_1 for d, sigma_1' = sigma_2, ..., sigma_m' = 0: in the plant's own
coordinates x' = f(u, x) + J^-1 B sigma_1. Whatever the observer does along a chain of n, it does along this one of
n + m, and its gains are of that order. ``extended`` is ``shgo`` with this key.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import new_class
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import Field, ModelWrapValidatorHandler, model_validator

from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver, DecidedObserver, Flow, Role
from hgorun.observers.capabilities import LocallyLinear
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


class Extendable(ContinuousObserver):
    """The key ``extend`` of an observer that takes a plant as chains, of whatever length."""

    extend: int | None = Field(
        default=None,
        ge=1,
        le=10,
        strict=True,
        description="m >= 1: an unknown input at the end of every chain is estimated, too, by m integrators sigma; "
        "poles and gains are those of chains that are longer by m",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _extended(cls, data: Any, check: ModelWrapValidatorHandler[Extendable]) -> Extendable:
        """A block with ``extend`` is an observer with more states."""
        found = check(data)
        if found.extend is None or isinstance(found, Extension):
            return found
        family = extending(type(found))
        return family.model_construct(found.model_fields_set, **dict(found))


@cache
def extending(family: type[Extendable]) -> type[Extension]:
    """An observer's class with unknown inputs."""
    base = DecidedExtension if issubclass(family, DecidedObserver) else Extension
    own = {"__doc__": family.__doc__, "__module__": family.__module__, "family": family}
    return new_class(f"Extended{family.__name__}", (base, family), exec_body=lambda names: names.update(own))


class Extension(Extendable):
    """An observer of longer chains, whose last states are those of unknown inputs."""

    family: ClassVar[type[Extendable]]
    """Whose equations these are, for the longer chains."""

    @property
    def added(self) -> int:
        """m."""
        assert self.extend is not None
        return self.extend

    def design(self, form: CanonicalForm) -> Mapping[str, np.ndarray]:
        if not form.square:
            raise Problem(
                ("extend",),
                "outputs that measure the same have one unknown input between them, and this observer has one for "
                "each: leave out the outputs that are not needed",
            )
        return self.family.design(self, longer(form, self.added))

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        own = self.family.states(self, longer(form, self.added))
        return {**own, "sigma": np.zeros((self.added, len(form.chains)))}

    def roles(self, form: CanonicalForm) -> Mapping[str, Role]:
        return {**self.family.roles(self, form), "sigma": "filter"}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = self.family.equations(self, self._copy(plant), self._whole(s), e, k)
        return Flow({**flow.derivatives, **self._parts(flow.derivatives["xhat"], s)}, flow.correction)

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return self.family.estimate(self, self._whole(s), k)[: s.xhat.numel()]

    def beyond(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        """Of families that are :class:`LocallyLinear`."""
        assert isinstance(self, LocallyLinear)
        assert issubclass(self.family, LocallyLinear)
        return self.family.beyond(self, self._copy(plant), self._whole(s), e, k)

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self.family.fastest_rate(self, longer(form, self.added))

    def error_rate(self, form: CanonicalForm) -> float:
        return self.family.error_rate(self, longer(form, self.added))

    def remarks(self, form: CanonicalForm) -> tuple[str, ...]:
        return self.family.remarks(self, longer(form, self.added))

    def _copy(self, plant: PlantCopy) -> LongerCopy:
        """The plant with the longer chains."""
        form = longer(plant.form, self.added)
        same = plant.t, plant.u, plant.p, plant.canonical, plant.bounds
        return LongerCopy(form, *same, own=plant, added=self.added)

    def _whole(self, s: Symbols) -> Symbols:
        """The states, with sigma behind xhat: output by output."""
        return Symbols(vars(s) | {"xhat": ca.vertcat(s.xhat, ca.vec(s.sigma))})

    def _parts(self, value: ca.SX, s: Symbols) -> dict[str, ca.SX]:
        """Of xhat and of sigma, from both together."""
        n = s.xhat.numel()
        return {"xhat": value[:n], "sigma": ca.reshape(value[n:], *s.sigma.shape)}


class DecidedExtension(Extension, DecidedObserver):
    """One that also decides."""

    def decide(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        assert issubclass(self.family, DecidedObserver)
        new = dict(self.family.decide(self, self._copy(plant), self._whole(s), e, k))
        return {**new, **self._parts(new["xhat"], s)} if "xhat" in new else new


class LongerForm(CanonicalForm):
    """Chains that go on with the states of unknown inputs."""


def longer(form: CanonicalForm, m: int) -> LongerForm:
    """The form of the plant with m integrators at the end of every chain.

    Their states stand behind the plant's, output by output. The model is there for its size and names: what the
    equations ask for is what :class:`LongerCopy` says.
    """
    if isinstance(form, LongerForm):
        return form
    plant, count = form.plant, m * len(form.chains)
    sigma = ca.SX.sym("sigma", count)
    model = replace(
        plant,
        states=(*plant.states, *(f"sigma_{i + 1}" for i in range(count))),
        x=ca.vertcat(plant.x, sigma),
        dynamics=ca.vertcat(plant.dynamics, ca.SX.zeros(count)),
    )
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
