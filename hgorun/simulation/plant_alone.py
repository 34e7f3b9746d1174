"""The plant alone, for what has to be known of it before or beside the observers' run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hgorun.config.evaluation import zero_divisor
from hgorun.config.expressions import parse
from hgorun.config.models import Time
from hgorun.engine.layout import Held, HybridSystem, Regime
from hgorun.engine.memory import Start, Tolerance
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program
from hgorun.errors import KeyPath, Problem
from hgorun.measurement.events import Irregular, Kinks, infinite, merge, not_followed, too_many
from hgorun.measurement.extremes import Unknown, extremes, usual_rate
from hgorun.measurement.sizes import EVENT_BYTES
from hgorun.memo import Memo
from hgorun.plants.build import BuiltPlant, SymbolicPlant
from hgorun.simulation.timeline.steps import count_steps, in_pieces
from hgorun.symbolic.crossings import TooMany
from hgorun.symbolic.evaluate import evaluate

_KINKS: Memo[Kinks] = Memo(64)
_SLOPES: Memo[Kinks] = Memo(64)
_PROGRAMS: Memo[tuple[Program, ca.Function]] = Memo(16)
_STIFF: Tolerance = Tolerance(rtol=1e-9, atol=None, max_step=np.inf, first_step=np.inf)
_FIRST = 1e-4  # of the run: the first step that is tried


def plant_kinks(plant: BuiltPlant, time: Time, origin: float) -> Irregular:
    """Kinks of the plant's equations, inputs and disturbances at times that do not depend on its state.

    Raises
    ------
    Problem
        Where there are more than fit into memory, and where an expression is not finite at some time.
    """
    kinks = _kinks(plant)
    limit = time.max_memory / EVENT_BYTES
    try:
        found = kinks.between(plant.everything, time.start, time.end, limit)
    except TooMany as error:
        raise Problem(("plant",), too_many(error, "the plant's functions of time", time.max_memory)) from None
    if found.infinite is not None and not plant.block.discretise:
        _refuse(plant, time, origin)
    return found


def _kinks(plant: BuiltPlant) -> Kinks:
    symbolic, t = plant.symbolic, plant.model.t
    return _KINKS.get(symbolic, lambda: Kinks.of(_functions(symbolic), t, symbolic.everything))


def breaks_in_time(plant: BuiltPlant) -> bool:
    """Whether there may be such kinks at any time."""
    return bool(_kinks(plant).pieces.kinks)


def plant_extremes(plant: BuiltPlant, time: Time) -> Irregular:
    """Extremes of the plant's functions of time, which no step should pass over."""
    return extremes(_slopes(plant), plant.everything, time.start, time.end)


def _slopes(plant: BuiltPlant) -> Kinks:
    symbolic, t = plant.symbolic, plant.model.t
    return _SLOPES.get(symbolic, lambda: Kinks.of_slopes(_functions(symbolic), t, symbolic.everything))


def plant_unknown(plant: BuiltPlant, time: Time, origin: float) -> list[Unknown]:
    """The plant's functions of time, where their extremes may not all have been found."""
    lost = tuple((origin + a, origin + b) for a, b in plant_extremes(plant, time).lost)
    if not lost:
        return []
    rate = usual_rate(_slopes(plant), plant.everything, time.start, time.end)
    return [Unknown("plant", True, lost, (time.end - time.start) * rate)]


def _functions(plant: SymbolicPlant) -> list[ca.SX]:
    """All that is a function of time or holds one: inputs, disturbances, derivatives and outputs."""
    model = plant.model
    equations = [function(model.t, model.x, plant.inputs, model.p) for function in (model.f, model.h)]
    return [plant.inputs, plant.disturbance, *equations]


def plant_remarks(plant: BuiltPlant, time: Time, origin: float) -> list[str]:
    """What is said of functions whose kinks could not all be found."""
    told: dict[tuple[tuple[float, float], ...], str] = {}
    if plant_kinks(plant, time, origin).lost:
        for path, one in _each(plant, time):  # an input first, then the equations that hold it
            told.setdefault(one.lost, ".".join(map(str, path)))
    return [not_followed(path, lost, origin) for lost, path in told.items() if lost]


def _refuse(plant: BuiltPlant, time: Time, origin: float) -> None:
    """Say which of the functions is not finite."""
    for path, one in _each(plant, time):
        if one.infinite is not None:
            raise Problem(path, divided_by_zero(plant, path) or infinite(origin + one.infinite))


def divided_by_zero(plant: BuiltPlant, path: KeyPath) -> str | None:
    """What is said of an equation of the plant that divides by a parameter whose value is 0; None of others."""
    text = plant.block.expressions().get(tuple(map(str, path[1:])))
    if text is None:
        return None
    values = dict(zip(plant.model.parameters, plant.parameters.tolist(), strict=True))
    name = zero_divisor(parse(text).tree, values)
    return None if name is None else f"a division by {name}, which is 0"


