"""Frequency responses from measurement noise to the estimates, of all observers of a run."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.findings import Context
from hgorun.analysis.linear.transfer import relevant, response
from hgorun.analysis.noise.contributor import at_the_end
from hgorun.analysis.noise.terms import NoiseTerms
from hgorun.result.theory import Bode
from hgorun.analysis.reasons import NoValue

_POINTS = 400
_BEYOND = 30.0  # of the slowest and the fastest frequency shown


def bode(context: Context) -> Bode:
    """Of every observer, linearised at the end of the run as if the output were continuous and not late."""
    systems, reasons = {}, {}
    for label in context.result.observers:
        try:
            systems[label] = at_the_end(context, label)
        except NoValue as reason:
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
