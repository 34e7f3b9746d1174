"""Where the outputs that the observers see come from: a simulated plant, or what was recorded of a real one."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from hgorun.engine.layout import Held
from hgorun.memo import same
from hgorun.plants.build import BuiltPlant, SymbolicPlant
from hgorun.simulation.system.observer_block import ObserverBlock


@dataclass(frozen=True, eq=False, repr=False)
class PlantNumbers:
    """Symbols for the plant's parameters, and for the numbers in the expressions of inputs, disturbance and law."""

    parameters: ca.SX
    numbers: ca.SX

    def of(self, plant: SymbolicPlant, expression: ca.SX) -> ca.SX:
        """An expression of the plant's own symbols in these."""
        return ca.substitute(expression, plant.everything, self.everything)

    @property
    def everything(self) -> ca.SX:
        """All of them."""
        return ca.vertcat(self.parameters, self.numbers)


@dataclass(frozen=True, eq=False, repr=False)
class Placed:
    """A truth as a part of the system.

    Attributes
    ----------
    u, u_before : casadi.SX, shape (m,)
        The inputs at t, and those at the sample before.
    y : casadi.SX, shape (q,)
        The noise-free outputs, as functions of its states; zero where they are recorded.
    rate : casadi.SX, shape (size,)
        The derivative of its states.
    step : casadi.SX or None
        What its states become at a sample, where they are stepped.
    acted : (int, casadi.SX) or None
        What some of its states become when a controller acts, and the first of them.
    kept : (int, casadi.SX) or None
        The same at every sample, when all else has happened.
    """

    u: ca.SX
    u_before: ca.SX
    y: ca.SX
    rate: ca.SX
    step: ca.SX | None = None
    acted: tuple[int, ca.SX] | None = None
    kept: tuple[int, ca.SX] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Seen:
    """What the observer of a truth knows of it.

    Attributes
    ----------
    block : ObserverBlock
    z : casadi.SX
        All states.
    """

    block: ObserverBlock
    z: ca.SX

    def estimate(self, t: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        return self.block.estimate(t, u, p, self.z)

    def own(self, name: str) -> ca.SX:
        """A number among the observer's own states, by its name in a law; zero where it has none."""
        return self.block.own(self.z).get(name, ca.SX(0))


class Truth(Protocol):
    """What the observers of a group observe."""

    @property
    def plant(self) -> SymbolicPlant:
        """The plant, of which the observers have copies."""
        ...

    @property
    def size(self) -> int:
        """Number of its states in z."""
        ...

    @property
    def recorded_inputs(self) -> int:
        """Number of inputs that lie in w."""
        ...

    @property
    def untimed(self) -> tuple[int, ...]:
        """The inputs that are no functions of time: nobody can ask what they have been."""
        ...

    @property
    def structure(self) -> Hashable:
        """All that its equations depend on."""
        ...

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        """Its states at the start, shape (size,)."""
        ...

    def place(self, t: ca.SX, x: ca.SX, p: PlantNumbers, w: ca.SX, held: Held, seen: Seen | None = None) -> Placed:
        """Its equations.

        Parameters
        ----------
        x : casadi.SX, shape (size,)
            Its states.
        p : PlantNumbers
            The plant's parameters.
        w : casadi.SX
            What is held between events, laid out as ``held`` says.
        seen : Seen, optional
            What the observer of its group knows, where there is one; a plant that is driven needs it.
        """
        ...


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedPlant:
    """The plant's own equations, with its disturbance.

    Attributes
    ----------
    stepped : bool
        By forward differences at the samples, in place of its differential equations.
    """

    plant: SymbolicPlant
    stepped: bool = False
    recorded_inputs: int = 0
    untimed: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        return self.plant.model.n

    @property
    def structure(self) -> Hashable:
        return type(self), same(self.plant), self.stepped

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        return plant.initial

    def place(self, t: ca.SX, x: ca.SX, p: PlantNumbers, w: ca.SX, held: Held, seen: Seen | None = None) -> Placed:
        model = self.plant.model
        u, before = _inputs_of_time(self.plant, t, p, w[held.interval])
        disturbance = p.of(self.plant, self.plant.disturbance)
        y = model.h(t, x, u, p.parameters)
        if not self.stepped:
            return Placed(u, before, y, model.f(t, x, u, p.parameters) + disturbance)
        interval = w[held.interval]
        rate = model.f(t - interval, x, before, p.parameters)
        rate += ca.substitute(disturbance, t, t - interval)
        return Placed(u, before, y, ca.SX.zeros(model.n), x + interval * rate)


@dataclass(frozen=True, eq=False, repr=False)
class SameTruth:
    """The truth of the first group once more, for observers that hear of it in another way; without states of its own.

    Attributes
    ----------
    truth : Truth
    replayed : bool
        Whether its observers are taken back to the time of late samples.
    """

    truth: Truth
    replayed: bool
    size: int = 0

    @property
    def plant(self) -> SymbolicPlant:
        return self.truth.plant

    @property
    def recorded_inputs(self) -> int:
        return self.truth.recorded_inputs

    @property
    def untimed(self) -> tuple[int, ...]:
        return self.truth.untimed

    @property
    def structure(self) -> Hashable:
        return type(self), self.truth.structure, self.replayed

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        return np.zeros(0)

    def place(self, t: ca.SX, x: ca.SX, p: PlantNumbers, w: ca.SX, held: Held, seen: Seen | None = None) -> Placed:
        """Its equations; x is the state of the first group's truth."""
        placed = self.truth.place(t, x, p, w, held)
        return Placed(placed.u, placed.u_before, placed.y, ca.SX(0, 1))


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Samples that are there already: no states, outputs that are whatever arrives.

    The plant is what the observers copy. Each of its inputs is an expression of time, as in a simulation, or
    recorded, too: then it holds its value between two of its changes, or follows a straight line.

    Attributes
    ----------
    recorded : tuple of int
        The inputs that are recorded.
    """

    plant: SymbolicPlant
    recorded: tuple[int, ...] = ()
    size: int = 0

    @property
    def recorded_inputs(self) -> int:
        return len(self.recorded)

    @property
    def untimed(self) -> tuple[int, ...]:
        return self.recorded

    @property
    def structure(self) -> Hashable:
        return type(self), same(self.plant), self.recorded

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        return np.zeros(0)

    def place(self, t: ca.SX, x: ca.SX, p: PlantNumbers, w: ca.SX, held: Held, seen: Seen | None = None) -> Placed:
        u, before = map(ca.SX, _inputs_of_time(self.plant, t, p, w[held.interval]))
        for i, number in enumerate(self.recorded):
            value, slope, since, last = held.input(i)
            u[number] = w[value] + w[slope] * (t - w[since])
            before[number] = w[last]
        return Placed(u, before, ca.SX.zeros(len(self.plant.model.outputs)), ca.SX(0, 1))


def _inputs_of_time(plant: SymbolicPlant, t: ca.SX, p: PlantNumbers, interval: ca.SX) -> tuple[ca.SX, ca.SX]:
    u = p.of(plant, plant.inputs)
    return u, ca.substitute(u, t, t - interval)
