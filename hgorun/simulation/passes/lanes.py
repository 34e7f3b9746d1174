"""Runs of one structure as members of an ensemble."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.engine.many import Control
from hgorun.engine.program import PATIENCE
from hgorun.result.evaluation.reduction import MetricReduction
from hgorun.result.metrics.base import Metric, all_metrics
from hgorun.result.windows import MetricSettings
from hgorun.simulation.passes.passes import Pass
from hgorun.simulation.prepared import PreparedRun


def control_of(how: Pass) -> Control | None:
    """Of controlled steps side by side; runs for which so many steps may be hopeless are carried out alone."""
    if how.tolerance is None:
        return None
    return Control(tolerance=how.tolerance, limit=int(min(how.limit, PATIENCE - 1)))


def reduction_of(run: PreparedRun, metrics: Sequence[Metric] | None = None) -> MetricReduction:
    """The metrics of runs that have the grids and windows of this one, with times since the run's origin.

    Parameters
    ----------
    run : PreparedRun
    metrics : sequence of Metric, optional
        Which; by default all that are known.
    """
    blocks, every, structure = run.experiment.blocks, run.experiment.grid[2], run.structure
    known = [readout.places for readout in structure.estimates]
    places = [of for of in known if of]
    return MetricReduction(
        time=run.grid[::every],
        every=every,
        n=run.plant.model.n,
        m=len(run.observers),
        settings=MetricSettings.of(blocks.metrics, blocks.time).since(run.origin),
        metrics=tuple(all_metrics(closed=run.closed).values()) if metrics is None else tuple(metrics),
        truths=structure.truths,
        estimated=lambda p, z: structure.estimates_along(run.grid, p, z),
        closed=run.closed,
        places=places if len(places) == len(known) else None,
    )
