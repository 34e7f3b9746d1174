"""Continuous outputs as functions of time: their noise without its random parts, and their delay."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.measurement.availability import Stretch
from hgorun.measurement.events import Kinks
from hgorun.measurement.noise import continuous_delay, continuous_noise, continuous_numbers, continuous_structure
from hgorun.memo import Memo
from hgorun.symbolic.evaluate import along
from hgorun.symbolic.parameters import Parameters, flat

_COMPILED: Memo[tuple[ca.Function, Kinks]] = Memo(256)


@dataclass(frozen=True)
class Signal:
    """A continuous output in one phase: v(t) without its held part, how it enters, and the delay."""

    noise: ca.SX
    multiplicative: bool
    delay: ca.SX


def signal(stretch: Stretch, t: ca.SX, parameters: Parameters, name: str) -> Signal:
    """The signal as expressions, its numbers among the parameters."""
    numbers = continuous_numbers(stretch)
    symbols = {key: parameters.add(f"{name}.{key}", values) for key, values in numbers.items()}
    return Signal(
        continuous_noise(stretch, t, symbols), stretch.multiplicative, continuous_delay(stretch, t, symbols)
    )


def signal_structure(stretch: Stretch) -> Hashable:
    """What is compiled of it; None where there is nothing, between samples."""
    return continuous_structure(stretch) if stretch.continuous else None


def signal_numbers(stretch: Stretch) -> np.ndarray:
    """The values of its parameters, in their order."""
    return np.concatenate([flat(values) for values in continuous_numbers(stretch).values()])


def noise_at(stretch: Stretch, times: np.ndarray) -> np.ndarray:
    """v(t) without its random parts."""
    return along(_compiled(stretch)[0], times, signal_numbers(stretch))


def kinks_of(stretch: Stretch, points: int) -> np.ndarray:
    """Where noise or delay have a kink or a jump."""
    return _compiled(stretch)[1].between(signal_numbers(stretch), stretch.start, stretch.end, points)


def _compiled(stretch: Stretch) -> tuple[ca.Function, Kinks]:
    def make() -> tuple[ca.Function, Kinks]:
        t, parameters = ca.SX.sym("t"), Parameters()
        found = signal(stretch, t, parameters, "")
        p = parameters.symbol
        return ca.Function("v", [t, p], [found.noise]), Kinks.of([found.noise, found.delay], t, p)

    return _COMPILED.get(continuous_structure(stretch), make)
