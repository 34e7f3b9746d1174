"""What is measured when, event by event, in exact rational arithmetic: the oracle of the measurement room.

Written from the reference of the block ``measurement`` and from nothing else, to be checked by eye; it shares no code
with the package. Numbers of the configuration are fractions. What is drawn at random is repeated from the rule
that names the generators: PCG64 with a child of the seed whose key is the SHA-256 of the channel's name.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Formula:
    """An expression as text and as a function of its names."""

    text: str
    value: Callable[..., Fraction | float]


@dataclass(frozen=True)
class Sampling:
    """Periodic, at given times, or by steps of k; nothing of these: continuous."""

    period: Fraction | None = None
    offset: Fraction = Fraction(0)
    jitter: Fraction = Fraction(0)
    dropout: float = 0.0
    times: tuple[Fraction, ...] | None = None
    steps: Formula | None = None

    @property
    def continuous(self) -> bool:
        return self.period is None and self.times is None and self.steps is None


@dataclass(frozen=True)
class Noise:
    """A function of t and k, or draws: uniform (low, high) or normal (std), perhaps held."""

    function: Formula | None = None
    uniform: tuple[float, float] | None = None
    std: float = 0.0
    hold: Fraction | None = None


@dataclass(frozen=True)
class Layer:
    """Some of the keys sampling, delay and noise, and those that single outputs have."""

    keys: Mapping[str, Any]
    outputs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    until: Fraction | None = None


@dataclass(frozen=True)
class Sample:
    arrival: Fraction
    taken: Fraction
    number: int
    phase: int
    used: bool
    noise: float


@dataclass(frozen=True)
class Phase:
    """One output between two times."""

    number: int
    start: Fraction
    end: Fraction
    last: bool
    sampling: Sampling
    delay: Formula
    noise: Sequence[Noise]

    def holds(self, t: Fraction) -> bool:
        """Whether a time belongs to it: the end of one phase is the start of the next."""
        return self.start <= t < self.end or (self.last and t == self.end)


DEFAULTS = {"sampling": Sampling(), "delay": Formula("0", lambda t: Fraction(0)), "noise": ()}


def draws(seed: int, *channel: object) -> np.random.Generator:
    digest = hashlib.sha256("/".join(str(part) for part in channel).encode()).digest()
    words = [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=tuple(words))))


def phases_of(output: str, base: Layer, phases: Sequence[Layer], start: Fraction, end: Fraction) -> list[Phase]:
    """Omitted keys are taken from the layer around: the block, its output, the phase, the phase's output."""
    layers: list[Layer] = list(phases) or [Layer({}, until=end)]
    found, begin = [], start
    for i, phase in enumerate(layers):
        keys = {**DEFAULTS, **base.keys, **base.outputs.get(output, {}), **phase.keys, **phase.outputs.get(output, {})}
        stop = min(phase.until if phase.until is not None else end, end)
        if begin < end:
            found.append(Phase(i, begin, stop, stop == end, keys["sampling"], keys["delay"], keys["noise"]))
        begin = stop
    return found


def arrivals(phase: Phase, seed: int, output: str) -> list[tuple[Fraction, int]]:
    """When samples of a phase arrive, with their numbers; lost ones count."""
    s, times = phase.sampling, []
    if s.period is not None:
        t, k = phase.start + s.offset, 0
        while phase.holds(t):
            times.append((t, k))
            t, k = t + s.period, k + 1
        shifts = draws(seed, "sampling", output, phase.number).uniform(-1, 1, len(times))
        chances = draws(seed, "dropout", output, phase.number).uniform(0, 1, len(times))
        kept = []
        for (t, k), shift, chance in zip(times, shifts, chances, strict=True):
            if s.jitter:
                t = min(max(t + Fraction(float(shift)) * s.jitter, phase.start), phase.end)
            if chance >= s.dropout:
                kept.append((t, k))
        times = sorted(kept, key=lambda sample: sample[0])
    elif s.times is not None:
        times = [(t, k) for k, t in enumerate(s.times)]
    elif s.steps is not None:
        t, k = phase.start, 0
        while phase.holds(t):
            times.append((t, k))
            t, k = t + Fraction(s.steps.value(k)), k + 1
    return [(t, k) for t, k in times if phase.holds(t)]


def noise_at(phase: Phase, t: Fraction, k: int | None, seed: int, output: str, start: Fraction) -> float:
    """v at time t: of sample k, or of a continuous output, where there is no k."""
    total, number = 0.0, 0
    for item in phase.noise:
        if item.function is not None:
            total += float(item.function.value(float(t), k))
            continue
        index = k if item.hold is None else math.floor((t - start) / item.hold)
        assert index is not None
        random = draws(seed, "noise", f"{output}/{phase.number}", number)
        drawn = random.uniform(*item.uniform, index + 1) if item.uniform else item.std * random.normal(0, 1, index + 1)
        total += float(drawn[index])
        number += 1
    return total


def samples_of(phases: Sequence[Phase], seed: int, output: str, start: Fraction) -> list[Sample]:
    """Of two samples the one taken later wins, of two taken at the same time the one that arrives later."""
    found: list[Sample] = []
    for phase in phases:
        for t, k in arrivals(phase, seed, output):
            taken = max(t - Fraction(phase.delay.value(t)), start)
            used = all(taken >= other.taken for other in found)
            found.append(Sample(t, taken, k, phase.number, used, noise_at(phase, t, k, seed, output, start)))
    return found


def kind_at(phases: Sequence[Phase], samples: Sequence[Sample], t: Fraction) -> tuple[str, int]:
    """What an output is to the observers at a time at which nothing happens, and of which phase."""
    (phase,) = [p for p in phases if p.start <= t < p.end]
    if phase.sampling.continuous:
        return ("CONTINUOUS" if phase.delay.text == "0" else "DELAYED"), phase.number
    since = phase.start
    for earlier in reversed(phases[: phases.index(phase)]):  # sampled phases without a continuous one between
        if earlier.sampling.continuous:
            break
        since = earlier.start
    heard = any(s.used and since <= s.arrival <= t for s in samples)
    return ("HELD" if heard else "SILENT"), 0


def changes_of(phase: Phase, start: Fraction) -> set[Fraction]:
    """When held noise of a continuous phase changes."""
    found = set()
    for item in phase.noise:
        if item.hold is not None:
            m = math.floor((phase.start - start) / item.hold) + 1
            while start + m * item.hold < phase.end:
                found.add(start + m * item.hold)
                m += 1
    return found


def come_back(events: set[Fraction], phases: Sequence[Phase], levels: int) -> set[Fraction]:
    """Events with those that constant delays of continuous phases repeat, t - d = an event, level by level."""
    late = [p for p in phases if p.sampling.continuous and p.delay.text != "0"]
    newest, found = set(events), set(events)
    for _ in range(levels):
        newest = {
            t + Fraction(p.delay.value(t)) for t in newest for p in late if p.start < t + p.delay.value(t) <= p.end
        }
        newest -= found
        found |= newest
    return found
