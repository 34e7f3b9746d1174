"""All metrics of the estimates of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count

import numpy as np

from hgorun.errors import PluginError, called
from hgorun.result.evaluation.estimated import Estimated
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
    if not estimates:
        return {}
    stacked = Estimated.of_stack(np.stack(list(estimates.values()), axis=1))
    found = measure_together(time, Estimated.same(x, len(estimates)), stacked, settings, metrics)
    return {label: {name: values[j].copy() for name, values in found.items()} for j, label in enumerate(estimates)}


def measure_together(
    time: np.ndarray,
    truths: Estimated,
    estimated: Estimated,
    settings: MetricSettings,
    metrics: Sequence[Metric] | None = None,
    reference: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """All metrics of estimates that lie in one array; else as :func:`measure`.

    Parameters
    ----------
    truths, estimated : Estimated
        What m observers estimate, and their estimates.
    reference : ndarray, shape (Nt, n), optional
        In a closed loop the plant that the true state drives.

    Returns
    -------
    dict of str to ndarray, shape (m, n)
        {metric: values}.
    """
    return measure_and_tell(time, truths, estimated, settings, metrics, reference)[0]


def measure_and_tell(
    time: np.ndarray,
    truths: Estimated,
    estimated: Estimated,
    settings: MetricSettings,
    metrics: Sequence[Metric] | None = None,
    reference: np.ndarray | None = None,
) -> tuple[dict[str, np.ndarray], bool]:
    """What :func:`measure_together` gives, and whether all errors were seen to be finite."""
    wanted = tuple(all_metrics(closed=reference is not None).values()) if metrics is None else metrics
    compiled = _compiled(time, truths, estimated, settings)
    if compiled is not None and all(metric in compiled for metric in wanted):
        return {metric.name: compiled[metric] for metric in wanted}, True
    xhat = estimated.stack()
    x = truths.distinct()
    sound = _finite(xhat)
    if sound and all(sound):
        return by_records(time, x, xhat, settings, wanted, reference), True
    found = {m.name: np.full(xhat.shape[1:], np.inf) for m in wanted}
    if any(sound):
        own = x if x.shape[1] == 1 else x[:, sound]
        rest = by_records(time, own, xhat[:, sound], settings, wanted, reference)
        for name, values in rest.items():
            found[name][sound] = values
    return found, False


_FEW, _MANY = 4, 1 << 18  # passes for which loading machine code does not pay, and numbers for which it always does
_MEASURED = count(1)  # the passes of this process


def _compiled(
    time: np.ndarray, truths: Estimated, estimated: Estimated, settings: MetricSettings
) -> dict[Metric, np.ndarray] | None:
    """The built-in metrics from machine code, of the same bits; None where they are left to the records.

    So are the first few short ones of a process, which are the passes of a single run and of its error estimate: to
    load the code takes as long as to measure several.
    """
    size = len(time) * len(truths.places[0]) if truths.places else 0
    if next(_MEASURED) <= _FEW and size < _MANY:
        return None
    from hgorun.result.evaluation.columns import measured

    return measured(time, truths, estimated, settings)


def from_origin(values: Mapping[str, np.ndarray], origin: float) -> dict[str, np.ndarray]:
    """Metrics of estimates whose time is counted from ``origin``, with moments as the clock shows them."""
    known = all_metrics(closed=True)
    return {name: value + origin if known[name].moment else value for name, value in values.items()}


def _finite(xhat: np.ndarray) -> list[bool]:
    """Of every observer whether its estimates are finite."""
    # numbers that are finite have a finite sum, unless they are huge
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(np.sum(xhat)):
            return [True] * xhat.shape[1]
    return [bool(np.all(np.isfinite(xhat[:, j]))) for j in range(xhat.shape[1])]


def by_records(
    time: np.ndarray,
    x: np.ndarray,
    xhat: np.ndarray,
    settings: MetricSettings,
    metrics: Sequence[Metric],
    reference: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """{metric: values of shape (m, n)} of finite estimates.

    Parameters
    ----------
    x : ndarray, shape (Nt, 1, n) or (Nt, m, n)
        One truth, or one for each observer.
    xhat : ndarray, shape (Nt, m, n)
        All arrays are taken in the order of C, which decides the bits.
    reference : ndarray, shape (Nt, n), optional
    """
    x, xhat = np.ascontiguousarray(x), np.ascontiguousarray(xhat)
    m, n = xhat.shape[1:]
    if n == 1 and m > 1:
        # numpy adds a single column pairwise, several row by row: one state has to be one column in any company
        columns = [np.ascontiguousarray(xhat[:, [j]]) for j in range(m)]
        truths = [np.ascontiguousarray(x[:, [j if x.shape[1] > 1 else 0]]) for j in range(m)]
        pairs = zip(truths, columns, strict=True)
        each = [by_records(time, truth, column, settings, metrics, reference) for truth, column in pairs]
        return {metric.name: np.concatenate([values[metric.name] for values in each]) for metric in metrics}
    # what is finite may have squares and differences that are not: such a metric is infinite
    with np.errstate(over="ignore", invalid="ignore"):
        return _by_record(time, x, xhat, settings, metrics, reference)


def _by_record(
    time: np.ndarray,
    x: np.ndarray,
    xhat: np.ndarray,
    settings: MetricSettings,
    metrics: Sequence[Metric],
    reference: np.ndarray | None,
) -> dict[str, np.ndarray]:
    """The same, of arrays in the order of C."""
    error = np.repeat(x, xhat.shape[1] // x.shape[1], axis=1)  # numpy subtracts rows faster than pairs
    np.subtract(xhat, error, out=error)
    step = float(time[1] - time[0]) if time.size > 1 else np.nan
    beside = None if reference is None else np.ascontiguousarray(reference)[:, None]
    whole = Estimates(time, x, xhat, error, np.abs(error), step, settings, beside)
    return {metric.name: _value(metric, whole.within(metric.window)) for metric in metrics}


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
