"""The equations of an observer by itself, as expressions and as operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.config.expressions import parse
from hgorun.engine.layout import Held
from hgorun.export.operations import Operations, operations
from hgorun.measurement.availability import Stretch
from hgorun.measurement.variants import HELD
from hgorun.observers.base import AnyObserver, ContinuousObserver, CorrectedObserver, SampledObserver
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.design.design import Design
from hgorun.simulation.system.groups import Group
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.system import build_system
from hgorun.simulation.system.truth import PlantNumbers, Recording
from hgorun.symbolic.clock import on_the_clock
from hgorun.symbolic.parameters import Parameters


@dataclass(frozen=True, eq=False, repr=False)
class Output:
    """How an output reaches the observer.

    Attributes
    ----------
    name : str
    sampled, continuous : bool
        What it is in some phase of the run.
    delay : str or None
        Of a continuous output that is late: a number, or an expression of the clock.
    period : float or None
        What it is known up to, of an angle.
    late : bool
        Whether its samples may be known later than they were taken.
    """

    name: str
    sampled: bool
    continuous: bool
    delay: str | None
    period: float | None
    late: bool

    @property
    def remembered(self) -> bool:
        """Whether what the observer has thought of it before is needed."""
        return self.late or self.delay is not None


def outputs_of(stretches: Sequence[Sequence[Stretch]], plant: BuiltPlant, late: Sequence[bool]) -> tuple[Output, ...]:
    """How the outputs reach an observer, over all phases of a run.

    Raises
    ------
    ValueError
        Where it cannot be exported.
    """
    periods = plant.model.periods or (None,) * len(plant.model.outputs)
    found = []
    for name, of, period, is_late in zip(plant.model.outputs, stretches, periods, late, strict=True):
        delays = {stretch.delay for stretch in of if stretch.continuous}
        if len(delays) > 1:
            raise ValueError(f"the delay of the continuous output {name} differs from phase to phase")
        undelayed = all(stretch.undelayed for stretch in of if stretch.continuous)
        found.append(
            Output(
                name,
                sampled=any(not stretch.continuous for stretch in of),
                continuous=bool(delays),
                delay=None if undelayed else delays.pop(),
                period=period,
                late=is_late and any(not stretch.continuous for stretch in of),
            )
        )
    return tuple(found)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Symbolic:
    """An observer by itself as expressions.

    Attributes
    ----------
    block : ObserverBlock
        Its states lie in z from 0 on.
    arguments, jump_arguments : list of casadi.SX
        t, p, z and w of the equations, and of the jump.
    values : ndarray
        Of p.
    outputs : dict of str to casadi.SX
        ``rate``, ``estimate``, ``guess`` and what a history needs.
    jump : casadi.SX or None
        What z becomes at a sample.
    held : Held
        The layout of w of the jump.
    """

    block: ObserverBlock
    arguments: list[ca.SX]
    values: np.ndarray
    outputs: dict[str, ca.SX]
    jump: ca.SX | None
    jump_arguments: list[ca.SX]
    held: Held


def symbolic(
    design: Design, plant: BuiltPlant, outputs: Sequence[Output], origin: float, *, told: tuple[int, ...]
) -> Symbolic:
    """The equations of an observer by itself."""
    has_alpha = compares(design.observer) and any(o.sampled or o.delay for o in outputs)
    t, parameters, model = plant.model.t, Parameters(), plant.model
    count = model.p.numel()
    symbols = PlantNumbers(
        parameters.add("plant", plant.everything[:count]), parameters.add("numbers", plant.everything[count:])
    )
    block = ObserverBlock.place(design, 0, has_alpha, parameters)
    p, own = parameters.symbol, symbols.parameters
    z, q, m = ca.SX.sym("z", block.end), len(model.outputs), len(told)
    w = ca.SX.sym("w", 2 * m + q + block.end)
    given, du, e, dz = ca.vertsplit(w, [0, m, 2 * m, 2 * m + q, w.numel()])
    u = ca.SX(symbols.of(plant.symbolic, plant.symbolic.inputs))
    for i, number in enumerate(told):
        u[number] = given[i]
    guess = block.guess(t, u, own, z)
    results = {"estimate": block.estimate(t, u, own, z), "guess": guess}
    if isinstance(design.observer, ContinuousObserver):
        results["rate"] = block.flow(t, u, own, z, e)
    remembered = [i for i, output in enumerate(outputs) if output.remembered]
    if remembered:
        past = (guess - block.symbols(z).alpha)[remembered]
        slope = ca.jtimes(past, z, dz) + ca.jacobian(past, t)
        results["past"] = past
        results["past_rate"] = slope + ca.jtimes(past, given, du) if m else slope
        clock = {"t": on_the_clock(t, origin)}
        delays = [parse(o.delay, names=("t",)).symbol(clock) for o in outputs if o.delay is not None]
        if delays:
            results["delay"] = ca.vertcat(*delays)
    jump, held, of_jump = None, Held(q, 1, m), w
    if isinstance(design.observer, (SampledObserver, CorrectedObserver)):
        jump, held, of_jump = _at_samples(block, plant, symbols, p, z, told, has_alpha=has_alpha)
    return Symbolic(
        block=block,
        arguments=[t, p, z, w],
        values=parameters.values,
        outputs=results,
        jump=jump,
        jump_arguments=[t, p, z, of_jump],
        held=held,
    )


def _at_samples(
    block: ObserverBlock,
    plant: BuiltPlant,
    symbols: PlantNumbers,
    p: ca.SX,
    z: ca.SX,
    told: tuple[int, ...],
    *,
    has_alpha: bool,
) -> tuple[ca.SX, Held, ca.SX]:
    """What z becomes at a sample, the layout of w in it, and w; inputs are told as they are at the sample."""
    t = plant.model.t
    variants = [((HELD, 0),) * len(plant.model.outputs)] if has_alpha else []
    system = build_system([Group(Recording(plant.symbolic, told), 0, (block,))], t, p, symbols, {}, variants)
    ((_, _, function),) = system.jumps
    w = ca.SX.sym("w", system.held.size)
    still = ca.SX(w)
    for _, slope_at, since, _ in map(system.held.input, range(len(told))):
        still[slope_at] = still[since] = 0
    return function(t, p, z, still), system.held, w


@dataclass(frozen=True, eq=False, repr=False)
class Equations:
    """The operations of an observer, and the block that they belong to."""

    block: ObserverBlock
    flow: Operations
    jump: Operations | None
    held: Held


def equations_of(
    design: Design, plant: BuiltPlant, outputs: Sequence[Output], origin: float, *, told: tuple[int, ...]
) -> Equations:
    """The operations of an observer by itself, with the numbers of its design and of the plant in them."""
    found = symbolic(design, plant, outputs, origin, told=told)
    flow = _operations("equations", found.arguments, found.outputs, found.values)
    jump = None
    if found.jump is not None:
        jump = _operations("jump", found.jump_arguments, {"jump": found.jump}, found.values)
    return Equations(found.block, flow, jump, found.held)


def compares(observer: AnyObserver) -> bool:
    """Whether an observer is driven by the one innovation between samples."""
    return isinstance(observer, ContinuousObserver) and not isinstance(observer, CorrectedObserver)


def _operations(name: str, arguments: list[ca.SX], results: dict[str, ca.SX], values: np.ndarray) -> Operations:
    expressions = ca.cse([ca.densify(result) for result in results.values()])
    function = ca.Function(name, arguments, expressions, ["t", "p", "z", "w"], list(results))
    return operations(function, values)