def _each(plant: BuiltPlant, time: Time) -> Iterator[tuple[KeyPath, Irregular]]:
    """What is irregular in each of the functions, and where it stands in the file."""
    model, block = plant.model, plant.block
    places: list[list[KeyPath]] = [
        [("plant", "inputs", name) for name in model.inputs],
        [("plant", "disturbance", name) for name in model.states],
        [("plant", *block.place_of(name)) for name in model.states],
        [("plant",) for _ in model.outputs],
    ]
    for functions, paths in zip(_functions(plant.symbolic), places, strict=True):
        for function, path in zip(ca.vertsplit(functions), paths, strict=True):
            kinks = Kinks.of([function], model.t, plant.symbolic.everything)
            yield path, kinks.between(plant.everything, time.start, time.end)


@dataclass(frozen=True, eq=False, repr=False)
class PlantRun:
    """x(t) and the integral of y^2, with steps that land on the kinks.

    Attributes
    ----------
    time : Time
        Counted from the start of the run.
    step : float
        Of RK4.
    origin : float
        That start on the configuration's clock.
    stiff : bool
        The method for stiff equations takes the place of RK4, with steps of its own.
    """

    plant: BuiltPlant
    time: Time
    step: float
    origin: float = 0.0
    stiff: bool = False

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (len(times), q) and the integral of their squares (q,) to the end; times increase."""
        grid, rows = np.append(times, self.time.end), self._rows(times)
        (y,) = evaluate(self._compiled[1], grid[:, None], self.plant.everything, rows)
        return y[:-1], rows[-1, self.plant.model.n :].copy()

    def states(self, times: np.ndarray) -> np.ndarray:
        """x at some times, which increase, shape (len(times), n)."""
        return self._rows(times)[:-1, : self.plant.model.n]

    @property
    def _compiled(self) -> tuple[Program, ca.Function]:
        symbolic = self.plant.symbolic
        return _PROGRAMS.get((symbolic, self.stiff), lambda: _compiled(symbolic, stiff=self.stiff))

    def _rows(self, times: np.ndarray) -> np.ndarray:
        """x and the integral of y^2 at some times and at the end."""
        program, _ = self._compiled
        start, end = self.time.start, self.time.end
        times_of_change = plant_kinks(self.plant, self.time, self.origin).times
        if self.stiff:  # no controlled step may pass over a pulse
            times_of_change = np.concatenate([times_of_change, plant_extremes(self.plant, self.time).times])
        apart = 16 * np.spacing(max(abs(start), abs(end)))
        kinks = merge(times_of_change, apart)
        ends = np.concatenate([[start], kinks[(kinks > start + apart) & (kinks < end - apart)], [end]])
        steps = count_steps(np.diff(ends), np.inf if self.stiff else self.step)
        zero = np.zeros_like(steps)
        spans = np.column_stack([ends[:-1], ends[1:]] * 2)
        inward = 4 * np.spacing(np.maximum(np.abs(ends), self.step))
        inward[0] = inward[0] + apart if np.any(kinks <= start + apart) else 0.0
        inward[-1] = inward[-1] + apart if np.any(kinks >= end - apart) else 0.0
        spans[:, 2] += inward[:-1]
        spans[:, 3] -= inward[1:]
        spans, counts = in_pieces(spans, np.column_stack([steps, zero, steps, zero, zero, zero, zero + 1]))
        nothing = np.zeros(0)
        plan = Plan(
            spans=spans, counts=counts, actions=np.zeros((0, 5), dtype=np.int64), grid=np.append(times, end), slots=0,
            gain=nothing, bias=nothing, holds=nothing, origin=self.origin,
        )  # fmt: skip
        parameters = self.plant.everything
        z0 = np.concatenate([self.plant.initial, np.zeros(len(self.plant.model.outputs))])
        tolerance = replace(_STIFF, first_step=_FIRST * (end - start)) if self.stiff else None
        return program.run(plan, Start(z0[:, None], parameters[:, None]), tolerance).rows[:, :, 0]

    def mean_squares(self) -> np.ndarray:
        """Mean over the run of every noise-free output squared, shape (q,)."""
        return self.at(np.zeros(0))[1] / (self.time.end - self.time.start)


def _compiled(plant: SymbolicPlant, *, stiff: bool) -> tuple[Program, ca.Function]:
    """The plant's states with the integrals of y^2 behind them; and y from (t, p, z)."""
    model, held = plant.model, Held(0, 0)
    size = model.n + len(model.outputs)
    z, w = ca.SX.sym("z", size), ca.SX.sym("w", held.size)
    x = z[: model.n]
    y = model.h(model.t, x, plant.inputs, model.p)
    dx = model.f(model.t, x, plant.inputs, model.p) + plant.disturbance
    p = plant.everything
    arguments = [model.t, p, z, w]
    flow = ca.Function("flow", arguments, [ca.densify(ca.cse(ca.vertcat(dx, y * y)))])
    nothing = ca.Function("nothing", arguments, [ca.SX(0, 1)])
    system = HybridSystem(size, model.n, p.numel(), held, (), (), (Regime(flow),), nothing, nothing)
    program = Program(system, "rodas5p", adaptive=True) if stiff else Program(system, "rk4")
    return program, ca.Function("y", [model.t, p, z], [ca.densify(y)])
