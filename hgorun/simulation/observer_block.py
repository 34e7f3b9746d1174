"""One observer inside the system: its numbers, its states in z, its equations."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import casadi as ca
import numpy as np

from hgorun.errors import PluginError, Problem, called
from hgorun.memo import same
from hgorun.observers.base import AnyObserver, ContinuousObserver, Sample, SampledObserver
from hgorun.symbolic.forms import ChosenChains, Copy, Form, ModelCopy
from hgorun.symbolic.parameters import Parameters, flat
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """An observer with the numbers that its keys give for a plant.

    Attributes
    ----------
    form, origin : Form
        The plant as the observer sees it, and the form that was first found: the same equations, maybe of
        other numbers.
    gains : dict of str to ndarray
        What the equations use.
    defaults : dict of str to ndarray or Symmetric
        Initial values where none are given: of xhat and of the observer's own states.
    """

    label: str
    observer: AnyObserver
    form: Form
    origin: Form
    gains: Mapping[str, np.ndarray]
    defaults: dict[str, np.ndarray | Symmetric]
    _last: dict[str, object] = field(default_factory=dict)

    @classmethod
    def of(cls, label: str, observer: AnyObserver, form: Form, origin: Form | None = None) -> Design:
        """Design the gains.

        Raises
        ------
        Problem
            When the observer's block does not fit the plant.
        """
        canonical = observer.coordinates == "canonical"
        if canonical and isinstance(form, ChosenChains) and form.no_inverse is not None:
            raise Problem(("observers", label, "coordinates"), form.no_inverse)
        for key, known in (("initial", form.plant.states), ("saturation", form.saturable(canonical))):
            for name in getattr(observer, key):
                if not known:
                    raise Problem(("observers", label, key), f"{observer.type} has no state that could be given here")
                if name not in known:
                    raise Problem(("observers", label, key), f"unknown state {name!r}; known here: {', '.join(known)}")
        try:
            found = observer.design(form)
            with called("observer", observer.type, "design"):
                gains = {name: np.asarray(value, dtype=float) for name, value in found.items()}
        except Problem as problem:
            raise Problem(("observers", label, *problem.path), problem.message) from problem
        defaults = {"xhat": np.zeros(form.plant.n), **observer.states(form)}
        for name, value in defaults.items():
            if not isinstance(value, (np.ndarray, Symmetric)):
                kind = type(value).__name__
                raise PluginError(f"observer {observer.type!r}: states has a {kind} for {name}, expected an array")
        return cls(label, observer, form, form if origin is None else origin, gains, defaults)

    def initial(self, parameters: np.ndarray, *, has_alpha: bool) -> np.ndarray:
        """Its part of z at the start.

        Raises
        ------
        Problem
            When ``initial`` or ``internal`` does not fit.
        """
        key = parameters.tobytes(), has_alpha
        if self._last.get("of") != key:  # the runs of a family often have the same parameters
            try:
                xhat = self.form.start(self._estimate, parameters, self.observer.coordinates == "canonical")
            except ValueError as error:
                at = "" if self.observer.initial else "; that is where estimates start by default: give initial"
                raise self._fail("initial", f"{error}{at}") from error
            own = self._own_alpha if has_alpha else self._own
            self._last.update(of=key, values=np.concatenate([np.ravel(xhat), own]))
        return cast(np.ndarray, self._last["values"])

    @cached_property
    def _estimate(self) -> np.ndarray:
        """The initial estimate in the plant's coordinates."""
        return np.array([self.observer.initial.get(s, 0.0) for s in self.form.plant.states])

    @cached_property
    def _own(self) -> np.ndarray:
        """Initial values of the observer's own states."""
        return self._own_values({})

    @cached_property
    def _own_alpha(self) -> np.ndarray:
        """The same with alpha behind them."""
        return self._own_values({"alpha": np.zeros(len(self.form.plant.outputs))})

    def _own_values(self, more: dict[str, np.ndarray]) -> np.ndarray:
        defaults = {name: value for name, value in (self.defaults | more).items() if name != "xhat"}
        places = {name: StateBlock.of(0, value) for name, value in defaults.items()}
        values = {n: v.values if isinstance(v, Symmetric) else v for n, v in defaults.items()}
        for name, given in self.observer.internal.items():
            if name not in values:
                known = ", ".join(values) or "none"
                raise self._fail("internal", f"unknown internal state {name!r}; this observer has: {known}")
            try:
                values[name] = places[name].initial(given, values[name])
            except ValueError as error:
                raise self._fail("internal", f"{name}: {error}") from error
        return np.concatenate([np.zeros(0), *(places[name].numbers(np.asarray(v)) for name, v in values.items())])

    def _fail(self, key: str, message: str) -> Problem:
        return Problem(("observers", self.label, key), message)

    @cached_property
    def structure(self) -> Hashable:
        """What the equations depend on, besides the keys that they read themselves."""
        gains = tuple((name, np.shape(value)) for name, value in self.gains.items())
        states = tuple(
            (name, True, value.values.shape) if isinstance(value, Symmetric) else (name, False, np.shape(value))
            for name, value in self.defaults.items()
        )
        observer = self.observer
        own = self.label, type(observer), observer.coordinates, tuple(observer.saturation)
        return own, same(self.origin), gains, states

    @cached_property
    def numbers(self) -> np.ndarray:
        """Its part of the parameters: gains, then saturation bounds."""
        return np.concatenate(
            [np.zeros(0), *map(flat, self.gains.values()), *map(flat, self.observer.saturation.values())]
        )


