"""One observer inside the system: its states in z, its equations, its way back to the plant's coordinates."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.errors import Problem
from hgorun.observers.base import AnyObserver, ContinuousObserver, Flow, Sample, SampledObserver
from hgorun.plants.build import BuiltPlant
from hgorun.symbolic.forms import Copy, Form, ModelCopy
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols


class ObserverBlock:
    """An observer with a place in the state vector and its numbers among the parameters.

    Attributes
    ----------
    states : dict of str to StateBlock
        xhat, the observer's own states, and alpha where the measurement needs it.
    start, stop, end : int
        [start, stop) is watched for divergence; [stop, end) is alpha.
    """

    def __init__(
        self, label: str, observer: AnyObserver, form: Form, start: int, has_alpha: bool, parameters: Parameters
    ) -> None:
        self.label, self.observer, self.form = label, observer, form
        self.canonical = observer.coordinates == "canonical"
        self._check()
        try:
            self.design = observer.design(form)
        except Problem as problem:
            raise Problem(("observers", label, *problem.path), problem.message) from problem
        self.k = Symbols({n: parameters.add(f"{label}.{n}", v) for n, v in self.design.items()})
        self.bounds = {}
        for state, interval in observer.saturation.items():
            both = parameters.add(f"{label}.sat.{state}", interval)
            self.bounds[state] = (both[0], both[1])
        self.defaults: dict[str, np.ndarray | Symmetric] = {"xhat": np.zeros(form.plant.n), **observer.states(form)}
        if has_alpha:
            self.defaults["alpha"] = np.zeros(len(form.plant.outputs))
        self.states: dict[str, StateBlock] = {}
        self.start = self.end = start
        for name, value in self.defaults.items():
            self.states[name] = StateBlock.of(self.end, value)
            self.end += self.states[name].size
        self.stop = self.states["alpha"].start if has_alpha else self.end

    def _fail(self, key: str, message: str) -> Problem:
        return Problem(("observers", self.label, key), message)

    def _check(self) -> None:
        names = {"initial": self.form.plant.states, "saturation": self.form.saturable(self.canonical)}
        for key, known in names.items():
            for name in getattr(self.observer, key):
                if not known:
                    raise self._fail(key, f"{self.observer.type} has no state that could be given here")
                if name not in known:
                    raise self._fail(key, f"unknown state {name!r}; here they are {', '.join(known)}")

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
        flow = self.observer.equations(copy, s, e, self.k)
        correction = self._felt(copy, s.xhat, flow) if flow.correction is None else flow.correction
        return dict(flow.derivatives), correction

    def _felt(self, copy: Copy, xhat: ca.SX, flow: Flow) -> ca.SX:
        """C_x (copy(xhat) - xhat'): what the outputs of the estimate feel beside the copy of the plant."""
        if not isinstance(copy, ModelCopy):
            raise Problem(
                ("observers", self.label, "type"),
                f"{type(self.observer).__name__} has no copy of the plant: the Flow of its equations has to give "
                "its correction",
            )
        return ca.jtimes(copy.output(xhat), xhat, copy.copy(xhat) - flow.derivatives["xhat"])

    def jump(self, t: ca.SX, u: ca.SX, u_before: ca.SX, p: ca.SX, z: ca.SX, sample: Sample) -> ca.SX:
        """What the block becomes when a sample arrives."""
        plant, before = self.copy(t, u, p), self.copy(t - sample.interval, u_before, p)
        s = self.symbols(z)
        assert isinstance(self.observer, SampledObserver)
        values = {**vars(s), **self.observer.jump(plant, before, s, sample, self.k)}
        return ca.vertcat(*[block.flat(values[name]) for name, block in self.states.items()])

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX) -> Copy:
        """The plant as the observer copies it."""
        return self.form.copy(t, u, p, self.canonical, self.bounds)

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        """z of this block at the start."""
        observer = self.observer
        x = np.array([observer.initial.get(s, 0.0) for s in self.form.plant.states])
        values = {n: v.values if isinstance(v, Symmetric) else v for n, v in self.defaults.items()}
        try:
            values["xhat"] = self.form.start(x, plant.parameters, self.canonical)
        except ValueError as error:
            raise self._fail("initial", str(error)) from error
        for name, given in observer.internal.items():
            if name not in values or name == "xhat":
                known = ", ".join(n for n in values if n != "xhat") or "none"
                raise self._fail("internal", f"unknown internal state {name!r}; this observer has: {known}")
            try:
                values[name] = self.states[name].initial(given, values[name])
            except ValueError as error:
                raise self._fail("internal", f"{name}: {error}") from error
        return np.concatenate([self.states[name].numbers(np.asarray(v)) for name, v in values.items()])
