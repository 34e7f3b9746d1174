"""One pass through a run: its equations integrated once, with a given method and steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.memory import Raw, Start, Tolerance
from hgorun.engine.methods import METHODS, Rosenbrock
from hgorun.engine.plan import Plan
from hgorun.engine.window import Take
from hgorun.simulation.checks.checks import check_steps, longest_step
from hgorun.simulation.passes.loss import UNBOUNDED
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.timeline.steps import StepCounts, counted_steps, part_of_difference
from hgorun.simulation.timeline.tables import build_plan
from hgorun.simulation.timeline.timeline import Stepping

_DEFAULT_RTOL = 1e-8
_FIRST = 1e-4  # of the run: the first step where errors control them and none is given
_SURE_ORDER = 2
_BY_CHANCE = 3.0
_BOUND = (1e6, 1e6)  # an observer has diverged beyond 1e6 (1 + max |x|)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Pass:
    """How the equations are integrated once.

    Attributes
    ----------
    method : str
    step : float
        The longest step, where they are fixed.
    uneven : float, optional
        For a comparison with even steps: so many steps for each of them, not even.
    tolerance : Tolerance, optional
        Where an error estimate controls every step.
    limit : float
        So many steps may be tried then.
    bounded : bool
        Whether an observer is given up beyond the usual bound, and not followed until its numbers overflow; one
        that is given (``solver.divergence``) holds anyway.
    """

    method: Method
    step: float
    uneven: float | None = None
    tolerance: Tolerance | None = None
    limit: float = np.inf
    bounded: bool = True

    @property
    def evaluations_of_a_step(self) -> int:
        """Evaluations of the right-hand side; the slopes of an implicit method count as one."""
        method = METHODS[self.method]
        return len(method.c) + isinstance(method, Rosenbrock)


def as_given(run: PreparedRun) -> Pass:
    """With the step or the tolerances of the configuration, or with a first step where neither is given."""
    solver, span = run.solver, run.span
    if not run.adaptive:
        return Pass(method=solver.given_method, step=run.step)
    limit = min(solver.max_step or span, longest_step(run, run.step, adaptive=True))
    first = min(_FIRST * span if solver.step == "auto" else solver.step, limit)
    tolerance = Tolerance(solver.rtol or _DEFAULT_RTOL, solver.atol, limit, first)
    return Pass(method=solver.given_method, step=run.step, tolerance=tolerance)


def integrate(
    run: PreparedRun, how: Pass, progress: Callable[[float], None] | None = None, take: Take | None = None
) -> Raw:
    """One pass, as the engine gives it; without rows where something else takes them."""
    return carry_out(run, how, *plan_of(run, how, in_parts=True), progress, take)


def carry_out(
    run: PreparedRun,
    how: Pass,
    plan: Plan,
    start: Start,
    progress: Callable[[float], None] | None = None,
    take: Take | None = None,
    until: Sequence[int] = (),
) -> Raw:
    """One pass, from its tables."""
    program = run.structure.program(how.method, adaptive=how.tolerance is not None)
    return program.run(plan, start, how.tolerance, progress, limit=how.limit, take=take, until=until)


def integrate_lanes(runs: Sequence[PreparedRun], how: Pass) -> Raw:
    """Runs of one structure and one schedule side by side in vector registers, a lane each, with fixed steps."""
    plans, starts = zip(*(plan_of(run, how) for run in runs), strict=True)
    numbers = {name: np.column_stack([getattr(p, name) for p in plans]) for name in ("gain", "bias", "holds")}
    start = Start(np.hstack([s.z for s in starts]), np.hstack([s.p for s in starts]), starts[0].bound)
    program = runs[0].structure.program(how.method, lanes=len(runs))
    return program.run(replace(plans[0], **numbers), start)


def fixed_steps(run: PreparedRun, step: float) -> StepCounts:
    """The steps no longer than the nominal one that there are between events."""
    return counted_steps(run.schedule, longest_step(run, step))


def part_of_error(run: PreparedRun, how: Pass) -> float:
    """How large the error of fixed steps is, for a difference of one to the uneven ones that they are compared with.

    The methods of order four and five are taken to be of order two, which they are where a right-hand side has
    kinks that depend on the state: the error is rather smaller. Where observers decide at the ends of steps it is of
    order one, and two passes may come upon a condition equally late by chance.
    """
    assert how.uneven is not None
    steps, order = fixed_steps(run, how.step).steps, METHODS[how.method].order
    if run.structure.system.decides:
        return _BY_CHANCE * part_of_difference(steps, how.uneven, 1)
    return part_of_difference(steps, how.uneven, min(order, _SURE_ORDER))


def plan_of(run: PreparedRun, how: Pass, *, in_parts: bool = False) -> tuple[Plan, Start]:
    """The tables of a pass, and where it starts; ``in_parts`` as of :func:`build_plan`.

    Raises
    ------
    Problem
        Where there is no time for so many steps, or no memory for those that a continuous delay spans.
    """
    adaptive = how.tolerance is not None
    check_steps(run, how.step, adaptive=adaptive)
    plan = build_plan(
        run.timeline,
        run.structure.system,
        Stepping(
            longest=np.inf if adaptive else longest_step(run, how.step),
            always_slope=bool(METHODS[how.method].error),
            uneven=how.uneven,
        ),
        in_parts=in_parts,
    )
    divergence = run.solver.divergence
    bound = (_BOUND if how.bounded else UNBOUNDED) if divergence is None else (divergence, 0.0)
    return plan, _start(run, bound)


def _start(run: PreparedRun, bound: tuple[float, float]) -> Start:
    return Start(run.numbers.z0[:, None], run.numbers.p[:, None], bound)


@dataclass(frozen=True, eq=False, repr=False)
class Again:
    """The same pass once more, see :class:`hgorun.simulation.passes.loss.Again`."""

    run: PreparedRun
    how: Pass
    progress: Callable[[float], None] | None = None

    def plan(self, shorter: int = 1) -> Plan:
        """The tables, with steps so many times shorter, all of them."""
        longest = min(self.how.step, self.run.longest_gap)
        how = self.how if shorter == 1 else replace(self.how, step=longest / shorter)
        return plan_of(self.run, how, in_parts=True)[0]

    def integrate(self, plan: Plan, until: Sequence[int] = ()) -> Raw:
        """What they give where observers are followed until their numbers overflow."""
        fixed = self.how.tolerance is None
        return carry_out(
            self.run, self.how, plan, _start(self.run, UNBOUNDED), self.progress, until=until if fixed else ()
        )
