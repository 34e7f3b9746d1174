"""What the noise of a run does to an estimate over the steady window: a course, for whatever is measured of it.

Where the linearisation stays the same and all noise is sinusoids on continuous outputs, their steady response;
else the run's own noise is followed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.transfer import relevant, relevant_states, require_hurwitz, response, restricted
from hgorun.analysis.noise.along_run import noise_along
from hgorun.analysis.noise.jumps import noise_of_jumps
from hgorun.analysis.noise.late import noise_of_late_output
from hgorun.analysis.noise.terms import NoiseTerms, require_spectra
from hgorun.analysis.reasons import (
    NO_SLOPES,
    NoValue,
    first_of,
    outcome,
    require_estimate,
    require_innovation,
    why_no_flow,
)
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import SlidingMode
from hgorun.result.result import Result
from hgorun.result.windows import points_in
from hgorun.simulation.prepared import PreparedRun

_POINTS = 20  # of the window where the linearisation is looked at
_SAME = 0.01  # relative change of a response below which it is one
_SETTLED = 1e-3  # what may be left of a transient where the window starts


def deviation_in_window(
    run: PreparedRun, label: str, noise_free: Result, result: Callable[[], Result]
) -> tuple[np.ndarray, np.ndarray]:
    """What the noise does to each state of the estimate, on the output grid inside the steady window.

    Parameters
    ----------
    run : PreparedRun
        With noise.
    label : str
        Of the observer.
    noise_free : Result
        The same run without noise.
    result : callable
        Gives the run with noise, where its samples are needed.

    Returns
    -------
    inside : ndarray of int, shape (K,)
        Points of the output grid.
    deviation : ndarray, shape (K, n)

    Raises
    ------
    NoValue
    """
    observer = run.experiment.observers[label]
    if isinstance(observer, SlidingMode | CorrectedObserver):
        raise NoValue(why_no_flow(observer))
    require_innovation(run, label)
    require_estimate(noise_free.observers[label])
    inside = np.arange(noise_free.time.size)[points_in(noise_free.time, tuple(noise_free.windows["steady"]))]
    at = noise_free.time[inside]
    if isinstance(observer, SampledObserver):
        return inside, _of_jumps(run, label, noise_free, _sound(result(), label), at)
    if (outcome(partial(_delay, run)).found or 0.0) > 0:
        return inside, _late(run, label, noise_free, inside)
    steady = partial(_steady, run, label, noise_free, inside)
    return inside, first_of(steady, lambda: _along(run, label, noise_free, _sound(result(), label), at))


def _sound(result: Result, label: str) -> Result:
    require_estimate(result.observers[label])
    return result


def _of_jumps(run: PreparedRun, label: str, noise_free: Result, result: Result, at: np.ndarray) -> np.ndarray:
    jumps = noise_of_jumps(run, label, result, noise_free)
    place = np.searchsorted(jumps.times, at + 4 * np.spacing(np.abs(at)), side="right") - 1
    return np.where(place[:, None] < 0, 0.0, jumps.estimate[np.maximum(place, 0)])


def _along(run: PreparedRun, label: str, noise_free: Result, result: Result, at: np.ndarray) -> np.ndarray:
    found = noise_along(run, label, result, noise_free, at)
    after = np.clip(np.searchsorted(found.times, at), 1, found.times.size - 1)
    nearer = np.abs(found.times[after - 1] - at) < np.abs(found.times[after] - at)
    return np.asarray(found.estimate[np.where(nearer, after - 1, after)])


def _delay(run: PreparedRun) -> float:
    """The one delay of outputs that are all continuous, always in the same way."""
    delays = set()
    for channel in run.channels:
        stretch = channel.stretches[0]
        if len(channel.stretches) > 1 or not stretch.continuous or not stretch.delay_is_constant:
            raise NoValue("only continuous outputs with a constant delay have a steady response")
        delays.add(float(stretch.delay_at(np.array([stretch.start]))[0]))
    if len(delays) > 1:
        raise NoValue("the outputs differ in their delay")
    return delays.pop()


def _systems(run: PreparedRun, label: str, noise_free: Result, inside: np.ndarray) -> tuple[Linearisation, np.ndarray]:
    """The linearisation and the points of the window where it is looked at."""
    points = inside[np.unique(np.linspace(0, inside.size - 1, _POINTS).astype(int))]
    return Linearisation(run, label), points


def _require_slopes(systems: Linear) -> None:
    if not all(np.all(np.isfinite(value)) for value in vars(systems).values()):
        raise NoValue(NO_SLOPES)


def _one(systems: Linear, omega: np.ndarray, delay: float = 0.0) -> Linear:
    """The mean of systems whose responses at these frequencies are the same.

    Raises
    ------
    NoValue
        When they differ.
    """
    _require_slopes(systems)
    mean = Linear(*[value.mean(axis=0) for value in vars(systems).values()])
    require_hurwitz(relevant(mean))
    expected = response(mean, omega, delay)
    for k in range(len(systems.A0)):
        one = Linear(*[value[k] for value in vars(systems).values()])
        if np.any(np.abs(response(one, omega, delay) - expected) > _SAME * np.abs(expected)):
            late = ", and its output is continuous and delayed" if delay else ""
            raise NoValue(f"the linearisation of the observer changes along the run{late}")
    return mean


def _steady(run: PreparedRun, label: str, noise_free: Result, inside: np.ndarray) -> np.ndarray:
    """The steady response to sinusoids on continuous outputs that are not late."""
    if _delay(run) > 0 or any(channel.stretches[0].multiplicative for channel in run.channels):
        raise NoValue("only additive noise on outputs without delay has a steady response")
    terms = [NoiseTerms.of(channel.noise[0]) for channel in run.channels]
    require_spectra(terms)
    if any(draws.variance > 0 for term in terms for draws in term.draws):
        raise NoValue("random noise has no steady response")
    waves = [(i, wave) for i, term in enumerate(terms) for wave in term.waves]
    omega = np.array([0.0, *(wave.omega for _, wave in waves)])
    observer, points = _systems(run, label, noise_free, inside)
    found, t = noise_free.observers[label], noise_free.time
    xi = observer.states(found, points)
    systems = observer.systems(t[points], xi)
    linear = _one(systems, omega)
    slowest = np.linalg.eigvals(relevant(linear).A).real.max(initial=-np.inf)
    if np.exp(slowest * (t[inside[0]] - run.time.start)) > _SETTLED:
        raise NoValue("the window starts before the response to the noise has settled")

    def course(gains: np.ndarray, times: np.ndarray) -> np.ndarray:
        total = np.tile(gains[0].real @ [term.mean for term in terms], (times.size, 1))
        for k, (i, wave) in enumerate(waves, start=1):
            total += (wave.phasor * np.exp(1j * wave.omega * times)[:, None] * gains[k][:, i]).imag
        return total

    # noise that is not small moves the point where the equations are differentiated
    keep = relevant_states(systems)
    states = restricted(linear, keep)
    full = Linear(states.A0, states.E, states.H, np.eye(keep.size), states.K0, states.K)
    moved = xi.copy()
    moved[:, keep] += course(response(full, omega), t[points])
    _one(Linear(*map(_pair, vars(systems).values(), vars(observer.systems(t[points], moved)).values())), omega)
    return course(response(linear, omega), t[inside])


def _pair(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.concatenate([one, other])


def _late(run: PreparedRun, label: str, noise_free: Result, inside: np.ndarray) -> np.ndarray:
    """The run's own noise through continuous outputs that are late."""
    delay = _delay(run)
    observer, points = _systems(run, label, noise_free, inside)
    systems = observer.trajectory(noise_free.observers[label], points, noise_free.time[points])
    _require_slopes(systems)
    rates = np.abs(np.linalg.eigvals(relevant(Linear(*[v[0] for v in vars(systems).values()])).A))
    linear = _one(systems, np.array([0.0, *rates]), delay)
    at = noise_free.time[inside]
    return noise_of_late_output(run, linear, delay, noise_free, at)
