"""What a run has given of the plants that a controller drives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import get_args

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.memory import Raw, Tolerance
from hgorun.result.records.closed import ClosedLoop
from hgorun.result.records.data import PLANT, Integration
from hgorun.simulation.checks.checks import longest_step
from hgorun.simulation.outcome.measured import Measured
from hgorun.simulation.passes.passes import Pass, carry_out, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.readout import LoopReadout
from hgorun.symbolic.evaluate import Floats


def closed_loops(run: PreparedRun, raw: Raw, found: Measured) -> dict[str, ClosedLoop]:
    """The loop with the true state, and that of every observer; nothing where no controller drives the plant."""
    return {label: _loop(run, raw, found, loop, lost) for label, loop, lost in _labelled(run, found)}


def _labelled(run: PreparedRun, found: Measured) -> Iterator[tuple[str, LoopReadout, bool]]:
    labels = [PLANT, *(b.label for b in run.observers)]
    lost = [False, *(verdict.lost for verdict in found.verdicts)]
    loops = run.structure.loops
    yield from zip(labels, loops, lost, strict=True) if loops else ()


def _loop(run: PreparedRun, raw: Raw, found: Measured, loop: LoopReadout, lost: bool) -> ClosedLoop:
    _, every_output, every_metric = run.experiment.grid
    grid, p, rows = run.grid, run.numbers.p, raw.rows[:, :, 0]
    inputs = loop.inputs.along(grid, p, rows)
    last, law = found.rows[-1], run.plant.symbolic.controller
    assert law is not None

    def known(values: Floats) -> Floats:
        return np.full_like(values, np.inf) if lost else values

    return ClosedLoop(
        x=found.rows[:, loop.x[0] : loop.x[-1] + 1],
        u=np.ascontiguousarray(inputs[::every_output]),
        y=np.ascontiguousarray(loop.outputs.along(grid[::every_output], p, found.rows)),
        integral={name: found.rows[:, place] for name, place in zip(law.integral, loop.integral, strict=True)},
        effort=known(last[loop.effort]),
        peak_input=known(np.max(np.abs(inputs[::every_metric]), axis=0)),
        cost=None if loop.cost is None else float(known(last[[loop.cost]])[0]),
    )


def outputs_at(run: PreparedRun, integration: Integration, times: Floats) -> Floats:
    """The outputs of the plant that the true state drives, at increasing times, shape (len(times), q)."""
    how = _pass_of(run, integration)
    plan, start = plan_of(run, how)
    counts = plan.counts.copy()
    counts[:, 6] = 1  # rows may lie anywhere
    rows = carry_out(run, how, replace(plan, counts=counts, grid=times), start).rows[:, :, 0]
    return run.structure.outputs.along(times, run.numbers.p, rows)


def _pass_of(run: PreparedRun, integration: Integration) -> Pass:
    """A pass like the one that gave a result."""
    method = next((name for name in get_args(Method) if name == integration.method), run.solver.given_method)
    if integration.rtol is None:
        return Pass(method=method, step=integration.step or run.step)
    longest = min(run.span, longest_step(run, run.step, adaptive=True))
    return Pass(
        method=method, step=run.step, tolerance=Tolerance(integration.rtol, None, longest, min(longest, run.step))
    )
