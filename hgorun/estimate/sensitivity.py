"""How much the scores depend on each gain: runs with the gain a little larger and a little smaller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from hgorun.data.recording import Recording, Signal
from hgorun.errors import HgorunError
from hgorun.estimate.evaluated import evaluate_run
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import stated
from hgorun.estimate.scores import scores_of
from hgorun.observers.base import AnyObserver
from hgorun.result.result import Result

_LITTLE = 0.05  # of a gain
_NO_GAINS = {"type", "initial", "internal", "saturation", "coordinates", "map", "chains", "late"}


def with_sensitivity(
    result: Result, prepared: PreparedEstimate, recording: Recording, held_out: Mapping[str, Signal]
) -> Result:
    """The result with the score ``sensitivity``, by observer and gain.

    d ln(score) / d ln(gain), of the hold-out's size where samples were held out, and otherwise of that of the
    innovations: 0.1 says that ten per cent more of the gain make the score one per cent larger. Of several outputs each
    is counted in the standard deviation of its noise, or else in that of what was measured, whatever the units.
    """
    gains = {label: list(_gains(observer)) for label, observer in prepared.experiment.observers.items()}
    found: dict[str, dict[str, float]] = {}
    for place in range(max((len(of) for of in gains.values()), default=0)):
        chosen = {label: of[place] for label, of in gains.items() if place < len(of)}
        sizes = [_sizes(prepared, recording, held_out, chosen, factor) for factor in (1 + _LITTLE, 1 / (1 + _LITTLE))]
        for label, (key, _) in chosen.items():
            larger, smaller = (one.get(label, np.nan) for one in sizes)
            slope = np.log(larger / smaller) / (2 * np.log1p(_LITTLE)) if larger > 0 and smaller > 0 else np.nan
            if np.isfinite(slope):
                found.setdefault(label, {})[key] = float(slope)
    return _added(result, found)


def _added(result: Result, found: Mapping[str, Mapping[str, float]]) -> Result:
    observers = dict(result.observers)
    for label, slopes in found.items():
        one = observers[label]
        assert one.assessed is not None
        scores = {**one.assessed.scores, "sensitivity": slopes}
        observers[label] = replace(one, assessed=replace(one.assessed, scores=scores))
    return replace(result, observers=observers)


def _gains(observer: AnyObserver) -> Iterator[tuple[str, float]]:
    """The keys of an observer's block that are numbers other than zero."""
    for key, value in observer:
        if key not in _NO_GAINS and isinstance(value, float) and value:
            yield key, value


def _sizes(
    prepared: PreparedEstimate,
    recording: Recording,
    held_out: Mapping[str, Signal],
    chosen: Mapping[str, tuple[str, float]],
    factor: float,
) -> dict[str, float]:
    """Of every observer the size of what it cannot explain, where each has one of its gains changed."""
    changes = {f"observers.{label}.{key}": factor * value for label, (key, value) in chosen.items()}
    try:
        other = prepare_estimate(prepared.experiment.varied(changes), recording)
        found = evaluate_run(other, held_out, {}, with_error=False)
    except HgorunError:  # one of the gains cannot be that
        each = [{label: one} for label, one in chosen.items()] if len(chosen) > 1 else []
        alone = [_sizes(prepared, recording, held_out, one, factor) for one in each]
        return {label: of[label] for one, of in zip(each, alone, strict=True) for label in one if label in of}
    scales = _scales(other, held_out)
    return {b.label: _size_of(scores_of(other, found, j), scales) for j, b in enumerate(other.run.observers)}


def _scales(prepared: PreparedEstimate, held_out: Mapping[str, Signal]) -> dict[str, float]:
    """In what each output, and each state that is held out, is counted, so that they can be added."""
    measured = {one.output: one.values for one in prepared.samples}
    measured |= {name: one.values for name, one in held_out.items() if name not in measured}
    spreads = {name: float(np.std(values[np.isfinite(values)])) for name, values in measured.items() if values.size}
    return {name: spread for name, spread in spreads.items() if spread > 0} | dict(stated(prepared.experiment))


def _size_of(scores: Mapping[str, Mapping[str, float]], scales: Mapping[str, float]) -> float:
    """One number: the hold-out's, or that of the innovations; the root of the sum over outputs of its squares."""
    for name in ("holdout_rmse", "innovation_rms"):
        if scores.get(name):
            return float(np.sqrt(sum((value / scales.get(of, 1.0)) ** 2 for of, value in scores[name].items())))
    return float("nan")
