"""Noise in the estimates: predicted from the configuration's own noise, and measured by a run without it."""

from __future__ import annotations

from functools import partial

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.transfer import relevant
from hgorun.analysis.noise.along_run import noise_along
from hgorun.analysis.noise.continuous import continuous_power
from hgorun.analysis.noise.jumps import noise_of_jumps
from hgorun.analysis.noise.sampled import SampledLoop
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.analysis.reasons import (
    NO_SLOPES,
    NoValue,
    first_of,
    require_estimate,
    require_innovation,
    why_no_flow,
)
from hgorun.measurement.blocks import noise_blocks
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import SlidingMode
from hgorun.result.result import Result
from hgorun.result.windows import points_in
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun

_POINTS = 20  # of the steady window where the linearisation is looked at
_CONSTANT = 1e-6  # relative


def predicted_noise(run: PreparedRun, label: str, noise_free: Result, result: Result | None = None) -> np.ndarray:
    """Root mean square of the noise in each state of the estimate, shape (n,).

    In the steady state of the observer's linearisation where that does not change, else along the run.

    Parameters
    ----------
    run : PreparedRun
    label : str
        Of the observer.
    noise_free : Result
        Where to linearise: the run of :func:`without_noise`.
    result : Result, optional
        The run with its noise. Without it there are steady states only.

    Raises
    ------
    NoValue
    """
    observer = run.experiment.observers[label]
    if isinstance(observer, CorrectedObserver):
        raise NoValue(why_no_flow(observer))
    require_innovation(run, label)
    steady = partial(_power, run, noise_free, label)
    if result is None or noise_free.observers[label].lost or isinstance(observer, SlidingMode):
        return np.asarray(np.sqrt(steady()))
    return np.asarray(np.sqrt(first_of(steady, partial(_power_along, run, label, noise_free, result))))


def _power_along(run: PreparedRun, label: str, noise_free: Result, result: Result) -> np.ndarray:
    require_estimate(result.observers[label])
    jumps = isinstance(run.experiment.observers[label], SampledObserver)
    return (noise_of_jumps if jumps else noise_along)(run, label, result, noise_free).mean_square


def has_noise(run: PreparedRun) -> bool:
    """Whether any output has noise at any time."""
    return any(stretch.noise for channel in run.channels for stretch in channel.stretches)


def _power(run: PreparedRun, result: Result, label: str) -> np.ndarray:
    terms, periods, delays = [], set(), set()
    for c in run.channels:
        stretch = c.stretches[0]
        if len(c.stretches) > 1 or stretch.multiplicative or not stretch.delay_is_constant:
            raise NoValue("only additive noise and a measurement that does not change have a steady state")
        sampling = stretch.regular
        if sampling is None and not stretch.continuous:
            raise NoValue("only periodic sampling without jitter and dropout has a steady state")
        terms.append(NoiseTerms.of(c.noise[0]))
        periods.add(None if sampling is None else (sampling.period, sampling.offset))
        delays.add(float(stretch.delay_at(np.array([stretch.start]))[0]))
    if len(periods) > 1 or len(delays) > 1:
        raise NoValue("outputs with different sampling or delay have no common period")
    linear = _constant(run, result, label)
    delay, timing = delays.pop(), periods.pop()
    if timing is None:
        return continuous_power(linear, terms, delay)
    return SampledLoop(linear, timing[0], delay).power(terms, run.time.start + timing[1])


def _constant(run: PreparedRun, result: Result, label: str) -> Linear:
    observer = Linearisation(run, label)
    if isinstance(observer.block.observer, SampledObserver):
        raise NoValue("the observer jumps at the samples: it has no steady flow")
    require_estimate(result.observers[label])
    inside = np.arange(result.time.size)[points_in(result.time, result.windows["steady"])]
    points = inside[np.unique(np.linspace(0, inside.size - 1, _POINTS).astype(int))]
    systems = relevant(observer.trajectory(result.observers[label], points, result.time[points]))
    for value in vars(systems).values():
        if not np.all(np.isfinite(value)):
            raise NoValue(NO_SLOPES)
        if np.max(np.abs(value - value[0]), initial=0) > _CONSTANT * np.max(np.abs(value), initial=0):
            raise NoValue("the linearisation changes along the run: it has no steady state")
    return Linear(*(value[0] for value in vars(systems).values()))


def without_noise(experiment: Experiment) -> Experiment:
    """The same experiment with noise of size zero: the same events and steps, so nothing else differs."""
    return experiment.varied(
        {path: [item.silent() for item in noise] for path, noise in noise_blocks(experiment.measurement)}
    ).informed_by(experiment)


def measured_noise(noisy: Result, noise_free: Result, label: str) -> np.ndarray:
    """Root mean square over the steady window of what noise has changed in an estimate, shape (n,)."""
    inside = points_in(noisy.time, noisy.windows["steady"])
    difference = noisy.observers[label].xhat - noise_free.observers[label].xhat
    return np.asarray(np.sqrt(np.mean(difference[inside] ** 2, axis=0)))
