"""Frequency responses from measurement noise to the estimates, of all observers of a run."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.linear import Linear, Linearisation
from hgorun.analysis.linear.transfer import relevant, require_hurwitz, response
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.analysis.reasons import JUMPS, NoValue, outcomes, require_estimate
from hgorun.analysis.subject import Context, Subject, once
from hgorun.observers.base import SampledObserver
from hgorun.result.theory import Bode

_POINTS = 400
_BEYOND = 30.0  # of the slowest and the fastest frequency shown


@once
def linear_at_end(observer: Subject) -> Linear:
    """The linearised observer at the last point of the run, with no innovation.

    Raises
    ------
    NoValue
        When it is not Hurwitz there, or there is no such system.
    """
    if isinstance(observer.observer, SampledObserver):
        raise NoValue(JUMPS)
    require_estimate(observer.found)
    linearisation, last = Linearisation(observer.run, observer.label), observer.result.time.size - 1
    linear = linearisation.at(float(observer.result.time[-1]), linearisation.along(observer.found, last))
    require_hurwitz(linear)
    return linear


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
    speeds = [np.abs(np.linalg.eigvals(relevant(linear).A)) for linear in systems.values()]
    known = np.concatenate([*speeds, np.array(own), np.ones(1)])
    known = known[known > 0]
    omega = np.logspace(np.log10(known.min() / _BEYOND), np.log10(known.max() * _BEYOND), _POINTS)
    magnitude = {label: np.abs(response(linear, omega)).max(axis=2) for label, linear in systems.items()}
    return Bode(omega, magnitude, context.result.states, np.array(own), reasons)
