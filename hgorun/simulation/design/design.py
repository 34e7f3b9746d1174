"""An observer's block with the numbers that follow from it for a plant: gains and initial values."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hgorun.config.nearest import among, meant
from hgorun.errors import PluginError, Problem
from hgorun.memo import same
from hgorun.observers.base import AnyObserver, ContinuousObserver, CorrectedObserver
from hgorun.observers.returned import Misfit, numbers
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.design.first_inputs import Recorded, started
from hgorun.simulation.design.overflow import overflow
from hgorun.symbolic.forms import ChosenChains, Driven, Form, Guessing
from hgorun.symbolic.parameters import flat
from hgorun.symbolic.states import StateBlock, Symmetric

SHRINK = "hold.shrink"  # among the numbers of a design: gamma of an innovation that shrinks between samples
_MANY = 6  # names, in a message


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
    _last: dict[str, tuple[Hashable, np.ndarray]] = field(default_factory=dict)

    @classmethod
    def of(cls, label: str, observer: AnyObserver, form: Form, origin: Form | None = None) -> Design:
        """Design the gains.

        Raises
        ------
        Problem
            When the observer's block does not fit the plant.
        """
        canonical = observer.canonical
        if canonical and isinstance(form, ChosenChains) and form.no_inverse is not None:
            if observer.coordinates == "canonical":
                raise Problem(("observers", label, "coordinates"), f"{form.no_inverse}; use coordinates: original")
            raise Problem(("observers", label), f"it computes in z = Phi(x): {form.no_inverse}")
        saturable = form.saturable(canonical) or (form.plant.states if observer.clip_estimate else ())
        if observer.clip_estimate and not observer.saturation:
            message = "there is nothing to clip to: give saturation, with the bounds of the estimate"
            raise Problem(("observers", label, "clip_estimate"), message)
        for key, known in (("initial", form.plant.states), ("saturation", saturable)):
            given = getattr(observer, key)
            if given and not known:
                raise Problem(("observers", label, key), f"{observer.type} has no state that could be given here")
            unknown = [name for name in given if name not in known]
            if unknown:
                which = " and ".join(map(repr, unknown[:_MANY]))
                message = f"unknown state {which}; known here: {among(unknown[0], known)}"
                raise Problem(("observers", label, key), message)
        gains = _gains(label, observer, form)
        gains |= _shrinking(label, observer)
        defaults = {"xhat": np.zeros(form.plant.n), **observer.states(form)}
        for name, value in defaults.items():
            if not isinstance(value, (np.ndarray, Symmetric)):
                kind = type(value).__name__
                message = f"observer {observer.type!r}: states has a {kind} for {name}, expected an array"
                raise PluginError(message, ("observer", observer.type))
            _numbers(observer, f"states: {name}", value.values if isinstance(value, Symmetric) else value)
        return cls(label, observer, form, form if origin is None else origin, gains, defaults)

    def initial(self, plant: BuiltPlant, *, has_alpha: bool, recorded: Recorded) -> np.ndarray:
        """Its part of z at the start.

        Raises
        ------
        Problem
            When ``initial`` or ``internal`` does not fit.
        """
        driven = plant.numbers.tobytes() if isinstance(self.form, Driven) else b""
        key = plant.parameters.tobytes(), driven, recorded, has_alpha
        known = self._last.get("start")
        if known is None or known[0] != key:  # the runs of a family often have the same parameters
            try:
                estimate = started(self.form, self._estimate, plant, self.observer.canonical, recorded)
                found = self.observer.start(estimate, self.gains)
            except ValueError as error:
                raise self._fail("initial", f"{error}{self._defaulted}") from error
            xhat = _numbers(self.observer, "start: the first estimate", found, (self.form.plant.n,))
            own = self._own_alpha if has_alpha else self._own
            # in one piece: runs in other threads may share the design
            known = self._last["start"] = key, np.concatenate([np.ravel(xhat), own])
        return known[1]

    @property
    def _defaulted(self) -> str:
        """What a message adds where states start at 0 for want of another value."""
        absent = [state for state in self.form.plant.states if state not in self.observer.initial]
        return f"; states without an initial value start at 0: give initial of {', '.join(absent)}" if absent else ""

    def check_own(self) -> None:
        """Refuse ``internal`` that does not fit; of ``initial`` this is known as soon as there is a design.

        Raises
        ------
        Problem
        """
        _ = self._own_alpha

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
                raise self._fail(
                    "internal", f"unknown internal state {name!r}; this observer has: {known}{meant(name, values)}"
                )
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
        """Its part of the parameters: gains, then saturation bounds, then what its form starts Newton's method at."""
        guess = [] if self.guess is None else [self.guess]
        return np.concatenate(
            [np.zeros(0), *map(flat, self.gains.values()), *map(flat, self.observer.saturation.values()), *guess]
        )

    @cached_property
    def guess(self) -> np.ndarray | None:
        """Where Newton's method starts that finds the estimate; None where there is none."""
        return self.form.guess if isinstance(self.form, Guessing) else None


def _numbers(observer: AnyObserver, what: str, value: object, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """What a method has returned, as numbers.

    Raises
    ------
    PluginError
    """
    try:
        return numbers(value, shape)
    except Misfit as misfit:
        raise PluginError(f"observer {observer.type!r}: {what} {misfit}", ("observer", observer.type)) from None


def _gains(label: str, observer: AnyObserver, form: Form) -> dict[str, np.ndarray]:
    """What the observer's keys give for the plant.

    Raises
    ------
    Problem
        When they do not fit it, or are so large that a gain overflows.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = observer.design(form)
            gains = {name: _numbers(observer, f"design: {name}", value) for name, value in found.items()}
    except Problem as problem:
        raise Problem(("observers", label, *problem.path), problem.message) from problem
    except (np.linalg.LinAlgError, OverflowError) as error:
        if beyond := overflow(label, observer, gains=True):
            raise beyond from error
        raise
    if not all(np.all(np.isfinite(value)) for value in gains.values()) and (
        beyond := overflow(label, observer, gains=True)
    ):
        raise beyond
    return gains


def _shrinking(label: str, observer: AnyObserver) -> dict[str, np.ndarray]:
    """gamma, where the innovation shrinks between samples."""
    if observer.hold is None:
        return {}
    if isinstance(observer, CorrectedObserver) or not isinstance(observer, ContinuousObserver):
        message = f"{observer.type} has no innovation between samples that could be held"
        raise Problem(("observers", label, "hold"), message)
    return {} if observer.hold == "predictor" else {SHRINK: np.array(observer.hold.shrink)}
