"""A plant that a controller drives: with what an observer estimates of it, or with its true state."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.engine.layout import Held
from hgorun.errors import Problem
from hgorun.memo import same
from hgorun.plants.build import BuiltPlant, SymbolicPlant
from hgorun.plants.control import ControlLaw
from hgorun.simulation.system.truth import Placed, PlantNumbers, Seen
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True, eq=False, repr=False)
class LoopStates:
    """Where the states of a driven plant lie among each other.

    The plant's own come first, then the integrals, the inputs that are held between instants, the inputs as they were
    at the sample before, the integral of u^2 of every input, and the cost.

    Attributes
    ----------
    n, integrals, held, kept, inputs : int
    costs : bool
    """

    n: int
    integrals: int
    held: int
    kept: int
    inputs: int
    costs: bool

    @classmethod
    def of(cls, plant: PlantModel, law: ControlLaw, *, keeps: bool) -> LoopStates:
        driven = len(law.driven)
        held, kept = driven if law.held else 0, driven if keeps else 0
        return cls(plant.n, len(law.integral), held, kept, len(plant.inputs), law.cost is not None)

    @property
    def integral(self) -> slice:
        """The controller's integrals."""
        return slice(self.n, self.n + self.integrals)

    @property
    def driven(self) -> slice:
        """The inputs as they are held."""
        return slice(self.integral.stop, self.integral.stop + self.held)

    @property
    def before(self) -> slice:
        """The inputs at the sample before."""
        return slice(self.driven.stop, self.driven.stop + self.kept)

    @property
    def effort(self) -> slice:
        """The integrals of u^2."""
        return slice(self.before.stop, self.before.stop + self.inputs)

    @property
    def cost(self) -> slice:
        """The cost so far, where there is one."""
        return slice(self.effort.stop, self.effort.stop + int(self.costs))

    @property
    def size(self) -> int:
        """Number of all of them."""
        return int(self.cost.stop)


@dataclass(frozen=True, eq=False, repr=False)
class DrivenPlant:
    """The plant's own equations, with its disturbance, and the controller that drives it.

    Attributes
    ----------
    keeps : bool
        Whether the inputs at the sample before are kept, for observers that step from sample to sample.
    """

    plant: SymbolicPlant
    keeps: bool = False
    recorded_inputs: int = 0

    @property
    def law(self) -> ControlLaw:
        """The controller."""
        assert self.plant.controller is not None
        return self.plant.controller

    @property
    def untimed(self) -> tuple[int, ...]:
        return self.law.driven

    @property
    def states(self) -> LoopStates:
        """Where its states lie."""
        return LoopStates.of(self.plant.model, self.law, keeps=self.keeps)

    @property
    def size(self) -> int:
        return self.states.size

    @property
    def structure(self) -> Hashable:
        return type(self), same(self.plant), self.keeps

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        """The plant's initial state; integrals, effort and cost begin at zero."""
        return np.concatenate([plant.initial, np.zeros(self.size - self.plant.model.n)])

    def place(self, t: ca.SX, x: ca.SX, p: PlantNumbers, w: ca.SX, held: Held, seen: Seen | None = None) -> Placed:
        """Its equations; without an observer the controller gets the true state.

        Raises
        ------
        Problem
            Where the law would decide the input from an estimate that depends on the input.
        """
        model, law, places = self.plant.model, self.law, self.states
        state, everything = x[: model.n], p.everything
        given = p.of(self.plant, self.plant.inputs)
        before = _with(given, law, x[places.driven] if law.held else ca.SX.zeros(len(law.driven)))
        if seen is None:
            known, own = state, law.truth(t, state, before, everything)
        else:
            known = self._estimate(t, before, given, p, seen)
            own = ca.vertcat(ca.SX(0, 1), *[seen.own(name) for name in law.own])
        wanted, integrand = law.law(t, known, before, x[places.integral], own, everything)
        u = before if law.held else _with(given, law, wanted)
        rates = [
            model.f(t, state, u, p.parameters) + p.of(self.plant, self.plant.disturbance),
            integrand,
            ca.SX.zeros(places.held + places.kept),
            u**2,
        ]
        if law.cost is not None:
            rates.append(law.cost(t, state, u, everything))
        return Placed(
            u=u,
            u_before=_with(_before(given, t, w[held.interval]), law, x[places.before]) if self.keeps else u,
            y=model.h(t, state, u, p.parameters),
            rate=ca.vertcat(*rates),
            acted=(places.driven.start, wanted) if law.held else None,
            kept=(places.before.start, u[list(law.driven)]) if self.keeps else None,
        )

    def _estimate(self, t: ca.SX, before: ca.SX, given: ca.SX, p: PlantNumbers, seen: Seen) -> ca.SX:
        """The estimate, which must not depend on what is only decided with it."""
        law = self.law
        if law.held:
            return seen.estimate(t, before, p.parameters)
        unknown = ca.SX.sym("u", len(law.driven))
        found = seen.estimate(t, _with(given, law, unknown), p.parameters)
        if ca.depends_on(found, unknown):
            raise Problem(
                ("observers", seen.block.label),
                "what it estimates depends on the input itself, which the controller decides from the estimate: "
                "give controller.period, so that the input is known when it acts",
            )
        return found


def _before(u: ca.SX, t: ca.SX, interval: ca.SX) -> ca.SX:
    """Inputs that are expressions of time at the sample before."""
    return ca.substitute(u, t, t - interval)


def _with(u: ca.SX, law: ControlLaw, driven: ca.SX) -> ca.SX:
    """All inputs, with values for those that are driven."""
    found = ca.SX(u)
    for i, place in enumerate(law.driven):
        found[place] = driven[i]
    return found
