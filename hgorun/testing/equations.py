"""The equations of one observer on one plant, as functions of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.config.reads import Reads
from hgorun.errors import HgorunError, PluginError, Problem, raised
from hgorun.observers.base import (
    AnyObserver,
    Arrival,
    ContinuousObserver,
    CorrectedObserver,
    DecidedObserver,
    Sample,
    SampledObserver,
)
from hgorun.observers.returned import Misfit, fitting, numbers
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.design.first_inputs import started
from hgorun.symbolic.forms import Copy, Form, ModelCopy
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.testing.contract import Broken, returned

POINTS = 5  # random ones
OPEN = "only t, the plant's parameters, the observer's states, its design and the innovation"


class Equations:
    """An observer's equations on a plant, in symbols and as functions.

    Attributes
    ----------
    observer : Observer
    plant : BuiltPlant
    form : Form
    design : dict of str to ndarray
    states : dict of str to StateBlock
        xhat and the observer's own, one after the other in the vector z.
    z : casadi.SX
        The symbols of all of them.
    """

    def __init__(self, observer: AnyObserver, plant: BuiltPlant, form: Form) -> None:
        self.observer, self.plant, self.form = observer, plant, form
        with told("design"):
            found = observer.design(form)
            self.design: dict[str, np.ndarray] = {n: _numbers(f"design(): {n}", v) for n, v in found.items()}
        with told("states"):
            self.defaults: Mapping[str, np.ndarray | Symmetric] = observer.states(form)
            for name, value in self.defaults.items():
                if not isinstance(value, (np.ndarray, Symmetric)):
                    raise Broken(f"states(): {name} is a {type(value).__name__}", "an array")
                _numbers(f"states(): {name}", value.values if isinstance(value, Symmetric) else value)
        self.states: dict[str, StateBlock] = {}
        end = 0
        for name, value in {"xhat": np.zeros(plant.model.n), **self.defaults}.items():
            self.states[name] = StateBlock.of(end, value)
            end += self.states[name].size
        self.size, self.outputs = end, len(plant.model.outputs)
        self._parameters = Parameters()
        self._p = self._parameters.add("plant", plant.parameters)
        self._k = Symbols({name: self._parameters.add(name, value) for name, value in self.design.items()})
        self._t, self.z, self._e = ca.SX.sym("t"), ca.SX.sym("z", end), ca.SX.sym("e", self.outputs)
        self._s = Symbols({name: block.symbol(self.z) for name, block in self.states.items()})

    @property
    def where(self) -> str:
        """The plant, for messages."""
        return f"on {self.plant.block.type} with {self.plant.model.n} states"

    def copy(self, t: ca.SX) -> Copy:
        """The plant as the observer copies it."""
        model = self.plant.model
        u = ca.substitute(ca.substitute(self.plant.inputs, model.p, self._p), model.t, t)
        return self.form.copy(t, u, self._p, self.observer.canonical, {})

    @property
    def estimate(self) -> ca.SX:
        """The estimate in the observer's coordinates."""
        with told("estimate"):
            found = self.observer.estimate(self._s, self._k)
        return shaped(found, (self.plant.model.n, 1), "estimate(): the estimate")

    @cached_property
    def rates(self) -> dict[str, ca.SX]:
        """d/dt of every state, as the observer returns it."""
        return dict(self._flow[0])

    @cached_property
    def correction(self) -> ca.SX | None:
        """c as the observer declares it."""
        return self._flow[1]

    @cached_property
    def _flow(self) -> tuple[Mapping[str, ca.SX], ca.SX | None]:
        assert isinstance(self.observer, ContinuousObserver)
        with told("equations"):
            flow = self.observer.equations(self.copy(self._t), self._s, self._e, self._k)
        return flow.derivatives, flow.correction

    @cached_property
    def felt(self) -> ca.SX | None:
        """C_x (copy(xhat) - xhat'), where there is a copy of the plant."""
        copy = self.copy(self._t)
        if not isinstance(copy, ModelCopy):
            return None
        return ca.jtimes(copy.output(self._s.xhat), self._s.xhat, copy.copy(self._s.xhat) - self.rates["xhat"])

    @property
    def pulls(self) -> tuple[ca.SX, ca.SX]:
        """How the innovation moves the declared correction, and -(C xhat)'; shapes (q, q)."""
        xhat = self._s.xhat
        slope = ca.jacobian(self.copy(self._t).output(self.estimate), xhat) @ ca.jacobian(self.rates["xhat"], self._e)
        return ca.jacobian(ca.SX(self.correction), self._e), -slope

    @cached_property
    def flow(self) -> ca.Function:
        """(t, parameters, z, e) -> (z', its Jacobian with e = C xhat - y)."""
        rate = ca.vertcat(*[block.flat(self.rates[name]) for name, block in self.states.items()])
        slope = ca.jacobian(rate, self.z)
        guess = self.copy(self._t).output(self.estimate)
        closed = slope + ca.jacobian(rate, self._e) @ ca.jacobian(guess, self.z)
        return self.function("flow", rate, closed)

    @cached_property
    def drive(self) -> ca.Function:
        """(t, parameters, z, e) -> how z' depends on the innovation."""
        rate = ca.vertcat(*[block.flat(self.rates[name]) for name, block in self.states.items()])
        return self.function("drive", ca.jacobian(rate, self._e))

    @cached_property
    def correct(self) -> ca.Function:
        """(t, parameters, z, e, y) -> (z after samples of all outputs, its Jacobian in z)."""
        y = ca.SX.sym("y", self.outputs)
        after = self.corrected(Arrival(y, ca.SX.ones(self.outputs)))
        flat = ca.vertcat(*[block.flat(after.get(name, vars(self._s)[name])) for name, block in self.states.items()])
        inputs = [self._t, self._parameters.symbol, self.z, self._e, y]
        return _closed("correct", inputs, [flat, ca.jacobian(flat, self.z)])

    def corrected(self, arrival: Arrival) -> dict[str, ca.SX]:
        """What the observer returns for samples that arrive."""
        assert isinstance(self.observer, CorrectedObserver)
        with told("correct"):
            return dict(self.observer.correct(self.copy(self._t), self._s, arrival, self._k))

    def decided(self) -> dict[str, ca.SX]:
        """What the observer returns at the end of a step."""
        assert isinstance(self.observer, DecidedObserver)
        with told("decide"):
            return dict(self.observer.decide(self.copy(self._t), self._s, self._e, self._k))

    @cached_property
    def leap(self) -> ca.Function:
        """(t, parameters, z, e, y, previous, interval) -> (z after a sample, its Jacobian in z)."""
        assert isinstance(self.observer, SampledObserver)
        y, previous, T = ca.SX.sym("y", self.outputs), ca.SX.sym("previous", self.outputs), ca.SX.sym("T")
        after = self.jump(Sample(y, previous, T))
        flat = ca.vertcat(*[block.flat(after.get(name, vars(self._s)[name])) for name, block in self.states.items()])
        inputs = [self._t, self._parameters.symbol, self.z, self._e, y, previous, T]
        return _closed("leap", inputs, [flat, ca.jacobian(flat, self.z)])

    def jump(self, sample: Sample) -> dict[str, ca.SX]:
        """What the observer returns for a sample."""
        assert isinstance(self.observer, SampledObserver)
        plant, before = self.copy(self._t), self.copy(self._t - sample.interval)
        with told("jump"):
            return dict(self.observer.jump(plant, before, self._s, sample, self._k))

    def read_by_equations(self) -> set[str]:
        """The keys of the block that the equations read themselves."""
        reads = Reads(self.observer)
        copy, watched = self.copy(self._t), reads.watched
        if isinstance(watched, ContinuousObserver):
            watched.equations(copy, self._s, self._e, self._k)
        if isinstance(watched, DecidedObserver):
            watched.decide(copy, self._s, self._e, self._k)
        if isinstance(watched, SampledObserver):
            watched.jump(copy, copy, self._s, Sample(self._e, self._e, self._t), self._k)
        if isinstance(watched, CorrectedObserver):
            watched.correct(copy, self._s, Arrival(self._e, self._e), self._k)
        return reads.keys

    def function(self, name: str, *expressions: ca.SX) -> ca.Function:
        """(t, parameters, z, e) -> expressions; Broken where they hold other symbols."""
        return _closed(name, [self._t, self._parameters.symbol, self.z, self._e], list(expressions))

    def evaluate(self, function: ca.Function, t: float, z: np.ndarray, *more: object) -> list[np.ndarray]:
        """The values of a function at numbers."""
        found = function(t, self._parameters.values, z, *more)
        return [np.asarray(v.full(), dtype=float) for v in (found if isinstance(found, tuple) else (found,))]

    def start(self, x: np.ndarray) -> np.ndarray:
        """z with the estimate at the plant's state x and the other states where they start."""
        with told("start"):
            estimate = started(self.form, x, self.plant, self.observer.canonical)
            xhat = self.observer.start(estimate, self.design)
        _numbers("start(): the first estimate", xhat, (self.plant.model.n,))
        values = {n: v.values if isinstance(v, Symmetric) else v for n, v in self.defaults.items()}
        values["xhat"] = xhat
        return np.concatenate([block.numbers(np.asarray(values[name])) for name, block in self.states.items()])

    @property
    def singular(self) -> bool:
        """Whether the flow is not a number at the start, with the right estimate."""
        if not isinstance(self.observer, ContinuousObserver):
            return False
        try:
            rates = self.evaluate(self.flow, 0.0, self.start(self.plant.initial), np.zeros(self.outputs))[0]
        except Exception:  # equations that are wrong in themselves: a law says how
            return False
        return not np.all(np.isfinite(rates))

    def places(self, *roles: str) -> np.ndarray:
        """Where in z the states of these roles lie; ``estimate`` is xhat's."""
        of = {"xhat": "estimate", **self.observer.roles(self.form)}
        blocks = [block for name, block in self.states.items() if of[name] in roles]
        return np.concatenate([np.zeros(0, int), *(np.arange(b.start, b.start + b.size) for b in blocks)])


