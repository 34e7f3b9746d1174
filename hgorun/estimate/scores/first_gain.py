"""Filters whose first covariance is so large beside the noise that no step is short enough for their first gain."""

from __future__ import annotations

from hgorun.estimate.prepared import PreparedEstimate
from hgorun.measurement.schedule import tolerances_of
from hgorun.observers.kalman import KalmanFilter
from hgorun.simulation.preparation.first_step import PART, rate_of


def too_large_at_first(prepared: PreparedEstimate, j: int) -> str:
    """That P(0) is too large beside R, with numbers that would do; empty where it is not, or the step is given.

    Parameters
    ----------
    j : int
        An observer.
    """
    experiment, block = prepared.experiment, prepared.run.observers[j]
    if experiment.given_step is not None or not isinstance(block.observer, KalmanFilter):
        return ""
    rate = rate_of(block.label, block.observer, block.form)
    _, apart = tolerances_of(experiment.stretches, prepared.run.step)
    share = PART / apart / rate if rate > 0 else 1.0
    if share >= 1:
        return ""
    plant, P = block.form.plant, block.observer.start_of(block.form)["P"]
    largest = max(float(P[k, k]) for k in map(plant.states.index, plant.measures.values()))
    return (
        f"its P(0) of {largest:.3g} is too large beside R: the first gain fades within {1 / rate:.2g}, and no step is "
        f"so short; a P(0) up to {largest * share:.2g} would do (internal: {{P: ...}}), or an R {1 / share:.2g} times "
        f"as large, which is a std {share**-0.5:.2g} times as large"
    )
