"""What was measured and not used, beside what every observer says of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.data.recording import Signal
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.scores.lag import Instrument, felt_of, just_before, points_between
from hgorun.estimate.scores.output_points import OutputPoints
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.pieces import distinct
from hgorun.result.records.recorded import Unseen
from hgorun.symbolic.evaluate import Floats

Key = tuple[int, str]
"""What is compared: 0 and an output of which samples were held out, 1 and what was recorded for reference."""


@dataclass(frozen=True, eq=False, repr=False)
class Compared:
    """A measured quantity beside what every observer says of it.

    Attributes
    ----------
    name : str
        A state or an output.
    taken, values : ndarray, shape (k,)
        Times counted from the start of the run.
    residuals : ndarray, shape (m, k)
        Measured minus estimated, without whole periods.
    """

    name: str
    taken: Floats
    values: Floats
    residuals: Floats


def inside(signal: Signal, origin: float, end: float, points: OutputPoints) -> tuple[Floats, Floats]:
    """Times and values of a signal in a run; its times are those of samples as output points are."""
    taken, inside = signal.taken - origin, _inside(signal, origin, end)
    return points.at_samples(taken[inside]), signal.values[inside]


def unseen(signals: Mapping[str, Signal], origin: float, end: float) -> dict[str, Unseen]:
    """What of some signals lies in a run, for its result: with the times that stand in the log."""
    chosen = {name: _inside(signal, origin, end) for name, signal in signals.items()}
    return {name: Unseen(signals[name].taken[which], signals[name].values[which]) for name, which in chosen.items()}


def _inside(signal: Signal, origin: float, end: float) -> np.ndarray:
    taken = signal.taken - origin
    return np.asarray((taken >= 0.0) & (taken <= end))


def compared_with(
    prepared: PreparedEstimate, name: str, taken: Floats, values: Floats, xhat: Sequence[Floats]
) -> Compared:
    model = prepared.run.plant.model
    if name in model.outputs:
        i = model.outputs.index(name)
        residuals = [model.wrapped(i, values - prepared.outputs(taken, x)[:, i]) for x in xhat]
    else:
        k = model.states.index(name)
        residuals = [values - x[:, k] for x in xhat]
    return Compared(name, taken, values, np.array(residuals).reshape(len(xhat), taken.size))


def instruments_of(
    prepared: PreparedEstimate, asked: Mapping[Key, Signal], chosen: Mapping[Key, tuple[Floats, Floats]]
) -> dict[Key, Instrument]:
    """What is compared with instruments that lag, with times and values in the run of all that is compared."""
    model, count = prepared.run.plant.model, len(prepared.run.observers)
    periods = dict(zip(model.outputs, model.periods, strict=False))
    return {
        key: Instrument(chosen[key][0], signal.lag, count, periods.get(key[1]))
        for key, signal in asked.items()
        if signal.lag is not None
    }


def between_shown(prepared: PreparedEstimate, instruments: Sequence[Instrument]) -> Floats:
    """When instruments that lag are to see estimates, between the times at which they have shown something."""
    step = prepared.run.step
    return distinct(np.concatenate([np.zeros(0), *(points_between(one.taken, one.lag, step) for one in instruments)]))


def felt_at(prepared: PreparedEstimate, instruments: Sequence[Instrument]) -> list[Floats]:
    """The same, and when samples arrive; just before that as well where estimates jump."""
    if not instruments:
        return []
    jumping = any(isinstance(b.observer, SampledObserver | CorrectedObserver) for b in prepared.run.observers)
    arrivals = [one.available for one in prepared.samples]
    arrivals += [just_before(times) for times in arrivals] if jumping else []
    felt = [felt_of(times, one.taken, one.lag) for one in instruments for times in arrivals]
    return [between_shown(prepared, instruments), *felt]


def see(
    prepared: PreparedEstimate, instruments: Mapping[Key, Instrument], times: Floats, xhat: Sequence[Floats]
) -> None:
    """Show estimates, shape (N, n) of every observer, to instruments."""
    for (_, name), one in instruments.items():
        one.see(times, np.array([_quantity(prepared, name, times, x) for x in xhat]))


def _quantity(prepared: PreparedEstimate, name: str, times: Floats, x: Floats) -> Floats:
    """A state or an output as it is estimated."""
    model = prepared.run.plant.model
    if name in model.outputs:
        return prepared.outputs(times, x)[:, model.outputs.index(name)]
    return x[:, model.states.index(name)]


def with_lag(one: Compared, instrument: Instrument | None) -> Compared:
    """A measured quantity beside what its instrument would have shown of the estimates; itself without a lag."""
    return one if instrument is None else replace(one, residuals=instrument.residuals(one.values))
