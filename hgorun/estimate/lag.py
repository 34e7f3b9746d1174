"""Instruments that lag behind: what they would have shown of an estimate."""

from __future__ import annotations

import numpy as np

from hgorun.symbolic.evaluate import Floats


def behind(taken: Floats, values: Floats, residuals: Floats, lag: float, period: float | None) -> Floats:
    """Measured minus what the instrument would have shown of the estimates.

    Parameters
    ----------
    taken, values : ndarray, shape (k,)
        What the instrument has shown.
    residuals : ndarray, shape (m, k)
        Measured minus estimated, of several observers.
    lag : float
        The time constant.
    period : float or None
        Of the quantity, if it is known up to whole periods.
    """
    if period is not None:
        values = np.unwrap(values, period=period)
    return np.asarray(values - lagged(taken, values - residuals, lag, values))


def lagged(times: Floats, values: Floats, lag: float, shown: Floats) -> Floats:
    """What an instrument shows that follows a quantity with a lag of the first order, lag v' = x - v.

    It begins with what was shown in fact, and again behind moments at which the quantity is not known.

    Parameters
    ----------
    times : ndarray, shape (k,)
        They do not fall.
    values : ndarray, shape (m, k)
        Of several quantities, on straight lines from one time to the next; NaN where they are not known.
    lag : float
        The time constant, > 0.
    shown : ndarray, shape (k,)
    """
    steps = np.diff(times) / lag
    left = np.exp(-steps)
    ramp = 1 - np.divide(1 - left, steps, out=np.ones_like(left), where=steps > 0)
    constant = 1 - left - ramp  # of what was at the beginning of a step, beside that of its end
    found = np.where(np.isfinite(values), shown, np.nan)
    for k in range(steps.size):
        before = found[:, k]
        after = left[k] * before + constant[k] * values[:, k] + ramp[k] * values[:, k + 1]
        found[:, k + 1] = np.where(np.isfinite(before), after, found[:, k + 1])
    return np.asarray(found)
