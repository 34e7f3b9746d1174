"""What one pass through a run has given: truth and estimates on the output grid, and the metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hgorun.engine.program import Raw
from hgorun.result.measure import measure
from hgorun.result.status import OK, Verdict
from hgorun.result.windows import MetricSettings, points_in
from hgorun.simulation.loss import of_estimate
from hgorun.simulation.prepared import PreparedRun


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Trajectories in the plant's coordinates, and their metrics.

    Attributes
    ----------
    x : ndarray, shape (Nt, n)
        On the output grid.
    estimates : mapping of str to ndarray, shape (Nt, n)
        By observer.
    lost : mapping of str to float
        When each observer is lost; infinite where it is not.
    metrics : mapping
        {observer: {metric: values (n,)}}; moments are counted from the start of the run.
    settings : MetricSettings
        Where the metrics look.
    moved : ndarray, shape (n,)
        Total variation of the truth in the steady window.
    undefined : mapping of str to Verdict
        Observers whose estimate is not a number from some time on.
    """

    x: np.ndarray
    estimates: Mapping[str, np.ndarray]
    lost: Mapping[str, float]
    metrics: Mapping[str, Mapping[str, np.ndarray]]
    settings: MetricSettings
    moved: np.ndarray
    undefined: Mapping[str, Verdict]


def measured(run: PreparedRun, raw: Raw, verdicts: Mapping[str, Verdict]) -> Measured:
    """From the engine's arrays, and what is said of the observers that are not plainly ok."""
    rows, labels = raw.rows[:, :, 0], [b.label for b in run.observers]
    _, every_output, every_metric = run.experiment.grid
    shown, points = slice(None, None, every_output), slice(None, None, every_metric)
    x = rows[:, : run.plant.model.n]
    found = [readout.along(run.grid, run.numbers.p, rows) for readout in run.structure.estimates]
    settings = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time)
    since = settings.since(run.origin)
    on_points = {label: xhat[points] for label, xhat in zip(labels, found, strict=True)}
    said = {label: of_estimate(run, raw, j, found[j]) for j, label in enumerate(labels)}
    steady = x[points][points_in(run.grid[points], since.steady)]
    return Measured(
        x=np.ascontiguousarray(x[shown]),
        estimates={label: np.ascontiguousarray(xhat[shown]) for label, xhat in zip(labels, found, strict=True)},
        lost={label: _lost(verdicts.get(label, said[label])) for label in labels},
        metrics=measure(run.grid[points], x[points], on_points, since),
        settings=settings,
        moved=np.abs(np.diff(steady, axis=0)).sum(axis=0),
        undefined={label: verdict for label, verdict in said.items() if verdict != OK},
    )


def _lost(verdict: Verdict) -> float:
    return verdict.at if verdict.lost and verdict.at is not None else np.inf
