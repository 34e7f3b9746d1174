"""When samples arrive, when they were measured, and which of them are used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hgorun.config.expressions import ExpressionError
from hgorun.errors import KeyPath, Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.blocks import Periodic, Steps, Times
from hgorun.measurement.chance import Chance, OfSeed
from hgorun.measurement.samples import AnySamples, RegularSamples, Samples
from hgorun.measurement.sizes import COUNTABLE, SAMPLE_BYTES
from hgorun.measurement.trains import Train
from hgorun.memo import Memo
from hgorun.symbolic.evaluate import along, compiled

Uniform = Callable[..., np.ndarray]  # of a count and a channel: draws from [0, 1), shape (..., count)

_KEPT = 100_000  # samples that are kept in memory


_LONG = 1 << 16  # periodic samples that are not kept as arrays
_FOUND: Memo[AnySamples] = Memo(16, lambda samples: isinstance(samples, Samples) and samples.size < _KEPT)


def find_samples(
    stretches: list[Stretch], start: float, seed: int, output: str, limit: int, chance: Chance | None = None
) -> AnySamples:
    """All samples of an output: one object for all runs in which they are the same.

    Parameters
    ----------
    chance : Chance, optional
        The random numbers of the seed, where they are made together with those of others.

    Raises
    ------
    Problem
        For a negative delay or more than ``limit`` samples that do not follow from their number.
    """
    timing = tuple((s.start, s.end, s.origin, s.sampling, s.delay) for s in stretches)
    by_chance = (seed, output) if any(s.sampled_by_chance for s in stretches) else None

    def find() -> AnySamples:
        return _found(stretches, start, chance or OfSeed(seed), output, limit)

    if by_chance is not None and chance is not None:  # one of many, each of which is asked for once
        return find()
    return _FOUND.get((timing, start, by_chance, limit, _LONG), find)


def _found(stretches: list[Stretch], start: float, chance: Chance, output: str, limit: int) -> AnySamples:
    def all_at_once() -> Samples:
        return _samples(stretches, start, chance, output, limit)

    trains = _trains(stretches)
    if trains is not None and sum(train.size for _, train in trains) > _LONG:
        return RegularSamples(trains, all_at_once)
    return all_at_once()


def _trains(stretches: list[Stretch]) -> tuple[tuple[int, Train], ...] | None:
    """The samples of every sampled stretch, where all of them are regular and in time."""
    found = []
    for i, stretch in enumerate(stretches):
        if stretch.continuous:
            continue
        if stretch.regular is None or not stretch.undelayed:
            return None
        sampling, last = stretch.regular, i == len(stretches) - 1
        first, span, most = stretch.start + sampling.offset, (stretch.start, stretch.end), _most(stretch, sampling)
        if most > COUNTABLE:
            return None
        size = int(most)
        train = Train(first, sampling.period, size, *span)
        while size and not _belong(train.unbounded(np.array([size - 1])), stretch, last)[0]:
            size -= 1
        found.append((i, replace(train, size=size)))
    return tuple(found)


def _most(stretch: Stretch, sampling: Periodic) -> float:
    """How many periodic samples may lie in a stretch, a whole number."""
    span = stretch.end - stretch.start - sampling.offset
    rounding = 1e-9 + 2 * stretch.spacing / sampling.period
    return max(float(np.floor(span / sampling.period * (1 + 1e-12) + rounding)) + 1, 0.0)


def _samples(stretches: list[Stretch], start: float, chance: Chance, output: str, limit: int) -> Samples:
    arrival, taken, number, which = [], [], [], []
    left = limit
    for i, stretch in enumerate(stretches):
        if stretch.continuous:
            continue
        last = i == len(stretches) - 1
        times, k = _arrivals(stretch, last, chance, (output, i), left)
        left -= times.size
        inside = _belong(times, stretch, last)
        times, k = np.clip(times[inside], stretch.start, stretch.end), k[inside]
        arrival.append(times)
        delays = stretch.valid_delay_at(times)
        taken.append(np.maximum(times - delays, start) if delays.any() else times)
        number.append(k)
        which.append(np.full(times.size, i))
    if not arrival:
        empty, none = np.zeros(0), np.zeros(0, dtype=np.int64)
        return Samples(empty, empty, none, none, none.astype(bool))
    arrivals = np.concatenate(arrival)
    all_taken = arrivals if all(a is b for a, b in zip(arrival, taken, strict=True)) else np.concatenate(taken)
    newest = np.maximum.accumulate(np.concatenate([[-np.inf], all_taken]))[:-1]
    # times that are equal on paper may differ by rounding
    tolerance = _rounding(stretches[0], stretches[-1])
    used = all_taken >= newest - tolerance
    return Samples(arrivals, all_taken, np.concatenate(number), np.concatenate(which), used)


def _rounding(first: Stretch, last: Stretch) -> float:
    """By how much times from one stretch to another may differ that are equal on paper."""
    return max(1e-12 * (last.end - first.start), 8 * first.spacing, 8 * last.spacing)


def _belong(times: np.ndarray, stretch: Stretch, last: bool) -> np.ndarray:
    """Which times lie in a stretch: its end belongs to the next one, where there is one."""
    tolerance = _rounding(stretch, stretch)
    before = times <= stretch.end + tolerance if last else times < stretch.end - tolerance
    return np.asarray((times >= stretch.start - tolerance) & before)


def _arrivals(
    stretch: Stretch, last: bool, chance: Chance, of: tuple[str, int], limit: int
) -> tuple[np.ndarray, np.ndarray]:
    """Times and numbers; jitter and dropout draw apart, so that a longer run begins with the same samples."""
    sampling, path = stretch.sampling, stretch.paths["sampling"]
    if isinstance(sampling, Times):
        times = np.array([float(t) - stretch.origin for t in sampling.times])
        outside = times[(times < stretch.start) | (times > stretch.end)]
        if outside.size == times.size:
            raise Problem(
                (*path, "times"),
                f"no sample lies between {stretch.origin + stretch.start:g} and {stretch.origin + stretch.end:g}",
            )
        return times, np.arange(times.size)
    if isinstance(sampling, Periodic):
        count = _most(stretch, sampling)
        if count > limit:
            raise Problem((*path, "period"), f"{count:.3g} samples take {_memory(count, limit)}")
        k = np.arange(int(count))
        times = stretch.start + sampling.offset + k * sampling.period
        if not sampling.jitter and not sampling.dropout:  # then there is nothing to draw
            inside = _belong(times, stretch, last)
            return (times, k) if inside.all() else (times[inside], k[inside])
        times, kept = _by_chance(stretch, sampling, times, last, chance.uniform, of)
        times, k = (times, k) if kept.all() else (times[kept], k[kept])
        if np.all(times[1:] >= times[:-1]):
            return times, k
        order = np.argsort(times, kind="stable")
        return times[order], k[order]
    assert isinstance(sampling, Steps)  # what is continuous has no samples
    return _stepped(stretch, sampling.steps, (*path, "steps"), limit)


def _by_chance(
    stretch: Stretch, sampling: Periodic, times: np.ndarray, last: bool, uniform: Uniform, of: tuple[str, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Where samples have moved to, and which of them are kept, each of shape (..., count): of one run or of many."""
    kept = _belong(times, stretch, last)  # jitter moves no sample of the next stretch back into this one
    if sampling.dropout:
        kept = kept & (uniform(times.size, "dropout", *of) >= sampling.dropout)
    if sampling.jitter:
        shifts = (2.0 * uniform(times.size, "sampling", *of) - 1.0) * sampling.jitter
        times = np.clip(times + shifts, stretch.start, stretch.end)
    return times, kept


