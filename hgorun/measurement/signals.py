"""Continuous outputs as functions of time: their noise without its random parts, and their delay."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from hgorun.config.expressions import parse
from hgorun.config.literals import Template, template
from hgorun.errors import Problem, called
from hgorun.measurement.availability import Stretch
from hgorun.measurement.events import Irregular, Kinks, infinite, not_followed, too_many
from hgorun.measurement.extremes import Unknown, extremes, usual_rate
from hgorun.measurement.sizes import EVENT_BYTES
from hgorun.memo import Memo
from hgorun.noise.base import RandomNoise, TimeFunction
from hgorun.pieces import distinct
from hgorun.symbolic.clock import on_the_clock
from hgorun.symbolic.crossings import TooMany
from hgorun.symbolic.evaluate import along
from hgorun.symbolic.parameters import Parameters, flat

_POINTS = 4_000  # at which a delay is looked at beside its kinks and extremes


@dataclass(frozen=True, eq=False, repr=False)
class _Compiled:
    """A stretch's noise, its kinks, those of the delay, and the extremes of both."""

    noise: ca.Function
    kinks: Kinks
    delay_kinks: Kinks
    slopes: Kinks


_COMPILED: Memo[_Compiled] = Memo(256)


@dataclass(frozen=True, eq=False, repr=False)
class Signal:
    """A continuous output in one phase: v(t) without its held part, how it enters, and the delay.

    Attributes
    ----------
    drawn : bool
        Whether there is a held part, too.
    """

    noise: ca.SX
    multiplicative: bool
    delay: ca.SX
    drawn: bool


def signal_structure(stretch: Stretch) -> Hashable:
    """What is compiled of a stretch: equal for stretches that differ in their numbers only; None between samples."""
    if not stretch.continuous:
        return None
    functions = tuple((type(item), item.structure()) for item in _functions(stretch))
    return stretch.origin, stretch.multiplicative, _delay(stretch)[0], functions, _drawn(stretch)


def signal(stretch: Stretch, t: ca.SX, parameters: Parameters, name: str) -> Signal:
    """The signal as expressions; its numbers become run-time parameters called by a name."""
    t = on_the_clock(t, stretch.origin)
    noise = ca.SX(0)
    for i, item in enumerate(_functions(stretch)):
        numbers = {key: parameters.add(f"{name}.{i}.{key}", values) for key, values in item.numbers().items()}
        with called("noise", item.type, "symbol"):
            noise += item.symbol(t, numbers)
    lifted, values = _delay(stretch)
    delay = lifted.symbol({"t": t}, parameters.add(f"{name}.delay", values))
    return Signal(noise, stretch.multiplicative, delay, _drawn(stretch))


def _drawn(stretch: Stretch) -> bool:
    return any(isinstance(item, RandomNoise) for item in stretch.noise)


def signal_numbers(stretch: Stretch) -> np.ndarray:
    """The values of a signal's parameters, in their order."""
    of_noise = [flat(values) for item in _functions(stretch) for values in item.numbers().values()]
    return np.concatenate([*of_noise, flat(_delay(stretch)[1])])


def noise_at(stretch: Stretch, times: np.ndarray) -> np.ndarray:
    """v(t) without its random parts."""
    if not any(isinstance(item, TimeFunction) for item in stretch.noise):
        return np.zeros(times.shape)
    return along(_compiled(stretch).noise, times, signal_numbers(stretch))


def kinks_of(stretch: Stretch, max_memory: float) -> Irregular:
    """Where noise or delay have a kink or a jump.

    Raises
    ------
    Problem
        Where there are more than fit into memory, and where one of them is not finite.
    """
    compiled, found = _compiled(stretch), []
    for key, one in (("noise", compiled.kinks), ("delay", compiled.delay_kinks)):
        try:
            limit = max_memory / EVENT_BYTES
            found.append(one.between(signal_numbers(stretch), stretch.start, stretch.end, limit))
        except TooMany as error:
            raise Problem(stretch.paths[key], too_many(error, f"the functions of {key}", max_memory)) from None
        when = found[-1].infinite
        if when is not None:
            raise Problem(stretch.paths[key], infinite(stretch.origin + when))
    noise, delay = found
    return Irregular(distinct(np.concatenate([noise.times, delay.times])), noise.lost + delay.lost)


