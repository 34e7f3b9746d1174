"""Frequency responses from measurement noise to the estimates, of all observers of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.sinusoids import with_theta
from hgorun.analysis.linear.transfer import response, restricted, steady_part
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.analysis.reasons import NoValue, outcomes, require_estimate, why_no_flow
from hgorun.analysis.subject import Context, Subject, once
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.theory import Bode
from hgorun.simulation.simulate import prepare, simulate_prepared

_POINTS = 400
_BEYOND = 30.0  # of the slowest and the fastest frequency shown


@once
def linear_at_end(observer: Subject) -> Linear:
    """The linearised observer at the last point of the run, with no innovation.

    Of its states those that noise reaches and that reach the estimate. A gain that follows an equation of its own, such
    as Riccati's, is not among them: it is what it is there, and its eigenvalues decide nothing.

    Raises
    ------
    NoValue
        When the error is not Hurwitz there, or there is no such system.
    """
    if isinstance(observer.observer, SampledObserver | CorrectedObserver):
        raise NoValue(why_no_flow(observer.observer))
    require_estimate(observer.found)
    return _at_end(Linearisation(observer.run, observer.label), observer.result.time, observer.found)


def with_other_theta(observer: Subject, theta: float) -> Linear:
    """The same system with another theta: the same estimate, and the gains that theta would have led to.

    Gains that follow an equation of their own are taken from another run.

    Raises
    ------
    NoValue
    """
    found, other = observer.found, prepare(with_theta(observer.run.experiment, observer.label, theta))
    gains = [name for name, role in observer.observer.roles(observer.form).items() if role == "gain"]
    if gains:
        there = simulate_prepared(other).observers[observer.label]
        found = replace(found, internal={**found.internal, **{name: there.internal[name] for name in gains}})
    return _at_end(Linearisation(other, observer.label), observer.result.time, found)


def _at_end(linearisation: Linearisation, time: np.ndarray, found: ObserverResult) -> Linear:
    linear = linearisation.at(float(time[-1]), linearisation.along(found, time.size - 1))
    return steady_part(restricted(linear, _without_gains(linearisation)))


def _without_gains(linearisation: Linearisation) -> np.ndarray:
    """Places of the states that are not gains."""
    block = linearisation.block
    kept = np.ones(linearisation.size, dtype=bool)
    for name, role in block.observer.roles(block.form).items():
        if role == "gain":
            place = block.states[name]
            kept[place.start - block.start :][: place.size] = False
    return np.flatnonzero(kept)


def frequency_responses(context: Context) -> Bode:
    """Of every observer, linearised at the end of the run as if the output were continuous and not late."""
    subjects = context.subjects
    systems, reasons = outcomes(subjects, lambda label: linear_at_end(subjects[label]))
    own = sorted(
        {
            abs(wave.omega)
            for channel in context.run.channels
            for noise in channel.noise
            for wave in NoiseTerms.of(noise).waves
        }
    )
    speeds = [np.abs(np.linalg.eigvals(linear.A)) for linear in systems.values()]
    known = np.concatenate([*speeds, np.array(own), np.ones(1)])
    known = known[known > 0]
    omega = np.logspace(np.log10(known.min() / _BEYOND), np.log10(known.max() * _BEYOND), _POINTS)
    magnitude = {label: np.abs(response(linear, omega)).max(axis=2) for label, linear in systems.items()}
    return Bode(omega, magnitude, context.result.states, np.array(own), reasons)
