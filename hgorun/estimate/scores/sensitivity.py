"""How much the scores depend on each gain: runs with the gain a little larger and a little smaller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from hgorun.data.recording import Recording, Signal
from hgorun.errors import ConfigError, HgorunError
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import stated
from hgorun.estimate.scores.evaluated import evaluate_run
from hgorun.estimate.scores.scores import scores_of
from hgorun.observers.base import AnyObserver
from hgorun.result.result import Result

_LITTLE = 0.05  # of a gain
_NO_GAINS = {"type", "initial", "internal", "saturation", "coordinates", "map", "chains", "late", "period", "interval"}

_Gain: TypeAlias = tuple[str, float]  # its key in the observer's block, and its value


def with_sensitivity(
    result: Result, prepared: PreparedEstimate, recording: Recording, held_out: Mapping[str, Signal]
) -> Result:
    """The result with the score ``sensitivity``, by observer and gain.

    d ln(score) / d ln(gain), of the hold-out's size where samples were held out, and otherwise of that of the
    innovations: 0.1 says that ten per cent more of the gain make the score one per cent larger. Of several outputs each
    is counted in the standard deviation of its noise, or else in that of what was measured, whatever the units.
    Of a gain that cannot be larger, or smaller, it is the slope on the other side; one that can be neither has none,
    which a remark says.
    """
    gains = {label: list(_gains(observer)) for label, observer in prepared.experiment.observers.items()}
    found: dict[str, dict[str, float]] = {}
    refused: dict[str, str] = {}

    def sizes(chosen: Mapping[str, _Gain], factor: float) -> dict[str, float]:
        """Of the observers that can have the gain that is chosen for them; tried one by one where one cannot."""
        try:
            return _sizes(prepared, recording, held_out, chosen, factor)
        except HgorunError as error:
            if len(chosen) > 1:
                alone = [sizes({label: one}, factor) for label, one in chosen.items()]
                return {label: of[label] for label, of in zip(chosen, alone, strict=True) if label in of}
            ((label, (key, value)),) = chosen.items()
            why = error.message if isinstance(error, ConfigError) else str(error)
            told = f"{label}: how its scores depend on {key} is not told, as {key} = {factor * value:.6g} is refused"
            refused[f"{label}.{key}"] = f"{told}: {why}"
            return {}

    for place in range(max((len(of) for of in gains.values()), default=0)):
        chosen = {label: of[place] for label, of in gains.items() if place < len(of)}
        larger, smaller = (sizes(chosen, factor) for factor in (1 + _LITTLE, 1 / (1 + _LITTLE)))
        at_edge = {label: one for label, one in chosen.items() if (label in larger) != (label in smaller)}
        every = sizes(at_edge, 1.0) if at_edge else {}
        itself = {label: every[label] for label in at_edge}
        for label, (key, _) in chosen.items():
            if label in itself:
                del refused[f"{label}.{key}"]
            sides = [one.get(label, itself.get(label, np.nan)) for one in (larger, smaller)]
            apart = np.log1p(_LITTLE) * (1 if label in itself else 2)
            slope = np.log(sides[0] / sides[1]) / apart if min(sides) > 0 else np.nan
            if np.isfinite(slope):
                found.setdefault(label, {})[key] = float(slope)
    return replace(_added(result, found), remarks=(*result.remarks, *refused.values()))


def _added(result: Result, found: Mapping[str, Mapping[str, float]]) -> Result:
    observers = dict(result.observers)
    for label, slopes in found.items():
        one = observers[label]
        assert one.assessed is not None
        scores = {**one.assessed.scores, "sensitivity": slopes}
        observers[label] = replace(one, assessed=replace(one.assessed, scores=scores))
    return replace(result, observers=observers)


def _gains(observer: AnyObserver) -> Iterator[_Gain]:
    """The keys of an observer's block that are numbers other than zero."""
    for key, value in observer:
        if key not in _NO_GAINS and isinstance(value, float) and value:
            yield key, value


def _sizes(
    prepared: PreparedEstimate,
    recording: Recording,
    held_out: Mapping[str, Signal],
    chosen: Mapping[str, _Gain],
    factor: float,
) -> dict[str, float]:
    """Of every observer the size of what it cannot explain, where each has one of its gains changed.

    Raises
    ------
    HgorunError
        Where one of the gains cannot be that.
    """
    changes = {f"observers.{label}.{key}": factor * value for label, (key, value) in chosen.items()}
    other = prepare_estimate(prepared.experiment.varied(changes), recording)
    found = evaluate_run(other, held_out, {}, with_error=False)
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
