"""Whether a gain is too large for how rarely, or how late, outputs are measured; and what would not be.

Near the truth the error of a high-gain observer with sampled or late outputs is a linear hybrid system, whose monodromy
matrix tells by how much it grows from sample to sample. Where it grows at all of some points along the plant's way, no
estimate comes to rest there, however good it was at the start.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.errors import HgorunError, printable
from hgorun.measurement.blocks import Periodic
from hgorun.observers.base import AnyObserver, ContinuousObserver, DecidedObserver
from hgorun.observers.capabilities import (
    FollowingGain,
    GainOfErrors,
    NotLinear,
    OneGain,
    SeveralGains,
    SlidingMode,
    Speed,
)
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.error_dynamics.apart import Apart
from hgorun.simulation.error_dynamics.resting import Unsettled
from hgorun.simulation.error_dynamics.small_errors import AnyTiming, SmallErrors
from hgorun.simulation.error_dynamics.timing import Timing, below
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.evaluate import Floats

_GROWS = 1 + 1e-6  # from sample to sample: less may be rounding of 1
_RATIO, _PRECISION = 1.3, 3e-3  # of neighbouring values in a search, and of what it finds
_SMALLEST = 1e-2  # of the times in use: the search begins there
_SLOWEST = 1e-4  # a rate times period and delay: what so slow an observer does from sample to sample may be rounding


@dataclass(frozen=True)
class _Gain:
    """What sets the speed of small errors: a key of the block with its value, or the rate that follows from others."""

    key: str | None
    value: float
    said: str = ""  # another key that it follows from
    part: float = 1.0  # what that is of it

    @classmethod
    def of(cls, observer: AnyObserver, block: ObserverBlock, error: SmallErrors) -> list[_Gain]:
        """The fastest first; none where nothing is known of them."""
        if isinstance(observer, Speed) and observer.speed_keys:
            return [cls(key, observer.speed_of(key)) for key in observer.speed_keys]
        own = isinstance(observer, FollowingGain)
        value = float(error.fastest() if own else observer.error_rate(block.form) or 0.0)
        return [cls(None, value)] if value > 0 else []

    def told(self, unit: str) -> str:
        """The subject of a sentence."""
        if self.key is not None:
            follows = f", which follows from {self.said} = {self.part * self.value:.4g}," if self.part != 1 else ""
            return f"{self.key} = {self.value:.4g}{follows} is"
        return f"the gains, which make it as fast as {self.value:.3g} per {unit or 'time unit'}, are"


def too_large(run: PreparedRun, raw: Raw, j: int) -> str | None:
    """That its gain is, and limits of the linearised error; None where that is not so, or not known.

    Of gains that are states it is that of large errors, where they follow errors, or where they rest, where they
    follow the plant. Not said of others, and of what decides otherwise, jumps, looks back or has no linearisation.
    """
    block = run.observers[j]
    timing, x = _timing(run, treatment_of(block.observer)), raw.rows[:, run.structure.truths[j], 0]
    if timing is None:
        return None
    return (
        _of_each(run, block, timing, x) if isinstance(block.observer, SeveralGains) else _found(run, block, timing, x)
    )


def _of_each(run: PreparedRun, block: ObserverBlock, timing: AnyTiming, x: Floats) -> str | None:
    """Of an observer that chooses among gains: of the first one with which errors grow."""
    assert isinstance(block.observer, SeveralGains)
    others: dict[str, Any] = {f"observers.{label}": None for label in run.experiment.observers if label != block.label}
    for one in block.observer.alone():
        with suppress(HgorunError):  # it needs what the other one does not
            alone = prepare(run.experiment.varied({**others, f"observers.{block.label}": dict(one.block)}))
            if (told := _found(alone, alone.observers[0], timing, x, of=one)) is not None:
                return told
    return None


def too_large_for(run: PreparedRun, j: int, timing: AnyTiming) -> str | None:
    """The same of recorded samples; along no truth, but where the estimate begins."""
    begins = run.structure.estimates[j].along(run.grid[:1], run.numbers.p, run.numbers.z0[None])
    return _found(run, run.observers[j], timing, np.asarray(begins), " where the estimate begins")


def _found(
    run: PreparedRun, block: ObserverBlock, timing: AnyTiming, x: Floats, where: str = "", of: OneGain | None = None
) -> str | None:
    """Of an observer, along the states x of the plant; ``where`` these are, if it is not on its whole way.

    ``of``: it stands for another one.
    """
    observer = block.observer
    if not isinstance(observer, ContinuousObserver) or block.recalled or run.closed:
        return None
    if not isinstance(observer, GainOfErrors):
        moved = "gain" in observer.roles(block.form).values() and not isinstance(observer, FollowingGain)
        if moved or isinstance(observer, NotLinear | SlidingMode | DecidedObserver):
            return None
    try:
        error = SmallErrors(run, block, x)
        gains = _Gain.of(observer, block, error)
        if of is not None:
            gains = [replace(gain, said=of.key, part=of.part) for gain in gains]
            where = f" {of.while_so}".rstrip()
        told = (_limits(run, error, gains[i:], timing, len(gains) > 1, where) for i in range(len(gains)))
        return next(filter(None, told), None)
    except (HgorunError, Unsettled, ValueError, RuntimeError, np.linalg.LinAlgError):  # no slopes, or no observer
        return None


def _limits(
    run: PreparedRun, error: SmallErrors, gains: list[_Gain], timing: AnyTiming, several: bool, where: str
) -> str | None:
    """Of the first gain, beside slower ones; None where the errors that it sets the speed of do not grow."""
    gain, *slower = gains
    if several and gain.key is not None:  # errors of a size of their own
        error = error.with_value(gain.key, gain.value)
    if not error.smallest_growth(timing) > _GROWS:
        return None
    slowest = _SLOWEST / timing.longest
    part = _largest_part(lambda part: error.growth(timing.scaled(part)), slowest / gain.value)
    value = _largest_value(error, gain, timing, part, slowest)
    beside = [other.key for other in slower if other.key and value is not None and other.value >= value]
    whole = isinstance(error.block.observer, GainOfErrors) and not several
    what = "large errors" if slower else "errors that the whole gain corrects" if whole else "even small errors"
    if value is None and part is None:
        return None
    unit = printable(run.time.unit)
    limit = (
        None
        if value is None
        else f"{gain.said or gain.key} of at most {below(gain.part * value)}"
        + "".join(f" with {key} below it" for key in beside)
    )
    holds = f"they do not with {timing.limits(limit, part, unit)}"
    told = f"{gain.told(unit)} too large for {timing.told(unit)}, since {what} grow{where}: {holds}"
    return f"{told}; take less, since it also corrects with parts of that gain" if whole else told


def _timing(run: PreparedRun, treatment: str) -> AnyTiming | None:
    """What all outputs have in common, all the time, or when each of several is sampled; None where neither is so.

    An observer that goes back to late samples is, in the past, one without delay: errors grow there or not. It reaches
    the present from there, after a time that does not depend on how often samples come.
    """
    if any(len(stretches) != 1 for stretches in run.experiment.stretches):
        return None
    found, offsets = dict[str, Timing](), list[float]()
    for name, (stretch,) in zip(run.plant.model.outputs, run.experiment.stretches, strict=True):
        sampling = stretch.sampling
        if not stretch.delay_is_constant or not (stretch.continuous or isinstance(sampling, Periodic)):
            return None
        (delay,) = stretch.delay_at(np.array([stretch.start]))
        past = treatment == "replay" and isinstance(sampling, Periodic)
        found[name] = Timing(stretch.period, 0.0 if past else float(delay))
        offsets.append(sampling.offset if isinstance(sampling, Periodic) else 0.0)
    timing, *others = set(found.values())
    if (timing.delay and run.treatments and treatment != "innovation") or (not timing.period and not timing.delay):
        return None
    periods = {name: one.period for name, one in found.items() if one.period and not one.delay}
    if len(periods) == len(found) and (others or np.ptp(offsets) > 0):
        return Apart.of_periods(periods, offsets)
    return None if others else timing


def _largest_part(growth: Callable[[float], float], least: float) -> float | None:
    """How large a part of the times in use may be, the first where errors grow; None if the least is too large."""
    low = _SMALLEST
    while growth(low) >= 1:
        low /= 10
        if low < least:
            return None
    high = low * _RATIO
    while high < 1 and growth(high) < 1:
        low, high = high, high * _RATIO
    return _halved(growth, low, min(high, 1.0))


def _largest_value(
    error: SmallErrors, gain: _Gain, timing: AnyTiming, part: float | None, slowest: float
) -> float | None:
    """The value below the one in use with which errors no longer grow; about in inverse proportion to times.

    Where no part of these is short enough, the plant may be too fast for them alone, and a smaller value may do.
    """
    key = gain.key
    if key is None:
        return None

    def growth(value: float) -> float:
        return error.with_value(key, value).growth(timing)

    high = gain.value * (1.0 if part is None else min(2 * part, 1.0))
    while (low := high / _RATIO) > slowest:
        if growth(low) < 1:
            return _halved(growth, low, high)
        high = low
    return None


def _halved(growth: Callable[[float], float], low: float, high: float) -> float:
    """The largest value between two at which errors do not grow."""
    while high - low > _PRECISION * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if growth(middle) < 1 else (low, middle)
    return low
