"""All metrics of the estimates of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hgorun.errors import PluginError, called
from hgorun.result.metrics.base import Estimates, Metric, all_metrics
from hgorun.result.windows import MetricSettings


def measure(
    time: np.ndarray,
    x: np.ndarray,
    estimates: Mapping[str, np.ndarray],
    settings: MetricSettings,
    metrics: Sequence[Metric] | None = None,
) -> dict[str, dict[str, np.ndarray]]:
    """All metrics of all estimates.

    Parameters
    ----------
    time : ndarray, shape (Nt,)
        Evenly spaced.
    x : ndarray, shape (Nt, n)
    estimates : mapping of str to ndarray, shape (Nt, n)
        By observer.
    settings : MetricSettings
    metrics : sequence of Metric, optional
        Which; by default all that are known.

    Returns
    -------
    dict of str to dict of str to ndarray, shape (n,)
        {observer: {metric: value}}. Infinite where an estimate is not finite, NaN where a window has no points.
    """
    wanted = tuple(all_metrics().values()) if metrics is None else metrics
    n = x.shape[1]
    sound = [label for label, xhat in estimates.items() if _is_finite(xhat)]
    values = _together(time, x, [estimates[label] for label in sound], settings, wanted)
    lost = {m.name: np.full(n, np.inf) for m in wanted}
    found = {label: {name: value[j].copy() for name, value in values.items()} for j, label in enumerate(sound)}
    return {label: found.get(label) or {name: value.copy() for name, value in lost.items()} for label in estimates}


def from_origin(values: Mapping[str, np.ndarray], origin: float) -> dict[str, np.ndarray]:
    """Metrics of estimates whose time is counted from ``origin``, with moments as the clock shows them."""
    known = all_metrics()
    return {name: value + origin if known[name].moment else value for name, value in values.items()}


def _is_finite(values: np.ndarray) -> bool:
    # numbers that are finite have a finite sum, unless they are huge
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values.sum()) or np.all(np.isfinite(values)))


def _together(
    time: np.ndarray,
    x: np.ndarray,
    estimates: Sequence[np.ndarray],
    settings: MetricSettings,
    metrics: Sequence[Metric],
) -> dict[str, np.ndarray]:
    """{metric: values of shape (m, n)} of m finite estimates."""
    if not estimates:
        return {}
    if x.shape[1] == 1 and len(estimates) > 1:
        # numpy adds a single column pairwise, several row by row: one state has to be one column in any company
        each = [_together(time, x, [xhat], settings, metrics) for xhat in estimates]
        return {m.name: np.concatenate([values[m.name] for values in each]) for m in metrics}
    count, n, m = len(x), x.shape[1], len(estimates)
    truth, xhat = x[:, None, :], np.concatenate(estimates, axis=1).reshape(count, m, n)
    error = (xhat.reshape(count, -1) - np.tile(x, (1, m))).reshape(count, m, n)  # rows are faster than pairs
    step = float(time[1] - time[0]) if time.size > 1 else np.nan
    whole = Estimates(time, truth, xhat, error, np.abs(error), step, settings)
    return {m.name: _value(m, whole.within(m.window)) for m in metrics}


def _value(metric: Metric, estimates: Estimates) -> np.ndarray:
    shape = estimates.xhat.shape[1:]
    if not estimates.time.size:
        return np.full(shape, np.nan)
    with called("metric", metric.name, "measure"):
        value = np.asarray(metric.measure(estimates), dtype=float)
    if value.shape != shape:
        raise PluginError(
            f"metric {metric.name!r}: measure returned an array of shape {value.shape}, expected {shape}: "
            "a number for every observer and state"
        )
    return value
