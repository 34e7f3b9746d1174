"""One observer inside the system: its states in z, its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.errors import Problem, called
from hgorun.observers.base import (
    AnyObserver,
    Arrival,
    ContinuousObserver,
    CorrectedObserver,
    DecidedObserver,
    Sample,
    SampledObserver,
)
from hgorun.observers.covariance import KnownCovariance
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.observers.returned import Misfit, fitting
from hgorun.simulation.design.design import SHRINK, Design
from hgorun.symbolic.forms import Copy, Form, GuessingCopy, felt, saturate
from hgorun.symbolic.graph import apart_from
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.states import StateBlock
from hgorun.symbolic.symbols import Symbols


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
    newton : casadi.SX or None
        Symbols for where Newton's method starts that finds the estimate.
    """

    label: str
    observer: AnyObserver
    form: Form
    start: int
    states: dict[str, StateBlock]
    k: Symbols
    bounds: dict[str, tuple[ca.SX, ca.SX]]
    design: Mapping[str, np.ndarray]
    newton: ca.SX | None

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
        newton = None if design.guess is None else parameters.add(f"{label}.guess", design.guess)
        alpha = {"alpha": np.zeros(len(design.form.plant.outputs))} if has_alpha else {}
        states, end = {}, start
        for name, value in {**design.defaults, **alpha}.items():
            states[name] = StateBlock.of(end, value)
            end += states[name].size
        return cls(label, observer or design.observer, design.form, start, states, k, bounds, design.gains, newton)

    def of(self, design: Design) -> ObserverBlock:
        """The same place and equations with the numbers of another observer."""
        mine = self.label, design.observer, design.form
        return ObserverBlock(*mine, self.start, self.states, self.k, self.bounds, design.gains, self.newton)

    @property
    def canonical(self) -> bool:
        """Whether the observer computes in canonical coordinates."""
        return self.observer.canonical

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

    @property
    def recalled(self) -> int:
        """How many of its own signals it looks back at."""
        return int(np.size(self.design[LAGS])) if isinstance(self.observer, RecallingObserver) else 0

    def guess(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX:
        """C xhat, or what else is compared with what arrives."""
        if isinstance(self.observer, RecallingObserver):
            with called("observer", self.observer.type, "compared"):
                return self.observer.compared(self.copy(t, u, p), self.symbols(z), self.k)
        return self.copy(t, u, p).output(self._estimate(z))

    def compared(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX:
        """What samples are compared with: where the observer expects another mean than C xhat, that."""
        if isinstance(self.observer, KnownCovariance):
            return self.observer.expected(self.copy(t, u, p), self.symbols(z), self.k)[0]
        return self.guess(t, u, p, z)

    def signals(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX:
        """What it looks back at, shape (recalled, 1)."""
        if not isinstance(self.observer, RecallingObserver):
            return ca.SX(0, 1)
        with called("observer", self.observer.type, "signals"):
            found = self.observer.signals(self.copy(t, u, p), self.symbols(z), self.k)
        return self._of_shape(found, (self.recalled, 1), "signals: what it looks back at")

    def spread(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX | None:
        """Of an observer that knows the covariance of xhat, of samples without noise: variances, means beside C xhat.

        Shape (2q,).
        """
        if not isinstance(self.observer, KnownCovariance):
            return None
        mean, variance = self.observer.expected(self.copy(t, u, p), self.symbols(z), self.k)
        return ca.densify(ca.vertcat(variance, mean - self.guess(t, u, p, z)))

    def estimate(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates, clipped where that is asked for."""
        xhat, known = self._estimate(z), self.form.saturable(self.canonical)
        of_plant = not known or known == self.form.plant.states
        if not self.observer.clip_estimate:
            return self.copy(t, u, p).state(xhat)
        if of_plant:
            return saturate(self.copy(t, u, p).state(xhat), self.form.plant.states, self.bounds)
        return self.copy(t, u, p).state(saturate(xhat, known, self.bounds))

    def _estimate(self, z: ca.SX) -> ca.SX:
        """The estimate in the observer's coordinates."""
        with called("observer", self.observer.type, "estimate"):
            found = self.observer.estimate(self.symbols(z), self.k)
            return self._of_shape(found, (self.form.plant.n, 1), "the estimate")

    def own(self, z: ca.SX) -> dict[str, ca.SX]:
        """The numbers among the observer's own states by their names in a law.

        ``sigma`` is a single number, ``sigma_2`` one of a vector, ``P_1_2`` one of a matrix.
        """
        return {
            entry: state.symbol(z)[place]
            for name, state in self._beside.items()
            for entry, place in state.entries(name).items()
        }

    @property
    def own_names(self) -> tuple[str, ...]:
        """The names of these."""
        return tuple(entry for name, state in self._beside.items() for entry in state.entries(name))

    def flow(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX, e: ca.SX, past: ca.SX | None = None) -> ca.SX:
        """d/dt of the block, alpha' = -c last; ``past`` is what it has looked back at."""
        s = self.symbols(z)
        if past is not None:
            s = Symbols(vars(s) | {"past": past})

        def rate(u: ca.SX) -> ca.SX:
            derivatives, correction = self.equations(self.copy(t, u, p), s, e)
            if "alpha" in self.states:
                derivatives["alpha"] = -correction
            return ca.vertcat(*[block.flat(derivatives[name]) for name, block in self.states.items()])

        return apart_from(u, z, rate)

    def decisions(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX, e: ca.SX) -> dict[int, ca.SX]:
        """What is decided at the end of a step or after an event: the new values of states, by their places in z."""
        if not isinstance(self.observer, DecidedObserver):
            return {}
        with called("observer", self.observer.type, "decide"):
            new = self.observer.decide(self.copy(t, u, p), self.symbols(z), e, self.k)
            values = self._fitting(new, "decide", "value")
        return {
            self.states[name].start + i: value
            for name, values_of in values.items()
            for i, value in enumerate(ca.vertsplit(self.states[name].flat(values_of)))
        }

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
        if isinstance(self.observer, CorrectedObserver):  # whose alpha nobody reads: rounding in it would cost steps
            return derivatives, ca.SX.zeros(e.shape)
        gamma = vars(self.k).get(SHRINK)
        if gamma is not None:  # then e = s + alpha - y shrinks as exp(-gamma t)
            return derivatives, gamma * e
        if flow.correction is not None:
            return derivatives, self._of_shape(flow.correction, e.shape, "equations: the correction")
        correction = felt(copy, s.xhat, derivatives["xhat"])
        if correction is None:
            raise Problem(
                ("observers", self.label, "type"),
                f"{type(self.observer).__name__} has no copy of the plant: the Flow of its equations has to give "
                "its correction",
            )
        return derivatives, correction

    @property
    def _own(self) -> dict[str, StateBlock]:
        """The states that the observer's equations are about: not alpha, which is the innovation's."""
        return {name: state for name, state in self.states.items() if name != "alpha"}

    @property
    def _beside(self) -> dict[str, StateBlock]:
        """Those beside the estimate."""
        return {name: state for name, state in self._own.items() if name != "xhat"}

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
        try:
            return fitting(value, shape)
        except Misfit as misfit:
            raise self._wrong(f"{what} {misfit}, expected {shape}") from None

    def _wrong(self, message: str) -> Problem:
        """A mistake in the class, told at the block that uses it."""
        return Problem(("observers", self.label, "type"), f"{self.observer.type}, {message}")

    def jump(self, t: ca.SX, u: ca.SX, u_before: ca.SX, p: ca.SX, z: ca.SX, sample: Sample) -> ca.SX:
        """What the block becomes when a sample arrives."""
        plant, before = self.copy(t, u, p), self.copy(t - sample.interval, u_before, p)
        s = self.symbols(z)
        assert isinstance(self.observer, SampledObserver)
        with called("observer", self.observer.type, "jump"):
            after = self.observer.jump(plant, before, s, sample, self.k)
            values = vars(s) | self._fitting(after, "jump", "value")
        return ca.vertcat(*[block.flat(values[name]) for name, block in self.states.items()])

    def corrected(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX, arrival: Arrival) -> ca.SX:
        """What the block becomes when samples of some outputs arrive."""
        s = self.symbols(z)
        assert isinstance(self.observer, CorrectedObserver)
        observer = self.observer

        def after(u: ca.SX) -> ca.SX:
            with called("observer", observer.type, "correct"):
                new = observer.correct(self.copy(t, u, p), s, arrival, self.k)
                values = vars(s) | self._fitting(new, "correct", "value")
            return ca.vertcat(*[block.flat(values[name]) for name, block in self.states.items()])

        return apart_from(u, z, after)

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX) -> Copy:
        """The plant as the observer copies it."""
        plant = self.form.copy(t, u, p, self.canonical, self.bounds)
        if self.newton is None:
            return plant
        assert isinstance(plant, GuessingCopy)
        return plant.started_at(self.newton)
