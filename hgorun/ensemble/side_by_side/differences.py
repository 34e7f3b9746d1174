"""How far two passes through the members of a lot are apart, as for single runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.ensemble.found import Floats
from hgorun.ensemble.preparation.lot import Lot
from hgorun.ensemble.side_by_side.lanes import Passed
from hgorun.result.windows import MetricSettings, points_in
from hgorun.simulation.error_control.error_estimate import Estimate, difference, plant_difference, size_of
from hgorun.simulation.prepared import PreparedRun


def differences(lot: Lot, fine: Passed, coarse: Passed) -> Floats:
    """How far two passes are apart, for the plant and every observer: shape (1 + m, N)."""
    run, n = lot.run, lot.run.plant.model.n
    assert fine.rows is not None
    assert coarse.rows is not None
    shown = slice(None, None, run.experiment.grid[1])
    found = [plant_difference(fine.rows[shown, :n], coarse.rows[shown, :n])]
    of_truth: dict[int, tuple[Floats, Floats, Floats]] = {}
    for j, truth in enumerate(run.structure.truths):
        own = slice(truth[0], truth[-1] + 1)
        if truth[0] not in of_truth:  # of an open loop all observers have the same
            x = fine.rows[shown, own]
            apart = plant_difference(x, coarse.rows[shown, own])
            of_truth[truth[0]] = size_of(x), _moved(run, fine.rows, truth), apart
        size, moved, apart = of_truth[truth[0]]
        ours, theirs = (
            Estimate(
                x=one.rows[shown, own],
                xhat=_estimates(lot, one.rows, j)[shown],
                metrics={name: values[j] for name, values in one.metrics.items()},
            )
            for one in (fine, coarse)
            if one.rows is not None
        )
        of_estimate = difference(run, ours, theirs, size, moved)
        found.append(np.maximum(of_estimate, apart) if run.closed else of_estimate)
    return np.array(found)


def _estimates(lot: Lot, rows: Floats, j: int) -> Floats:
    """The estimates of an observer along the run, shape (grid points, n, N)."""
    run = lot.run
    readout = run.structure.estimates[j]
    if readout.places is not None:
        return rows[:, readout.places]
    own = [readout.along(run.grid, lot.numbers.p[:, i], rows[:, :, i]) for i in range(rows.shape[2])]
    return np.stack(own, axis=2)


def _moved(run: PreparedRun, rows: Floats, truth: Sequence[int]) -> Floats:
    """The total variation of a truth in the steady window, shape (n, N), added as for a single run."""
    blocks, every, n = run.experiment.blocks, run.experiment.grid[2], run.plant.model.n
    since = MetricSettings.of(blocks.metrics, blocks.time).since(run.origin)
    steady = rows[::every, truth[0] : truth[-1] + 1][points_in(run.grid[::every], since.steady)]
    ways = np.abs(np.diff(steady, axis=0))
    if n == 1:  # numpy adds a single column pairwise, several row by row
        return np.asarray(np.ascontiguousarray(np.moveaxis(ways, 0, -1)).sum(axis=-1))
    return np.asarray(ways.sum(axis=0))
