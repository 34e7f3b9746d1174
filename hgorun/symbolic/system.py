"""Plant and observers as one hybrid system: the structure that the engine compiles, and its numbers.

Numbers (parameters, gains, noise amplitudes, saturation bounds) are run-time arguments of the compiled
code; what is built in is the structure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from hgorun.engine.layout import CONTINUOUS, DELAYED, HELD, SILENT, Structure, Variant, is_delayed
from hgorun.errors import Problem
from hgorun.observers.base import Observer
from hgorun.plants.build import BuiltPlant
from hgorun.symbolic.canonical import CanonicalForm, singular_value_ratio
from hgorun.symbolic.copy import PlantCopy


@dataclass(frozen=True)
class Signal:
    """A continuous output in one phase: v(t) without its held part, how it enters, and the delay."""

    noise: ca.SX
    multiplicative: bool
    delay: ca.SX


@dataclass(frozen=True)
class StateBlock:
    """An internal state of an observer: where it lies in z and its shape."""

    start: int
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        return prod(self.shape)


class Parameters:
    """The vector p: named groups of numbers, each with a symbol."""

    def __init__(self) -> None:
        self._symbols: list[ca.SX] = []
        self._values: list[np.ndarray] = []

    def add(self, name: str, values: Any) -> ca.SX:
        """Append an array; returns its symbol, of the same shape (at most two dimensions)."""
        array = np.asarray(values, dtype=float)
        rows, columns = (array.shape + (1, 1))[:2]
        symbol = ca.SX.sym(name, rows, columns)
        self._symbols.append(ca.vec(symbol))
        self._values.append(array.reshape(rows, columns).ravel(order="F"))
        return symbol

    @property
    def symbol(self) -> ca.SX:
        return ca.vertcat(*self._symbols) if self._symbols else ca.SX(0, 1)

    @property
    def values(self) -> np.ndarray:
        return np.concatenate(self._values) if self._values else np.zeros(0)


class ObserverBlock:
    """One observer in the system: its states in z, its equations, its way back to the plant's coordinates."""

    def __init__(
        self,
        label: str,
        observer: Observer,
        form: CanonicalForm,
        start: int,
        has_alpha: bool,
        parameters: Parameters,
    ) -> None:
        self.label, self.observer, self.form = label, observer, form
        self.canonical = observer.coordinates == "canonical"
        self._check(has_alpha)
        self.design = self._design()
        self.k = SimpleNamespace(**{n: parameters.add(f"{label}.{n}", v) for n, v in self.design.items()})
        self.bounds = {
            form.plant.states.index(s): tuple(ca.vertsplit(parameters.add(f"{label}.sat.{s}", interval)))
            for s, interval in observer.saturation.items()
        }
        defaults = {"xhat": np.zeros(form.plant.n), **observer.states(form)}
        if has_alpha:
            defaults["alpha"] = np.zeros(len(form.plant.outputs))
        self.defaults, self.states = defaults, {}
        for name, value in defaults.items():
            self.states[name] = StateBlock(start, value.shape)
            start += value.size
        self.stop = start - (defaults["alpha"].size if has_alpha else 0)
        self.end = start
        self.start = self.states["xhat"].start

    def _fail(self, key: str, message: str) -> Problem:
        path = ("observers", self.label, key) if key else ("observers", self.label)
        return Problem(path, message)

    def _check(self, has_alpha: bool) -> None:
        states = self.form.plant.states
        for key in ("initial", "saturation"):
            for name in getattr(self.observer, key):
                if name not in states:
                    raise self._fail(
                        key, f"unknown state {name!r}; the plant's states are {', '.join(states)}"
                    )
        if self.canonical and not self.form.identity and self.form.plant.inverse is None:
            raise self._fail("coordinates", "this plant gives no inverse of its canonical map; use original")

    def _design(self) -> dict[str, np.ndarray]:
        try:
            return self.observer.design(self.form)
        except Problem as problem:
            raise Problem(("observers", self.label, *problem.path), problem.message) from problem

    def symbols(self, z: ca.SX) -> SimpleNamespace:
        """The observer's states as parts of z, in their shapes."""
        found = {}
        for name, block in self.states.items():
            flat = z[block.start : block.start + block.size]
            rows, columns = (block.shape + (1, 1))[:2]
            found[name] = flat if columns == 1 else ca.reshape(flat, columns, rows).T
        return SimpleNamespace(**found)

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX) -> PlantCopy:
        return PlantCopy(self.form, t, u, p, self.canonical, self.bounds)

    def flow(self, t: ca.SX, u: ca.SX, p: ca.SX, z: ca.SX, e: ca.SX) -> ca.SX:
        """d/dt of the block, alpha' = -c last."""
        flow = self.observer.equations(self.copy(t, u, p), self.symbols(z), e, self.k)
        derivatives = dict(flow.derivatives)
        if "alpha" in self.states:
            derivatives["alpha"] = -flow.correction
        parts = []
        for name, block in self.states.items():
            columns = (block.shape + (1, 1))[1]
            value = derivatives[name]
            parts.append(value if columns == 1 else ca.vec(value.T))
        return ca.vertcat(*parts)

    def initial(self, plant: BuiltPlant) -> np.ndarray:
        """z of this block at the start."""
        states, observer = self.form.plant.states, self.observer
        x = np.array([observer.initial.get(s, 0.0) for s in states])
        values = {name: np.array(value) for name, value in self.defaults.items()}
        p = ca.DM(plant.parameters)
        jacobian = np.asarray(self.form.J(ca.DM(x), p).full())
        if not singular_value_ratio(jacobian) > 1e-12:
            at = ", ".join(f"{s} = {v:g}" for s, v in zip(states, x, strict=True))
            raise self._fail(
                "initial", f"the Jacobian of the observability map is singular at the initial estimate ({at})"
            )
        values["xhat"] = np.asarray(self.form.Phi(ca.DM(x), p).full()).ravel() if self.canonical else x
        for name, given in observer.internal.items():
            if name not in values or name == "xhat":
                known = ", ".join(n for n in values if n != "xhat") or "none"
                raise self._fail("internal", f"unknown internal state {name!r}; this observer has: {known}")
            values[name] = self._internal(name, given, values[name].shape)
        return np.concatenate([values[name].ravel() for name in self.states])

    def _internal(self, name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray:
        try:
            array = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            array = np.array(np.nan)
        if not np.all(np.isfinite(array)) or array.ndim and array.size != prod(shape):
            raise self._fail(
                "internal", f"{name}: expected a number or {prod(shape)} numbers, found {given!r}"
            )
        return np.full(shape, array) if array.ndim == 0 else array.reshape(shape)


@dataclass(frozen=True)
class System:
    """The whole system.

    Attributes
    ----------
    structure : Structure
        For the engine.
    p, z0 : ndarray
        Numbers of this run: parameters and initial state.
    observers : list of ObserverBlock
    report : casadi.Function
        (t, p, z) -> (u, y, xhat of every observer in the plant's coordinates).
    """

    plant: BuiltPlant
    structure: Structure
    p: np.ndarray
    z0: np.ndarray
    observers: list[ObserverBlock]
    report: ca.Function


def build_system(
    plant: BuiltPlant,
    form: CanonicalForm | None,
    observers: Mapping[str, Observer],
    signals: Mapping[tuple[int, int], Signal],
    variants: Sequence[Variant],
    parameters: Parameters,
    plant_symbol: ca.SX,
) -> System:
    """Put plant and observers together.

    Parameters
    ----------
    form : CanonicalForm, optional
        Needed as soon as there are observers.
    signals : mapping of (output, phase) to Signal
        The continuous outputs.
    variants : sequence of Variant
        The combinations of availabilities that occur.
    parameters : Parameters
        Already holding the plant's parameters (``plant_symbol``) and the noise's.

    Raises
    ------
    Problem
        When an observer's block does not fit the plant.
    """
    model = plant.model
    t, n, q = model.t, model.n, len(model.outputs)
    has_alpha = any(what in (HELD, DELAYED) for variant in variants for what, _ in variant)
    blocks: list[ObserverBlock] = []
    start = n
    for label, observer in observers.items():
        assert form is not None
        blocks.append(ObserverBlock(label, observer, form, start, has_alpha, parameters))
        start = blocks[-1].end
    z = ca.SX.sym("z", start)
    w = ca.SX.sym("w", q * (2 + len(blocks)))
    p = parameters.symbol
    u = ca.substitute(plant.inputs, model.p, plant_symbol)
    disturbance = ca.substitute(plant.disturbance, model.p, plant_symbol)
    x = z[:n]
    y = model.h(t, x, u, plant_symbol)
    dx = model.f(t, x, u, plant_symbol) + disturbance
    guesses = [b.copy(t, u, plant_symbol).output(b.symbols(z).xhat) for b in blocks]
    alphas = [b.symbols(z).alpha if has_alpha else ca.SX.zeros(q) for b in blocks]

    def innovation(j: int, variant: Variant) -> ca.SX:
        """C xhat(t-d) - y_d(t) + alpha(t) - alpha(t-d), output by output."""
        parts = []
        for i, (what, phase) in enumerate(variant):
            held = w[i * (2 + len(blocks)) :]
            s = held[2 + j]
            if what == SILENT:
                parts.append(ca.SX(0))
            elif what == HELD:
                parts.append(s + alphas[j][i] - held[1])
            elif what == CONTINUOUS:
                parts.append(guesses[j][i] - _measured(y[i], held[0], signals[i, phase]))
            else:
                parts.append(s + alphas[j][i] - _measured(held[1], held[0], signals[i, phase]))
        return ca.vertcat(*parts)

    def compiled(name: str, expression: ca.SX, last: ca.SX = w) -> ca.Function:
        return ca.Function(name, [t, p, z, last], [ca.densify(ca.cse(expression))])

    flows = {}
    for v in variants:
        parts = [b.flow(t, u, plant_symbol, z, innovation(j, v)) for j, b in enumerate(blocks)]
        flows[v] = compiled("flow", ca.vertcat(dx, *parts))
    lags = {
        v: compiled(
            "lags",
            ca.vertcat(*[signals[i, ph].delay if what == DELAYED else 0 for i, (what, ph) in enumerate(v)]),
        )
        for v in variants
        if is_delayed(v)
    }
    channels = ca.vertcat(
        *[ca.vertcat(y[i], *[g[i] - a[i] for g, a in zip(guesses, alphas, strict=True)]) for i in range(q)]
    )
    dz = ca.SX.sym("dz", start)
    slopes = ca.jtimes(channels, z, dz) + ca.jacobian(channels, t)
    structure = Structure(
        states=start,
        plant_states=n,
        held=w.numel(),
        parameters=p.numel(),
        outputs=q,
        observers=len(blocks),
        has_alpha=has_alpha,
        blocks=tuple((b.start, b.stop, b.end) for b in blocks),
        flows=flows,
        lags=lags,
        channels=compiled("channels", channels),
        channel_slopes=compiled("trace", ca.vertcat(channels, slopes), dz),
    )
    estimates = [b.copy(t, u, plant_symbol).state(b.symbols(z).xhat) for b in blocks]
    report = ca.Function("report", [t, p, z], [ca.densify(e) for e in (u, y, *estimates)])
    z0 = np.concatenate([plant.initial, *[b.initial(plant) for b in blocks]])
    return System(plant, structure, parameters.values, z0, blocks, report)


def _measured(y: ca.SX, held: ca.SX, signal: Signal) -> ca.SX:
    v = signal.noise + held
    return y * (1 + v) if signal.multiplicative else y + v
