"""What samples do to observers that are corrected by them alone."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.linear.corrections import SampledError, sampled_error
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.stability.critical import timing_of
from hgorun.analysis.subject import Subject, once
from hgorun.observers.base import CorrectedObserver
from hgorun.observers.capabilities import Differentiator


def _is_corrected(observer: Subject) -> bool:
    """Whether it is a copy of the plant that samples correct."""
    return isinstance(observer.observer, CorrectedObserver) and not isinstance(observer.observer, Differentiator)


@once
def _error(observer: Subject) -> SampledError:
    period = timing_of(observer.run).period
    if period is None:
        raise NoValue("there are no two samples")
    return sampled_error(observer.run, observer.label, observer.found, observer.result.time, period)


@finding(
    "for observers that are corrected at samples: eigenvalues of the matrix that maps a small error from one "
    "sample to the next, with the observer as it is at the end of the run",
    group="poles",
    optional=True,
    applies=_is_corrected,
)
def period_factors(observer: Subject) -> Remarked:
    timing = timing_of(observer.run)
    remarks = "; ".join(text for text in (timing.phase, timing.regular, timing.uneven) if text)
    return Remarked(_error(observer).factors, (f"period_factors: {remarks}",) if remarks else ())


@finding(
    "for observers that are corrected at samples: the gain of a sample at the end of the run, for each output",
    group="poles",
    unit="state/output",
    places=("json",),
    optional=True,
    applies=_is_corrected,
)
def sample_gain(observer: Subject) -> dict[str, list[float]]:
    return observer.rows_by_state(_error(observer).gain)


@finding(
    "for observers that are corrected at samples: standard deviation after a sample under white noise of unit "
    "variance, with the observer of `period_factors`",
    group="h2",
    unit="state/output",
    optional=True,
    applies=_is_corrected,
)
def sample_noise(observer: Subject) -> dict[str, float]:
    return observer.by_state(np.asarray(_error(observer).deviation()))
