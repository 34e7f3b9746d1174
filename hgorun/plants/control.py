"""A controller as expressions: the law from what is taken for the state, integral action, saturation and cost.

    u = sat(gamma(xhat, xi, t)),    xi' = g(xhat, xi, t)

Which numbers stand in the expressions is not decided here: they are arguments, as those of other inputs are.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from hgorun.config.controller import DRIVEN, Controller
from hgorun.config.expressions import nearest
from hgorun.errors import Problem
from hgorun.plants.base import Plant
from hgorun.plants.expressions import Signals, signals_of

_COST = "cost"


@dataclass(frozen=True, eq=False, repr=False)
class ControlLaw:
    """A controller without numbers.

    Attributes
    ----------
    driven : tuple of int
        Which inputs it drives.
    integral, own : tuple of str
        Names of its integrals, and of the states of observers that its law uses.
    held : bool
        Whether the inputs are held between instants.
    law : casadi.Function
        (t, x, u, xi, own, numbers) -> (u, xi'), where x is what it takes for the state, u on the left the inputs that
        it does not drive, and ``numbers`` all of the plant's: u on the right are those that it drives, clipped.
    truth : casadi.Function
        (t, x, u, numbers) -> what ``own`` estimates.
    cost : casadi.Function or None
        (t, x, u, numbers) -> the derivative of the cost.
    """

    driven: tuple[int, ...]
    integral: tuple[str, ...]
    own: tuple[str, ...]
    held: bool
    law: ca.Function
    truth: ca.Function
    cost: ca.Function | None


@dataclass(frozen=True, eq=False, repr=False)
class Space:
    """The symbols in which a plant is written.

    Attributes
    ----------
    names : mapping of str to casadi.SX
        States, inputs, parameters and t as expressions have them.
    everything, numbers : casadi.SX
        All numbers of the plant, and those of the controller among them.
    """

    t: ca.SX
    x: ca.SX
    u: ca.SX
    names: Mapping[str, ca.SX]
    everything: ca.SX
    numbers: ca.SX


@dataclass(frozen=True, eq=False, repr=False)
class ControlTexts:
    """A controller's expressions, their numbers apart.

    Attributes
    ----------
    law, integral, truth, cost : Signals
    bounds : mapping of str to (float, float)
        Of the inputs with saturation.
    conditional, held : bool
        Whether integrals rest at bounds, and whether inputs are held between instants.
    """

    law: Signals
    integral: Signals
    truth: Signals
    cost: Signals
    bounds: Mapping[str, tuple[float, float]]
    conditional: bool
    held: bool

    @classmethod
    def of(cls, controller: Controller, plant: Plant, parameters: Collection[str]) -> ControlTexts:
        """Read them.

        Raises
        ------
        Problem
            Its path starts at ``controller``, or at the inputs of ``plant``.
        """
        driven = driven_of(plant)
        _check_inputs(controller, plant, driven)
        plain = [*plant.state_names, *(name for name in plant.input_names if name not in driven), *parameters, "t"]
        _check_names(controller, {*plain, *driven})
        seen = [*plain, *controller.integral, *controller.truth]
        if isinstance(controller.cost, dict):  # of a name that is not known, its own place is told
            signals_of(("controller", "cost"), {name: name for name in controller.cost}, [*plain, *driven])
        cost = {} if controller.cost_text is None else {_COST: controller.cost_text}
        return cls(
            law=signals_of(("controller", "law"), {name: controller.law[name] for name in driven}, seen),
            integral=signals_of(("controller", "integral"), controller.integral, seen),
            truth=signals_of(("controller", "truth"), controller.truth, plain),
            cost=signals_of(("controller",), cost, [*plain, *driven]),
            bounds={name: controller.saturation[name] for name in driven if name in controller.saturation},
            conditional=controller.anti_windup == "conditional",
            held=controller.period is not None,
        )

    @property
    def _parts(self) -> tuple[Signals, ...]:
        return self.law, self.integral, self.truth, self.cost

    @property
    def structure(self) -> Hashable:
        """All but the numbers."""
        return tuple(part.templates for part in self._parts), tuple(self.bounds), self.conditional, self.held

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name for every number."""
        bounds = (f"controller.saturation.{name}[{i}]" for name in self.bounds for i in (0, 1))
        return *(name for part in self._parts for name in part.names), *bounds

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """The numbers, in the order of their names."""
        bounds = (bound for both in self.bounds.values() for bound in both)
        return *(value for part in self._parts for one in part.numbers for value in one), *bounds

    def built(self, inputs: Sequence[str], space: Space) -> ControlLaw:
        """The law in the symbols of a plant with these inputs."""
        driven, integral, own = (
            tuple(name for name, _ in part.templates) for part in (self.law, self.integral, self.truth)
        )
        xi, others = ca.SX.sym("xi", len(integral)), ca.SX.sym("own", len(own))
        seen = {**space.names, **_entries(integral, xi), **_entries(own, others)}
        names = (seen, seen, space.names, space.names)
        found, at = [], 0
        for part, known in zip(self._parts, names, strict=True):
            numbers = space.numbers[at : at + len(part.names)]
            found.append(ca.vertcat(ca.SX(0, 1), *part.symbols(known, numbers, chained=False).values()))
            at += len(part.names)
        gamma, rates, true, cost = found
        bounds = {driven.index(name): space.numbers[at + 2 * i : at + 2 * i + 2] for i, name in enumerate(self.bounds)}
        u = [_clipped(one, bounds.get(i)) for i, one in enumerate(ca.vertsplit(gamma))]
        if self.conditional and integral:
            rates = _resting(rates, gamma, xi, bounds)
        plain, last = [space.t, space.x, space.u], space.everything
        return ControlLaw(
            driven=tuple(inputs.index(name) for name in driven),
            integral=integral,
            own=own,
            held=self.held,
            law=ca.Function("law", [*plain, xi, others, last], [ca.densify(ca.vertcat(*u)), ca.densify(rates)]),
            truth=ca.Function("truth", [*plain, last], [ca.densify(true)]),
            cost=ca.Function("cost", [*plain, last], [ca.densify(cost)]) if self.cost.templates else None,
        )


def driven_of(plant: Plant) -> tuple[str, ...]:
    """The inputs that a controller drives."""
    return tuple(name for name in plant.input_names if plant.inputs.get(name) == DRIVEN)


def _entries(names: Sequence[str], values: ca.SX) -> dict[str, ca.SX]:
    return dict(zip(names, ca.vertsplit(values) if names else [], strict=True))


def _clipped(value: ca.SX, bounds: ca.SX | None) -> ca.SX:
    return value if bounds is None else ca.fmax(bounds[0], ca.fmin(bounds[1], value))


def _resting(rates: ca.SX, gamma: ca.SX, xi: ca.SX, bounds: Mapping[int, ca.SX]) -> ca.SX:
    """Integrals that rest while an input is beyond a bound and they would take what its law gives further.

    Which way that is the slope of the law in the integral says: with gamma = ... + k xi the sign of k xi'. Every sign
    is asked for once, so that equations change at one time for each and not at two that differ by rounding.
    """
    found = []
    beyond = {i: (gamma[i] > both[1], gamma[i] < both[0]) for i, both in bounds.items()}
    for k, rate in enumerate(ca.vertsplit(rates)):
        grows, rests = rate > 0, ca.SX(0)
        for i, (above, below) in beyond.items():
            slope = ca.jacobian(gamma[i], xi[k])
            if not slope.is_zero():
                rises = ca.if_else(slope > 0, grows, ca.logic_not(grows))
                rests = ca.logic_or(rests, ca.logic_or(ca.logic_and(above, rises), ca.logic_and(below, 1 - rises)))
        found.append(ca.if_else(rests, 0, rate))
    return ca.vertcat(*found)


def _check_inputs(controller: Controller, plant: Plant, driven: Collection[str]) -> None:
    """Every input that is driven has a law, and every law an input."""
    for name in driven:
        if name not in controller.law:
            raise Problem(("controller", "law"), f"the law of input {name} is missing")
    for name in controller.law:
        if name not in plant.input_names:
            known = ", ".join(plant.input_names) or "none"
            raise Problem(
                ("controller", "law", name),
                f"unknown input {name!r}; inputs of the plant: {known}.{nearest(name, plant.input_names)}",
            )
        if name not in driven:
            found = f"found {plant.inputs[name]}" if name in plant.inputs else "it is missing"
            raise Problem(("plant", "inputs", name), f"an input with a law is written {name}: {DRIVEN}; {found}")


def _check_names(controller: Controller, taken: Collection[str]) -> None:
    """New names differ from all others; those of observers' states are used."""
    known = dict.fromkeys(taken, "a name of the plant")
    for key in ("integral", "truth"):
        for name in getattr(controller, key):
            if name in known:
                raise Problem(("controller", key, name), f"{name!r} is {known[name]} already")
            known[name] = f"a name in controller.{key}"
