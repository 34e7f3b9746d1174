"""How the run of exported observers is integrated, and what becomes of them in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from hgorun.engine.early import NONE, Early
from hgorun.engine.plan import Plan
from hgorun.errors import Problem
from hgorun.estimate.carrying import Carried, carry_out
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.scores.why_left import why_left
from hgorun.estimate.steps.first_steps import early
from hgorun.result.records.status import OK, Verdict
from hgorun.simulation.checks.checks import longest_step
from hgorun.simulation.error_control.control import Controlled, controlled
from hgorun.simulation.passes.passes import Pass, as_given, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import simulate_prepared

_ADVICE = "give a fixed one, as in solver: {method: rk4, step: 0.01}"


@dataclass(frozen=True, eq=False, repr=False)
class Steps:
    """How a run is integrated.

    Attributes
    ----------
    method : str
    step : float
        The longest step.
    plan : callable
        The tables of the run with these steps.
    early : Early
        Where the first ones end that are shorter.
    """

    method: str
    step: float
    plan: Callable[[], Plan]
    early: Early = NONE


class Integrated(Protocol):
    """A run as its observers are integrated in it; found when it is asked for, and once."""

    @property
    def steps(self) -> Steps:
        """The method and the fixed step; a Problem where there is none."""

    @property
    def verdicts(self) -> Mapping[str, Verdict]:
        """What becomes of every observer, by its label, with times on the clock of the configuration."""


class OfRun:
    """A simulated run: its steps are those of the configuration, or those that error control has found."""

    def __init__(self, run: PreparedRun) -> None:
        self._run = run

    @cached_property
    def _controlled(self) -> Controlled:
        return controlled(self._run)

    @cached_property
    def steps(self) -> Steps:
        """See :class:`Integrated`; there are none with tolerances, or where each step solves equations."""
        run, solver = self._run, self._run.solver
        _check_method(solver.method)
        if solver.adaptive:
            raise Problem(
                ("solver", "rtol"), f"the number of steps between two samples has no bound with rtol; {_ADVICE}"
            )
        how = as_given(run)
        if solver.controlled:
            found = self._controlled.integration
            if found.step is None or found.method is None:
                message = (
                    f"no fixed step reaches the accuracy {solver.accuracy:g} in this run (where a right-hand side "
                    "jumps, as with sign, none may): give one, as in solver: {method: rk4, step: 0.01}; hgorun "
                    "simulate --check-step tells its error"
                )
                raise Problem(("solver", "step"), message)
            how = Pass(method=found.method, step=found.step)  # type: ignore[arg-type]  # one of the methods
        return Steps(how.method, longest_step(run, how.step), lambda: plan_of(run, how)[0])

    @cached_property
    def verdicts(self) -> Mapping[str, Verdict]:
        """See :class:`Integrated`; with a given step the run is simulated for them."""
        run = self._run
        if run.solver.controlled:
            found = self._controlled.measured.verdicts
            return {b.label: v.since(-run.origin) for b, v in zip(run.observers, found, strict=True)}
        return {label: one.verdict for label, one in simulate_prepared(run).observers.items()}


class OfData:
    """An estimate of recorded data."""

    def __init__(self, prepared: PreparedEstimate) -> None:
        self._prepared = prepared
        self._grid = np.array([0.0, prepared.run.span])

    @cached_property
    def _carried(self) -> Carried:
        return carry_out(self._prepared, self._grid, once=True)  # as the code that is written

    @cached_property
    def steps(self) -> Steps:
        """See :class:`Integrated`."""
        prepared = self._prepared
        _check_method(prepared.run.solver.method)
        step = self._carried.step if prepared.run.solver.controlled else prepared.run.step
        first = early(prepared.experiment, prepared.run.step)
        return Steps(prepared.method, step, lambda: prepared.plan(self._grid, step), first)

    @cached_property
    def verdicts(self) -> Mapping[str, Verdict]:
        """See :class:`Integrated`."""
        return {b.label: self._verdict(j) for j, b in enumerate(self._prepared.run.observers)}

    def _verdict(self, j: int) -> Verdict:
        lost = float(self._carried.raw.diverged[j, 0])
        if not np.isfinite(lost):
            return OK
        reason = why_left(self._prepared, j, lost, self._carried.step)
        return Verdict("diverged", self._prepared.run.origin + lost, reason)


def _check_method(method: str) -> None:
    if method == "rodas5p":
        raise Problem(
            ("solver", "method"),
            "rodas5p solves linear equations in every step; exported observers take explicit steps: choose euler, rk4 "
            "or dopri5",
        )
