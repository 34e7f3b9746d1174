"""What Kalman filters come to when their covariance rests: gains, poles, and the errors that they expect."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.linear.stationary import Stationary, continuous, linear_model, sampled
from hgorun.analysis.reasons import NoValue, require_estimate
from hgorun.analysis.stability.critical import timing_of
from hgorun.analysis.subject import Subject, once
from hgorun.observers.kalman import KalmanFilter
from hgorun.observers.mhe import MovingHorizonEstimator


def _is_filter(observer: Subject) -> bool:
    return isinstance(observer.observer, KalmanFilter)


@once
def _at_rest(observer: Subject) -> Stationary:
    """The filter's equations at rest, linearised at the estimate at the end of the run."""
    filter_ = observer.observer
    assert isinstance(filter_, KalmanFilter)
    if isinstance(filter_, MovingHorizonEstimator):
        raise NoValue("its noise from sample to sample is Qd and not the integral of Q: on linear plants ask ekf")
    require_estimate(observer.found)
    model = linear_model(observer.run, observer.block, float(observer.result.time[-1]), observer.found.xhat[-1])
    if not filter_.of_samples:
        return continuous(model)
    timing = timing_of(observer.run)
    if timing.period is None:
        raise NoValue("there are no two samples")
    if timing.uneven:
        raise NoValue("samples come at uneven times: the gain of a sample depends on the time since the last one")
    return sampled(model, timing.period)


def _remark(observer: Subject) -> tuple[str, ...]:
    end = observer.run.origin + observer.result.time[-1]
    return (f"stationary_gain, stationary_poles, stationary_error: linearised at t = {end:.4g}, samples not late",)


@finding(
    "for Kalman filters: eigenvalues of the error with stationary P, for the plant linearised at the end of the "
    "run; of `kalman_bucy` those of the differential equation (1/time), of others those from one sample to the "
    "next",
    group="poles",
    applies=_is_filter,
)
def stationary_poles(observer: Subject) -> Remarked:
    poles = _at_rest(observer).poles
    return Remarked(poles[np.lexsort((-poles.imag, np.abs(poles)))], _remark(observer))


@finding(
    "for Kalman filters: the stationary gain of the innovation, for each output; state/output, and per time for "
    "`kalman_bucy`",
    group="poles",
    places=("json",),
    applies=_is_filter,
)
def stationary_gain(observer: Subject) -> dict[str, list[float]]:
    return observer.rows_by_state(_at_rest(observer).K)


@finding(
    "for Kalman filters: the stationary standard deviation of the error that the filter expects (after samples), "
    "which is right if its Q and R are",
    group="noise, predicted",
    unit="state",
    applies=_is_filter,
)
def stationary_error(observer: Subject) -> dict[str, float]:
    return observer.by_state(np.sqrt(np.maximum(np.diag(_at_rest(observer).P), 0.0)))
