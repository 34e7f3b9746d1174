"""Frequency responses from measurement noise to the estimates, of all observers of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.analysis.findings import Context
from hgorun.analysis.noise_findings import at_the_end
from hgorun.analysis.noise_terms import NoiseTerms
from hgorun.analysis.transfer import NoTheory, relevant, response

_POINTS = 400
_BEYOND = 30.0  # of the slowest and the fastest frequency shown


@dataclass(frozen=True)
class Bode:
    """Amplitudes of the estimates over that of a sinusoid on the measurement.

    Attributes
    ----------
    omega : ndarray, shape (W,)
        rad per time unit.
    magnitude : dict of str to ndarray, shape (W, n)
        By observer; the largest over outputs.
    states : tuple of str
    own : ndarray
        The frequencies of the configuration's own sinusoids.
    reasons : dict of str to str
        Why an observer is not there.
    """

    omega: np.ndarray
    magnitude: dict[str, np.ndarray]
    states: tuple[str, ...]
    own: np.ndarray
    reasons: dict[str, str]


def bode(context: Context) -> Bode:
    """Of every observer, linearised at the end of the run as if the output were continuous and not late."""
    systems, reasons = {}, {}
    for label in context.result.observers:
        try:
            systems[label] = at_the_end(context, label)
        except NoTheory as reason:
            reasons[label] = str(reason)
    own = sorted(
        {
            abs(wave.omega)
            for channel in context.run.channels
            for stretch, random in zip(channel.stretches, channel.random, strict=True)
            for wave in NoiseTerms.of(stretch, random).waves
        }
    )
    speeds = [np.abs(np.linalg.eigvals(relevant(linear).A)) for linear in systems.values()]
    known = np.concatenate([*speeds, np.array(own), np.ones(1)])
    known = known[known > 0]
    omega = np.logspace(np.log10(known.min() / _BEYOND), np.log10(known.max() * _BEYOND), _POINTS)
    magnitude = {label: np.abs(response(linear, omega)).max(axis=2) for label, linear in systems.items()}
    return Bode(omega, magnitude, context.result.states, np.array(own), reasons)
