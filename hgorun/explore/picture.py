"""What a page draws and tabulates of a run: few points, axes that wild estimates do not stretch, numbers as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from hgorun.explore.bench import Shown
from hgorun.explore.numbers import Table, metrics_table, scores_table
from hgorun.explore.promises import Promise
from hgorun.explore.traces import POINTS, positive, trace_of, truth_of, window
from hgorun.figures.actors import cast, texts
from hgorun.figures.data import (
    Curve,
    finite,
    limits_about,
    limits_of_sizes,
    magnitude_limits,
    moving_maximum,
    state_limits,
    thinned,
)
from hgorun.figures.looks import Look, looks
from hgorun.figures.scene import from_roughest
from hgorun.memo import Memo, same
from hgorun.result.records.recorded import Recorded, RecordedOutput
from hgorun.result.result import Result
from hgorun.tables.typeset import printable

_SAMPLES = 600

Limits = tuple[float, float]
NOTHING = Curve(np.zeros(0), np.zeros(0))
_BOUNDS: Memo[list[Bound]] = Memo(64)  # of what has been promised


@dataclass(frozen=True)
class Panel:
    """One state, its estimates and their errors.

    Attributes
    ----------
    truth : Curve
        None of recorded data.
    measured : Curve
        Samples of the outputs that are this state, when they arrived.
    unseen : Curve
        Of recorded data, what was measured for comparison, and what was held out.
    estimates, errors, own_truths : mapping of str to Curve
        By observer; errors are the largest in a moving window. In a closed loop each observer has a truth of its own.
    limits, error_limits : (low, high)
        Of the axes.
    beyond : tuple of str
        What leaves the axes, in words.
    """

    name: str
    unit: str
    truth: Curve
    measured: Curve
    estimates: Mapping[str, Curve]
    errors: Mapping[str, Curve]
    own_truths: Mapping[str, Curve]
    limits: Limits
    error_limits: Limits
    unseen: Curve = NOTHING
    beyond: tuple[str, ...] = ()


@dataclass(frozen=True)
class Picture:
    """A run as a page shows it: of recorded data with the innovations of every output."""

    panels: tuple[Panel, ...]
    table: Table
    time_unit: str
    status: str
    said: tuple[str, ...] = field(default=())
    innovations: tuple[Panel, ...] = ()


def styles_of(result: Result) -> dict[str, Look]:
    """The look of every observer, the same as in figures of the file; the smoothest last, which others would hide."""
    actors = cast([result])
    found, labels = looks([actors], texts(actors, {})), {actor.order: actor.label for actor in actors}
    return {labels[order]: found[order] for order in from_roughest(actors, found)}


def picture_of(shown: Shown) -> Picture:
    """Everything that is shown of a run at once; what the theory says of it comes after."""
    result = shown.result
    said = [*result.troubles(), *result.remarks]
    recorded = result.recorded
    panel = partial(_panel, shown) if recorded is None else partial(_estimated, recorded, result)
    return Picture(
        panels=tuple(panel(i) for i in range(len(result.states))),
        innovations=() if recorded is None else tuple(_innovation(result, *one) for one in recorded.outputs.items()),
        table=metrics_table(result) if recorded is None else scores_table(result),
        time_unit=result.units.get("time", ""),
        status=result.status,
        said=tuple(map(printable, said)),
    )


def _panel(shown: Shown, i: int) -> Panel:
    result = shown.result
    name, truth = result.states[i], truth_of(shown, i)
    estimating = {label: one for label, one in result.observers.items() if name not in one.unestimated}
    traces = {label: trace_of(shown, label, i) for label in estimating}
    own = {label: truth_of(shown, i, label) for label in traces if result.closed_loop}
    lost = [trace.spread for label, trace in traces.items() if estimating[label].lost]
    sound = [trace for label, trace in traces.items() if not estimating[label].lost]
    spreads = [one.spread for one in (truth, *own.values())], [trace.spread for trace in sound]
    limits = _round_about(*(limits_about(*spreads, lost) or (0.0, 1.0)))
    sizes = [trace.size for trace in sound if trace.size]
    errors = {label: trace.error for label, trace in traces.items()}
    of_errors = limits_of_sizes(sizes) or magnitude_limits([], [curve.v for curve in errors.values()]) or (1e-3, 1.0)
    estimates = {label: trace.estimate for label, trace in traces.items()}
    measured = _measured(result, name)
    return Panel(
        name=name,
        unit=result.units.get(name, ""),
        truth=truth.curve,
        measured=thinned(measured, _SAMPLES),
        estimates=estimates,
        errors=errors,
        own_truths={label: one.curve for label, one in own.items()},
        limits=limits,
        error_limits=of_errors,
        beyond=(*_cut(name, estimates, limits), *_cut_samples(name, measured, limits)),
    )


def _estimated(recorded: Recorded, result: Result, i: int) -> Panel:
    """A state of recorded data: estimates, and what was measured of it."""
    name = result.states[i]
    estimates: dict[str, Curve] = {}
    sound: list[np.ndarray] = []
    lost: list[np.ndarray] = []
    for label, observer in result.observers.items():
        if name in observer.unestimated:
            continue
        estimate = finite(result.time, observer.xhat[:, i])
        (lost if observer.lost else sound).append(estimate.v)
        estimates[label] = thinned(estimate, POINTS)
    outputs = [recorded.outputs[output] for output in result.outputs_of(name)]
    measured = _joined([(one.taken, one.y) for one in outputs])
    names = dict.fromkeys((name, *result.outputs_of(name)))
    others = [of[key] for of in (recorded.reference, recorded.held_out) for key in names if key in of]
    unseen = _joined([(one.taken, one.y) for one in others])
    limits = _round_about(*(state_limits([measured.v, unseen.v], sound, lost) or (0.0, 1.0)))
    return Panel(
        name=name,
        unit=result.units.get(name, ""),
        truth=NOTHING,
        measured=thinned(measured, _SAMPLES),
        unseen=thinned(unseen, _SAMPLES),
        estimates=estimates,
        errors={},
        own_truths={},
        limits=limits,
        error_limits=(1e-3, 1.0),
        beyond=_cut(name, estimates, limits),
    )


def _innovation(result: Result, name: str, output: RecordedOutput) -> Panel:
    """What was measured of an output minus what had been estimated, of every observer."""
    curves = {label: finite(output.taken, output.innovation[:, j]) for j, label in enumerate(result.observers)}
    lost = {label for label, observer in result.observers.items() if observer.lost}
    sizes = [[curve.v for label, curve in curves.items() if (label in lost) is gone] for gone in (False, True)]
    limits = _round_about(*(state_limits([], *sizes) or (-1.0, 1.0)))
    return Panel(
        name=name,
        unit=result.units.get(name, ""),
        truth=NOTHING,
        measured=NOTHING,
        estimates={label: thinned(curve, POINTS) for label, curve in curves.items()},
        errors={},
        own_truths={},
        limits=limits,
        error_limits=(1e-3, 1.0),
        beyond=_cut(f"the innovation of {name}", curves, limits),
    )


def _joined(parts: Sequence[tuple[np.ndarray, np.ndarray]]) -> Curve:
    """Samples together, in the order of their times, without those that have no value."""
    if not parts:
        return NOTHING
    t, v = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    order = order[np.isfinite(v[order])]
    return Curve(t[order], v[order])


def _measured(result: Result, name: str) -> Curve:
    columns = [result.outputs.index(output) for output in result.outputs_of(name)]
    if not columns:
        return NOTHING
    y = result.measurements.y[:, columns[0]]
    known = np.isfinite(y)
    return Curve(result.measurements.time[known], y[known])


def _round_about(low: float, high: float) -> Limits:
    """Limits moved outwards to whole parts of what lies between them: not every small change moves an axis."""
    step = 10.0 ** math.floor(math.log10(max(high - low, 1e-300))) / 4
    return math.floor(low / step) * step, math.ceil(high / step) * step


def _cut(name: str, curves: Mapping[str, Curve], limits: Limits) -> tuple[str, ...]:
    """Which curves have a peak outside the axes, and how large it is."""
    found = []
    for label, curve in curves.items():
        count, t, v = _beyond(curve, limits)
        if count:
            found.append(f"{printable(label)}: {name} reaches {v:.4g} at t = {t:.4g}, beyond the axis")
    return tuple(found)


def _cut_samples(name: str, samples: Curve, limits: Limits) -> tuple[str, ...]:
    """How many samples are outside the axes, and where the farthest is."""
    count, t, v = _beyond(samples, limits)
    if not count:
        return ()
    are = "sample is" if count == 1 else "samples are"
    return (f"{count} {are} beyond the axis of {name}, the farthest {v:.4g} at t = {t:.4g}",)


def _beyond(curve: Curve, limits: Limits) -> tuple[int, float, float]:
    """How many points are outside the axes, and the farthest of them."""
    if not curve.v.size:
        return 0, 0.0, 0.0
    far = np.maximum(limits[0] - curve.v, curve.v - limits[1])
    k = int(np.argmax(far))
    return int(np.count_nonzero(far > 0)), float(curve.t[k]), float(curve.v[k])


@dataclass(frozen=True)
class Bound:
    """What a theorem draws beside an error: the bound where it holds, else that of an ideal run."""

    name: str
    label: str
    error: Curve
    bound: Curve
    holds: bool

    @cached_property
    def limits(self) -> Limits | None:
        """Between which an axis shows the error."""
        known = self.error.v[np.isfinite(self.error.v)]
        return magnitude_limits([known], [])


def words_of(promise: Promise) -> str:
    """What is drawn of a theorem, with its equation and what the run lacks; empty where there is none."""
    transient = promise.transient
    if transient is None or not transient.equation:
        return ""
    bound = f"the bound {transient.equation} of Robles Magdaleno 2023"
    if transient.holds:
        return f"dashed, {bound}, whose assumptions this run meets"
    ideal = f"dotted, {bound} for an ideal run, without noise, delay and disturbance"
    drawn = f"nothing is drawn of {bound}" if transient.nominal is None else ideal
    return f"{drawn}; this run does not meet what it assumes: {'; '.join(transient.lacking)}"


def bounds_of(label: str, promise: Promise, result: Result) -> list[Bound]:
    """A bound for every coordinate of an observer's theory; none where there is nothing to draw.

    As of errors, the largest in a moving window.
    """
    points = window(result)
    return _BOUNDS.get((label, same(promise), points), lambda: _bounds(label, promise, points))


def _bounds(label: str, promise: Promise, points: int) -> list[Bound]:
    transient = promise.transient
    if transient is None:
        return []
    values = transient.bound if transient.holds else transient.nominal
    if values is None:
        return []
    found = []
    for i, name in enumerate(transient.names):
        curves = [finite(transient.time, one[:, i]) for one in (transient.error, values)]
        largest = [curve._replace(v=moving_maximum(curve.v, points)) for curve in curves]
        error, bound = (positive(thinned(curve, POINTS)) for curve in largest)
        found.append(Bound(name, label, error, bound, transient.holds))
    return found