def samples_by_chance(stretch: Stretch, uniform: Uniform, output: str) -> tuple[np.ndarray, np.ndarray]:
    """When the samples of an output arrive in many runs, and which of them are kept, both of shape (runs, count).

    Parameters
    ----------
    stretch : Stretch
        The only one, whose samples are moved or lost by chance.
    uniform : callable
        The random numbers of all runs.
    """
    sampling = stretch.sampling
    assert isinstance(sampling, Periodic)
    times = stretch.start + sampling.offset + np.arange(int(_most(stretch, sampling))) * sampling.period
    moved, kept = np.broadcast_arrays(*_by_chance(stretch, sampling, times, True, uniform, (output, 0)))
    return moved, kept


def _memory(count: float, limit: int) -> str:
    need, left = (SAMPLE_BYTES * n / 2**30 for n in (count, limit))
    return f"about {need:.3g} GiB; time.max_memory leaves {left:.3g} GiB for them"


def _stepped(stretch: Stretch, text: str, path: KeyPath, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """t_0 = start, t_(k+1) = t_k + steps(k)."""
    try:
        steps = compiled(text, "k")
    except ExpressionError as error:
        raise Problem(path, str(error)) from error
    times, block = np.array([stretch.start]), 1024
    while times[-1] <= stretch.end:
        numbers = np.arange(times.size - 1, times.size - 1 + block)
        values = along(steps, numbers)
        bad = ~(np.isfinite(values) & (values > 0))
        if np.any(bad):
            first = int(np.argmax(bad))
            reached = times[-1] + values[:first].sum()
            if reached <= stretch.end:
                raise Problem(path, f"steps must be positive, found {values[first]:g} at k = {numbers[first]}")
            values = values[:first]
        times = np.concatenate([times, times[-1] + np.cumsum(values)])
        if times.size > limit:
            raise Problem(
                path,
                f"at t = {stretch.origin + times[-1]:g} there are {times.size} samples, which take "
                f"{_memory(times.size, limit)}: "
                "the steps are too short, or shrink before the end of the run",
            )
        block = min(block * 2, 1 << 20)
    return times, np.arange(times.size)