def extremes_of(stretch: Stretch) -> Irregular:
    """Extremes of noise and delay that no step should pass over, where noise does not say itself how fast it is."""
    functions = _functions(stretch)
    fast = bool(functions) and all(item.fastest(stretch.start, stretch.end) > 0 for item in functions)
    if fast and not parse(stretch.delay, names=("t",)).names:
        return Irregular(np.zeros(0), ())
    return extremes(_compiled(stretch).slopes, signal_numbers(stretch), stretch.start, stretch.end)


def unknown_extremes(stretch: Stretch) -> list[Unknown]:
    """Noise and delay, where their extremes may not all have been found."""
    lost = tuple((stretch.origin + a, stretch.origin + b) for a, b in extremes_of(stretch).lost)
    if not lost:
        return []
    rate = usual_rate(_compiled(stretch).slopes, signal_numbers(stretch), stretch.start, stretch.end)
    return [Unknown(".".join(map(str, stretch.paths["noise"])), False, lost, (stretch.end - stretch.start) * rate)]


def signal_remarks(stretch: Stretch, max_memory: float) -> list[str]:
    """What is said of noise or a delay whose kinks could not all be found."""
    lost = kinks_of(stretch, max_memory).lost
    return [not_followed(".".join(map(str, stretch.paths["noise"])), lost, stretch.origin)] if lost else []


def delay_range(stretch: Stretch) -> tuple[float, float]:
    """The smallest and the largest delay of a continuous output.

    Raises
    ------
    Problem
        Where a delay is negative or not a number.
    """
    expression = parse(stretch.delay, names=("t",))
    if not expression.names:
        (delay,) = stretch.valid_delay_at(np.array([stretch.start]))
        return float(delay), float(delay)
    found = _extremes(stretch.delay, stretch.origin).between(np.zeros(0), stretch.start, stretch.end).times
    beside = found + 4 * np.spacing(found) * np.array([[-1.0], [0.0], [1.0]])
    inside = np.clip(beside, stretch.start, stretch.end).ravel()
    times = distinct(np.concatenate([np.linspace(stretch.start, stretch.end, _POINTS), inside]))
    delays = stretch.valid_delay_at(times)
    return float(delays.min()), float(delays.max())


@lru_cache(maxsize=64)
def _extremes(delay: str, origin: float) -> Kinks:
    """Where a delay has its kinks, its jumps, and a slope of zero."""
    t = ca.SX.sym("t")
    value = parse(delay, names=("t",)).symbol({"t": on_the_clock(t, origin)})
    return Kinks.of([value, ca.sign(ca.jacobian(value, t))], t, ca.SX(0, 1))


def _functions(stretch: Stretch) -> list[TimeFunction]:
    return [item for item in stretch.noise if isinstance(item, TimeFunction)]


def _delay(stretch: Stretch) -> tuple[Template, tuple[float, ...]]:
    return template(parse(stretch.delay, names=("t",)))


def _compiled(stretch: Stretch) -> _Compiled:
    def make() -> _Compiled:
        t, parameters = ca.SX.sym("t"), Parameters()
        found = signal(stretch, t, parameters, "")
        p, both = parameters.symbol, [found.noise, found.delay]
        kinks = [Kinks.of([one], t, p) for one in both]
        return _Compiled(ca.Function("v", [t, p], [found.noise]), kinks[0], kinks[1], Kinks.of_slopes(both, t, p))

    return _COMPILED.get(signal_structure(stretch), make)