@dataclass(frozen=True, eq=False, repr=False)
class ObserverBlock:
    """An observer with a place in the state vector and its numbers among the parameters.

    Attributes
    ----------
    states : dict of str to StateBlock
        xhat, the observer's own states, and alpha where the measurement needs it.
    start : int
        The first of its states in z.
    k : Symbols
        Symbols for the numbers of the design.
    bounds : dict of str to (casadi.SX, casadi.SX)
        Symbols for the saturation.
    design : dict of str to ndarray
        The numbers.
    """

    label: str
    observer: AnyObserver
    form: Form
    start: int
    states: dict[str, StateBlock]
    k: Symbols
    bounds: dict[str, tuple[ca.SX, ca.SX]]
    design: Mapping[str, np.ndarray]

    @classmethod
    def place(
        cls, design: Design, start: int, has_alpha: bool, parameters: Parameters, observer: AnyObserver | None = None
    ) -> ObserverBlock:
        """Give an observer its place and its parameters.

        Parameters
        ----------
        observer : Observer, optional
            Whose equations are taken, in place of the design's own.
        """
        label = design.label
        k = Symbols({n: parameters.add(f"{label}.{n}", v) for n, v in design.gains.items()})
        bounds = {}
        for state, interval in design.observer.saturation.items():
            both = parameters.add(f"{label}.sat.{state}", interval)
            bounds[state] = (both[0], both[1])
        defaults = dict(design.defaults)
        if has_alpha:
            defaults["alpha"] = np.zeros(len(design.form.plant.outputs))
        states, end = {}, start
        for name, value in defaults.items():
            states[name] = StateBlock.of(end, value)
            end += states[name].size
        return cls(label, observer or design.observer, design.form, start, states, k, bounds, design.gains)

    def of(self, design: Design) -> ObserverBlock:
        """The same place and equations with the numbers of another observer."""
        mine = self.label, design.observer, design.form
        return ObserverBlock(*mine, self.start, self.states, self.k, self.bounds, design.gains)

    @property
    def canonical(self) -> bool:
        """Whether the observer computes in canonical coordinates."""
        return self.observer.coordinates == "canonical"

    @property
    def end(self) -> int:
        """Behind the last of its states in z."""
        return self.start + sum(state.size for state in self.states.values())

    @property
    def stop(self) -> int:
        """[start, stop) is watched for divergence; [stop, end) is alpha."""
        return self.states["alpha"].start if "alpha" in self.states else self.end

    def symbols(self, z: ca.SX) -> Symbols:
        """The observer's states as parts of z, in their shapes."""
        return Symbols({name: block.symbol(z) for name, block in self.states.items()})

    def guess(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX:
        """C xhat."""
        return self.copy(t, u, p).output(self.symbols(z).xhat)

    def estimate(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        return self.copy(t, u, p).state(self.symbols(z).xhat)

    def flow(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX, e: ca.SX) -> ca.SX:
        """d/dt of the block, alpha' = -c last."""
        derivatives, correction = self.equations(self.copy(t, u, p), self.symbols(z), e)
        if "alpha" in self.states:
            derivatives["alpha"] = -correction
        return ca.vertcat(*[block.flat(derivatives[name]) for name, block in self.states.items()])

    def equations(self, copy: Copy, s: Symbols, e: ca.SX) -> tuple[dict[str, ca.SX], ca.SX]:
        """The derivatives of xhat and the observer's own states, and the correction c, shape (q,)."""
        if not isinstance(self.observer, ContinuousObserver):  # it holds between samples
            still = {name: ca.SX.zeros(*value.shape) for name, value in vars(s).items() if name != "alpha"}
            return still, ca.SX.zeros(e.shape)
        with called("observer", self.observer.type, "equations"):
            flow = self.observer.equations(copy, s, e, self.k)
            derivatives = self._fitting(flow.derivatives, "equations", "derivative")
        missing = [name for name in self._own if name not in derivatives]
        if missing:
            raise self._wrong(f"equations: no derivative of {', '.join(missing)}")
        if flow.correction is None:
            return derivatives, self._felt(copy, s.xhat, derivatives["xhat"])
        return derivatives, self._of_shape(flow.correction, e.shape, "equations: the correction")

    @property
    def _own(self) -> dict[str, StateBlock]:
        """The states that the observer's equations are about: not alpha, which is the innovation's."""
        return {name: state for name, state in self.states.items() if name != "alpha"}

    def _fitting(self, given: Mapping[str, ca.SX], method: str, what: str) -> dict[str, ca.SX]:
        """Expressions by state, each of exactly its state's shape.

        One with more entries would move the states behind it, which are another observer's.
        """
        unknown = [name for name in given if name not in self._own]
        if unknown:
            states = ", ".join(self._own)
            raise self._wrong(f"{method}: a {what} of {', '.join(unknown)}, which is not one of its states: {states}")
        return {
            name: self._of_shape(value, self._own[name].matrix, f"{method}: the {what} of {name}")
            for name, value in given.items()
        }

    def _of_shape(self, value: ca.SX, shape: tuple[int, int], what: str) -> ca.SX:
        found = ca.SX(value)
        if found.shape != shape:
            raise self._wrong(f"{what} has the shape {found.shape}, expected {shape}")
        return found

    def _wrong(self, message: str) -> Problem:
        """A mistake in the class, told at the block that uses it."""
        return Problem(("observers", self.label, "type"), f"{self.observer.type}, {message}")

    def _felt(self, copy: Copy, xhat: ca.SX, rate: ca.SX) -> ca.SX:
        """C_x (copy(xhat) - xhat'): what the outputs of the estimate feel beside the copy of the plant."""
        if not isinstance(copy, ModelCopy):
            raise Problem(
                ("observers", self.label, "type"),
                f"{type(self.observer).__name__} has no copy of the plant: the Flow of its equations has to give "
                "its correction",
            )
        return ca.jtimes(copy.output(xhat), xhat, copy.copy(xhat) - rate)

    def jump(self, t: ca.SX, u: ca.SX, u_before: ca.SX, p: ca.SX, z: ca.SX, sample: Sample) -> ca.SX:
        """What the block becomes when a sample arrives."""
        plant, before = self.copy(t, u, p), self.copy(t - sample.interval, u_before, p)
        s = self.symbols(z)
        assert isinstance(self.observer, SampledObserver)
        with called("observer", self.observer.type, "jump"):
            after = self.observer.jump(plant, before, s, sample, self.k)
            values = vars(s) | self._fitting(after, "jump", "value")
        return ca.vertcat(*[block.flat(values[name]) for name, block in self.states.items()])

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX) -> Copy:
        """The plant as the observer copies it."""
        return self.form.copy(t, u, p, self.canonical, self.bounds)
