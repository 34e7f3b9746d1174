"""Continuous outputs as functions of time: their noise without its random parts, and their delay."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.config.expressions import parse
from hgorun.config.literals import Template, template
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.events import Irregular, Kinks, infinite, too_many
from hgorun.measurement.sampling import SAMPLE_BYTES
from hgorun.memo import Memo
from hgorun.noise.base import TimeFunction
from hgorun.symbolic.crossings import TooMany
from hgorun.symbolic.evaluate import along
from hgorun.symbolic.parameters import Parameters, flat

_COMPILED: Memo[tuple[ca.Function, Kinks, Kinks]] = Memo(256)


@dataclass(frozen=True)
class Signal:
    """A continuous output in one phase: v(t) without its held part, how it enters, and the delay."""

    noise: ca.SX
    multiplicative: bool
    delay: ca.SX


def signal_structure(stretch: Stretch) -> Hashable:
    """What is compiled of a stretch: equal for stretches that differ in their numbers only; None between samples."""
    if not stretch.continuous:
        return None
    functions = tuple((type(item), item.structure()) for item in _functions(stretch))
    return stretch.multiplicative, _delay(stretch)[0], functions


def signal(stretch: Stretch, t: ca.SX, parameters: Parameters, name: str) -> Signal:
    """The signal as expressions; its numbers become run-time parameters called by a name."""
    noise = ca.SX(0)
    for i, item in enumerate(_functions(stretch)):
        numbers = {key: parameters.add(f"{name}.{i}.{key}", values) for key, values in item.numbers().items()}
        noise += item.symbol(t, numbers)
    lifted, values = _delay(stretch)
    delay = lifted.symbol({"t": t}, parameters.add(f"{name}.delay", values))
    return Signal(noise, stretch.multiplicative, delay)


def signal_numbers(stretch: Stretch) -> np.ndarray:
    """The values of a signal's parameters, in their order."""
    of_noise = [flat(values) for item in _functions(stretch) for values in item.numbers().values()]
    return np.concatenate([*of_noise, flat(_delay(stretch)[1])])


def noise_at(stretch: Stretch, times: np.ndarray) -> np.ndarray:
    """v(t) without its random parts."""
    return along(_compiled(stretch)[0], times, signal_numbers(stretch))


def kinks_of(stretch: Stretch, max_memory: float) -> Irregular:
    """Where noise or delay have a kink or a jump.

    Raises
    ------
    Problem
        Where there are more than fit into memory, and where one of them is not finite.
    """
    _, *kinks = _compiled(stretch)
    found = []
    for key, one in zip(("noise", "delay"), kinks, strict=True):
        try:
            most = max_memory / SAMPLE_BYTES
            found.append(one.between(signal_numbers(stretch), stretch.start, stretch.end, most))
        except TooMany as error:
            raise Problem(stretch.paths[key], too_many(error, f"the functions of {key}", max_memory)) from None
        when = found[-1].infinite
        if when is not None:
            raise Problem(stretch.paths[key], infinite(when))
    noise, delay = found
    return Irregular(np.union1d(noise.times, delay.times), noise.lost + delay.lost)


def _functions(stretch: Stretch) -> list[TimeFunction]:
    return [item for item in stretch.noise if isinstance(item, TimeFunction)]


def _delay(stretch: Stretch) -> tuple[Template, tuple[float, ...]]:
    return template(parse(stretch.delay, names=("t",)))


def _compiled(stretch: Stretch) -> tuple[ca.Function, Kinks, Kinks]:
    """The noise, its kinks, and those of the delay."""

    def make() -> tuple[ca.Function, Kinks, Kinks]:
        t, parameters = ca.SX.sym("t"), Parameters()
        found = signal(stretch, t, parameters, "")
        p = parameters.symbol
        return ca.Function("v", [t, p], [found.noise]), Kinks.of([found.noise], t, p), Kinks.of([found.delay], t, p)

    return _COMPILED.get(signal_structure(stretch), make)
