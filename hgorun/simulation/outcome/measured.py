"""What one pass through a run has given: truth and estimates on the output grid, and the metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.evaluation.measure import measure_and_tell
from hgorun.result.records.status import OK, Verdict
from hgorun.result.windows import MetricSettings, points_in
from hgorun.simulation.passes.loss import of_estimate
from hgorun.simulation.prepared import PreparedRun


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Measured:
    """Trajectories, and the metrics of the estimates.

    Attributes
    ----------
    rows : ndarray, shape (Nt, states)
        All states on the output grid, those of the plant first.
    x : ndarray, shape (Nt, n)
        The plant's; in a closed loop that of the plant that the true state drives.
    truths : Estimated
        What the observers estimate: that, or of each the plant that it drives.
    estimates : Estimated
        In the plant's coordinates, of the m observers on the output grid.
    verdicts : tuple of Verdict
        What is said of every observer, with times since the run's origin.
    metrics : mapping of str to ndarray, shape (m, n)
        Moments are counted from the run's origin, too.
    settings : MetricSettings
        Where the metrics look, on the clock of the configuration.
    steady : Estimated
        The truths in the steady window, at the points of the metrics.
    """

    rows: np.ndarray
    x: np.ndarray
    truths: Estimated
    estimates: Estimated
    verdicts: tuple[Verdict, ...]
    metrics: Mapping[str, np.ndarray]
    settings: MetricSettings
    steady: Estimated

    def moved(self, observer: int) -> np.ndarray:
        """Total variation of an observer's truth in the steady window, shape (n,)."""
        return np.asarray(np.abs(np.diff(self.steady.of(observer), axis=0)).sum(axis=0))

    def lost(self, observer: int) -> float:
        """When an observer is lost; infinite where it is not."""
        verdict = self.verdicts[observer]
        return verdict.at if verdict.lost and verdict.at is not None else np.inf


def measured(run: PreparedRun, raw: Raw, known: Mapping[str, Verdict]) -> Measured:
    """From the engine's arrays, and what is known of observers that are not plainly ok."""
    rows, n = raw.rows[:, :, 0], run.plant.model.n
    _, every_output, every_metric = run.experiment.grid
    shown, points = slice(None, None, every_output), slice(None, None, every_metric)
    kept = np.ascontiguousarray(rows[shown])  # the arrays of the result are parts of it
    estimates = run.structure.estimates_along(run.grid, run.numbers.p, rows)
    settings = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time)
    since, x = settings.since(run.origin), rows[points, :n]
    truths = Estimated(rows, run.structure.truths)
    reference = x if run.closed else None
    metrics, finite = measure_and_tell(
        run.grid[points], Estimated(rows[points], truths.places), estimates.at(points), since, reference=reference
    )
    sound = (finite and every_metric == 1) or estimates.finite()
    return Measured(
        rows=kept,
        x=kept[:, :n],
        truths=Estimated(kept, truths.places),
        estimates=estimates.at(shown),
        verdicts=_verdicts(run, raw, estimates, known, sound=sound),
        metrics=metrics,
        settings=settings,
        steady=Estimated(rows[points][points_in(run.grid[points], since.steady)], truths.places),
    )


def _verdicts(
    run: PreparedRun, raw: Raw, estimates: Estimated, known: Mapping[str, Verdict], *, sound: bool
) -> tuple[Verdict, ...]:
    """What is said of every observer, with times since the run's origin; ``sound``: all estimates are finite."""
    return tuple(
        known[b.label] if b.label in known else OK if sound else of_estimate(run, raw, j, estimates.of(j))
        for j, b in enumerate(run.observers)
    )
