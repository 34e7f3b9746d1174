"""Times that do not come within the run, as that of an error that never settles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected
from hgorun.result.metrics.base import all_metrics
from hgorun.result.metrics.settling import SETTLING, lifted_by_noise


def is_time(metric: str) -> bool:
    """Whether a metric is the time of something that may never come."""
    known = all_metrics(closed=True).get(metric)
    return known is not None and known.moment


def never(members: Collected, metric: str) -> NDArray[np.bool_]:
    """Of which members a time has not come by the end of the run, or is decided by noise; of none of other metrics.

    Parameters
    ----------
    members : Collected
    metric : str

    Returns
    -------
    ndarray of bool, shape (N, m, n)
        Of members, observers and states; false where an estimate is lost.
    """
    if not is_time(metric):
        return np.zeros(members.metrics[metric].shape, dtype=bool)
    late = members.never(metric)
    return late | _lifted(members) if metric == SETTLING.name else late


def _lifted(members: Collected) -> NDArray[np.bool_]:
    """Whose settling times noise decides."""
    if not {"sup", "hf", "peak"} <= members.metrics.keys():
        return np.zeros(members.metrics[SETTLING.name].shape, dtype=bool)
    sup, fast, peak = (members.metrics[name] for name in ("sup", "hf", "peak"))
    with np.errstate(invalid="ignore"):
        return np.asarray(lifted_by_noise(sup, fast, peak, members.settling) & members.sound[:, :, None])