def shaped(value: object, shape: tuple[int, int], what: str) -> ca.SX:
    """An expression that a method has returned; Broken where it has another shape, or is none."""
    try:
        return fitting(value, shape)
    except Misfit as misfit:
        raise Broken(f"{what} {misfit}", f"an expression of the shape {shape}") from None


def _numbers(what: str, value: object, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Numbers that a method has returned, as far as their kind and their shape go; Broken where these are wrong."""
    try:
        return numbers(value, shape)
    except Misfit as misfit:
        found, _, expected = str(misfit).rpartition(", expected ")
        raise Broken(f"{what} {found}", expected) from None


@contextmanager
def told(method: str) -> Iterator[None]:
    """What a method raises, told as a finding; refusals of a plant pass."""
    try:
        yield
    except PluginError as error:
        cause = error.__cause__
        if cause is None:
            raise Broken(*returned(error)) from error
        raise Broken(f"{method}() raised {raised(cause)}", "no exception") from error
    except (HgorunError, Problem, Broken):
        raise
    except Exception as error:
        raise Broken(f"{method}() raised {raised(error)}", "no exception") from error


def _closed(name: str, inputs: list[ca.SX], expressions: list[ca.SX]) -> ca.Function:
    try:
        return ca.Function(name, inputs, [ca.densify(ca.SX(expression)) for expression in expressions])
    except RuntimeError as error:
        free = re.search(r"variables \[(.*?)\] are free", str(error))
        if free is None:
            raise
        raise Broken(f"the free symbols {free[1]} in its equations", OPEN) from error


def numbers_of(equations: Equations) -> np.ndarray:
    """What the equations give at random points near the start."""
    found = []
    for z, e in points(equations):
        if isinstance(equations.observer, ContinuousObserver):
            found.append(equations.evaluate(equations.flow, 0.3, z, e)[0])
        if isinstance(equations.observer, SampledObserver):
            found.append(equations.evaluate(equations.leap, 0.3, z, e, e + 0.1, e, 0.1)[0])
        if isinstance(equations.observer, CorrectedObserver):
            found.append(equations.evaluate(equations.correct, 0.3, z, e, e + 0.1)[0])
    return np.concatenate([np.ravel(values) for values in found])


def points(equations: Equations) -> list[tuple[np.ndarray, np.ndarray]]:
    """States and innovations, drawn with a fixed seed."""
    random = np.random.default_rng(1)
    start = equations.start(equations.plant.initial)
    found = []
    for _ in range(POINTS):
        z = start + 0.05 * (np.abs(start) + 1) * random.uniform(-1, 1, start.size)
        found.append((z, 0.1 * random.uniform(-1, 1, equations.outputs)))
    return found
