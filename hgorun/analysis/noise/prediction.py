"""Noise in the estimates: predicted from the configuration's own noise, and measured by a run without it."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.transfer import NoTheory, relevant
from hgorun.analysis.noise.along_run import noise_along
from hgorun.analysis.noise.continuous import continuous_power
from hgorun.analysis.noise.jumps import noise_of_jumps
from hgorun.analysis.noise.sampled import SampledLoop
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.config.yaml_source import Source
from hgorun.measurement.blocks import Measurement, Periodic, Phase
from hgorun.observers.base import SampledObserver
from hgorun.observers.levant import LevantObserver
from hgorun.result.result import Result
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun

_POINTS = 20  # of the steady window where the linearisation is looked at
_CONSTANT = 1e-6  # relative


@dataclass(frozen=True)
class NoisePrediction:
    """Root mean square of the noise in each state of the estimate, shape (n,), or why there is none."""

    rms: np.ndarray | None
    reason: str | None = None


def noise_prediction(run: PreparedRun, twin: Result, result: Result | None = None) -> dict[str, NoisePrediction]:
    """For every observer, in the steady state of its linearisation where that does not change, or along the run.

    Parameters
    ----------
    run : PreparedRun
    twin : Result
        Where to linearise: the run of :func:`noise_free`.
    result : Result, optional
        The run with its noise. Without it there are steady states only.
    """
    found = {}
    for label in twin.observers:
        try:
            found[label] = NoisePrediction(np.sqrt(_power_of(run, twin, result, label)))
        except NoTheory as error:
            found[label] = NoisePrediction(None, str(error))
    return found


def _power_of(run: PreparedRun, twin: Result, result: Result | None, label: str) -> np.ndarray:
    try:
        return _power(run, twin, label)
    except NoTheory:
        observer = run.experiment.observers[label]
        lost = twin.observers[label].diverged_at is not None
        if result is None or lost or isinstance(observer, LevantObserver):
            raise
        if result.observers[label].diverged_at is not None:
            raise NoTheory("the observer diverged") from None
        return (noise_of_jumps if isinstance(observer, SampledObserver) else noise_along)(run, label, result, twin)


def _power(run: PreparedRun, result: Result, label: str) -> np.ndarray:
    terms, periods, delays = [], set(), set()
    for c in run.channels:
        stretch = c.stretches[0]
        if len(c.stretches) > 1 or stretch.multiplicative or not stretch.delay_is_constant:
            raise NoTheory("only additive noise and a measurement that stays the same have a steady state")
        sampling = stretch.sampling
        if not stretch.continuous and (not isinstance(sampling, Periodic) or sampling.jitter or sampling.dropout):
            raise NoTheory("only periodic sampling without jitter and dropout has a steady state")
        terms.append(NoiseTerms.of(c.noise[0]))
        periods.add((sampling.period, sampling.offset) if isinstance(sampling, Periodic) else None)
        delays.add(float(stretch.delay_at(np.array([stretch.start]))[0]))
    if len(periods) > 1 or len(delays) > 1:
        raise NoTheory("outputs of different sampling or delay have no common period")
    linear = _constant(run, result, label)
    delay, timing = delays.pop(), periods.pop()
    if timing is None:
        return continuous_power(linear, terms, delay)
    return SampledLoop(linear, timing[0], delay).power(terms, run.time.start + timing[1])


def _constant(run: PreparedRun, result: Result, label: str) -> Linear:
    observer = Linearisation(run, label)
    if isinstance(observer.block.observer, SampledObserver):
        raise NoTheory("the observer is a difference equation: it jumps along the run")
    if result.observers[label].diverged_at is not None:
        raise NoTheory("the observer diverged")
    start, end = result.windows["steady"]
    inside = np.flatnonzero((result.time >= start) & (result.time <= end))
    points = inside[np.unique(np.linspace(0, inside.size - 1, _POINTS).astype(int))]
    systems = relevant(observer.trajectory(result.observers[label], points, result.time[points]))
    for value in vars(systems).values():
        if not np.all(np.isfinite(value)):
            raise NoTheory("the observer's equations have no derivative on its way")
        if np.max(np.abs(value - value[0]), initial=0) > _CONSTANT * np.max(np.abs(value), initial=0):
            raise NoTheory("the linearisation changes along the run: it has no steady state")
    return Linear(*(value[0] for value in vars(systems).values()))


def noise_free(experiment: Experiment) -> Experiment:
    """The same experiment with noise of size zero: the same events and steps, so nothing else differs."""
    data, blocks = deepcopy(experiment.source.data), experiment.measurement
    measurement = data.get("measurement") or {}
    _silence(measurement, blocks)
    for written, phase in zip(measurement.get("phases") or (), blocks.phases, strict=True):
        _silence(written, phase)
    return Experiment(Source(data, experiment.source.positions), name=experiment.name, text=experiment.text)


def _silence(written: dict[str, Any], block: Measurement | Phase) -> None:
    """Replace the noise of all outputs, and that of single ones, in a configuration."""
    for mapping, own in ((written, block), *((written["outputs"][name], o) for name, o in block.outputs.items())):
        if own.noise is not None:
            mapping["noise"] = [item.silent() for item in own.noise]


def measured_noise(noisy: Result, twin: Result) -> dict[str, np.ndarray]:
    """Root mean square over the steady window of what noise has changed, shape (n,) each."""
    start, end = noisy.windows["steady"]
    inside = (noisy.time >= start) & (noisy.time <= end)
    return {
        label: np.sqrt(np.mean((o.xhat - twin.observers[label].xhat)[inside] ** 2, axis=0))
        for label, o in noisy.observers.items()
    }
