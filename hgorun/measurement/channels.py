"""What an observer gets of an output: its samples and its noise, stretch after stretch."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.chance import Chance
from hgorun.measurement.in_order import NoiseInOrder, drawn_in_parts
from hgorun.measurement.noise import StretchNoise, absolute
from hgorun.measurement.samples import AnySamples
from hgorun.measurement.sampling import find_samples
from hgorun.measurement.signals import delay_range
from hgorun.measurement.sizes import SAMPLE_BYTES
from hgorun.measurement.variants import CONTINUOUS, DELAYED, HELD, SILENT


@dataclass(frozen=True, eq=False, repr=False)
class Channel:
    """One output: its stretches, its samples, and its noise in each stretch."""

    name: str
    stretches: list[Stretch]
    samples: AnySamples
    noise: list[StretchNoise]

    @cached_property
    def timing(self) -> Hashable:
        """What decides when something happens; equal for channels whose noise alone differs."""
        stretches = tuple((s.start, s.end, s.continuous, s.delay) for s in self.stretches)
        return stretches, self.samples.identity, self.drawn, tuple(noise.holds for noise in self.noise)

    @property
    def drawn(self) -> bool:
        """Whether any of its noise is."""
        return any(noise.random for noise in self.noise)

    @cached_property
    def gain_and_bias(self) -> tuple[np.ndarray, np.ndarray]:
        """How every sample is measured, y_k = gain h + bias: shapes (..., Nk).

        Raises
        ------
        Problem
            Where the noise is not a number.
        """
        s = self.samples
        shape = *self._many, s.arrival.size
        gain, bias = np.ones(shape), np.zeros(shape)
        for i, (stretch, noise) in enumerate(zip(self.stretches, self.noise, strict=True)):
            inside = slice(None) if len(self.stretches) == 1 else s.stretch == i
            if s.size and (isinstance(inside, slice) or inside.any()):
                times, numbers = s.arrival[inside], s.number[inside]
                v = noise.sampled(times, numbers)
                if not np.all(np.isfinite(v)):
                    finite = np.all(np.isfinite(v), axis=tuple(range(v.ndim - 1)))
                    first = stretch.origin + times[np.argmin(finite)]
                    raise Problem(stretch.paths["noise"], f"the noise is not a finite number at t = {first:g}")
                if stretch.multiplicative:
                    gain[..., inside] = 1 + v
                else:
                    bias[..., inside] = v
        return gain, bias

    @cached_property
    def held_changes(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and values of the held noise in the continuous stretches; each of them starts with its own.

        Shapes (changes,) and (..., changes).
        """
        times, values = [np.zeros(0)], [np.zeros((*self._many, 0))]
        if self.drawn:
            for stretch, noise in zip(self.stretches, self.noise, strict=True):
                if stretch.continuous:
                    changes = noise.change_times()
                    inside = changes[(changes > stretch.start) & (changes < stretch.end)]
                    times.append(np.concatenate([[stretch.start], inside]))
                    values.append(noise.held(times[-1]))
        return np.concatenate(times), joined(values)

    def of_many(self, count: int, seeds: np.ndarray, deviations: Mapping[tuple[int, int], np.ndarray]) -> Channel:
        """The channel of several runs that share its samples, with the noise of each.

        Parameters
        ----------
        count, seeds
            As in :meth:`StretchNoise.of_many`.
        deviations : mapping of (stretch, place among its items) to ndarray, shape (count,)
        """
        own = [{item: values for (k, item), values in deviations.items() if k == i} for i in range(len(self.noise))]
        noise = [one.of_many(count, seeds, given) for one, given in zip(self.noise, own, strict=True)]
        return replace(self, noise=noise)

    @property
    def before(self) -> float | None:
        """When the sample arrived that was used before these, where there are such: see :class:`ChannelPart`."""
        return None

    @cached_property
    def heard_from(self) -> np.ndarray:
        """From when on a sample has been heard in every stretch, or before it if nothing but samples lies between."""
        return np.array([self.samples.first_used(start) for start in self.unbroken_from.tolist()])

    @property
    def unbroken_from(self) -> np.ndarray:
        """The start of the unbroken run of sampled stretches that each stretch belongs to."""
        starts = [s.start for s in self.stretches]
        for i in range(1, len(starts)):
            if not self.stretches[i].continuous and not self.stretches[i - 1].continuous:
                starts[i] = starts[i - 1]
        return np.array(starts)

    @property
    def _many(self) -> tuple[int, ...]:
        """The leading axes of noise that is drawn for several runs at once."""
        return self.noise[0].many

    def stretch_at(self, times: np.ndarray) -> np.ndarray:
        """Index of the stretch that starts at or before each time."""
        starts = np.array([s.start - (4 * s.spacing if s.origin else 0.0) for s in self.stretches])
        return np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)

    def kinds_at(self, times: np.ndarray) -> np.ndarray:
        """What the output is to the observers at each time, and in which phase, shape (len(times), 2)."""
        stretch = self.stretch_at(times)
        late = np.array([DELAYED if not s.undelayed else CONTINUOUS for s in self.stretches])
        continuous = np.array([s.continuous for s in self.stretches])
        heard = times >= self.heard_from[stretch]
        kind = np.where(continuous[stretch], late[stretch], np.where(heard, HELD, SILENT))
        return np.column_stack([kind, np.where(continuous[stretch], stretch, 0)])


class HeardBefore(Channel):
    """An output of which samples have arrived before those that it has."""

    @cached_property
    def heard_from(self) -> np.ndarray:
        found, start = super().heard_from, self.stretches[0].start
        return np.where(self.unbroken_from == start, start, found)


@dataclass(frozen=True, eq=False, repr=False)
class ChannelPart(Channel):
    """A channel between two times.

    Attributes
    ----------
    source : Channel
    ordered : list of NoiseInOrder
        The noise of every stretch, shared with earlier and later parts.
    start, end : float
    """

    source: Channel
    ordered: list[NoiseInOrder]
    start: float
    end: float

    @cached_property
    def before(self) -> float | None:
        first = self.source.samples.before(self.start)
        return float(self.source.samples.part(first - 1, first).arrival[0]) if first else None

    @cached_property
    def heard_from(self) -> np.ndarray:
        return self.source.heard_from

    @cached_property
    def held_changes(self) -> tuple[np.ndarray, np.ndarray]:
        times, values = [np.zeros(0)], [np.zeros(0)]
        for stretch, noise in zip(self.stretches, self.ordered, strict=True):
            if stretch.continuous and self.drawn and stretch.start < self.end and stretch.end > self.start:
                after = max(float(np.nextafter(stretch.start, np.inf)), self.start)
                changes = noise.changes_between(after, min(stretch.end, self.end))
                times.append(np.append(stretch.start, changes) if stretch.start >= self.start else changes)
                values.append(noise.held(times[-1]))
        return np.concatenate(times), np.concatenate(values)


def part_of(channel: Channel, ordered: list[NoiseInOrder], start: float, end: float) -> ChannelPart:
    """What an observer gets of an output from a time on and before another one; ``ordered`` as of the parts before."""
    samples = channel.samples.part(channel.samples.before(start), channel.samples.before(end))
    return ChannelPart(channel.name, channel.stretches, samples, [*ordered], channel, ordered, start, end)


def follows_from_numbers(stretch: Stretch) -> bool:
    """Whether all that happens in a stretch follows from numbers, one after the other: nothing is late or lost."""
    return stretch.undelayed and not stretch.sampled_by_chance and drawn_in_parts(stretch.noise)


def joined(parts: list[np.ndarray]) -> np.ndarray:
    """Arrays one after the other along the last axis, in one piece of memory, as native code reads them."""
    return np.concatenate(parts, axis=-1)


def find_channels(
    resolved: list[list[Stretch]],
    outputs: tuple[str, ...],
    time: Time,
    seed: int,
    mean_squares: np.ndarray | None,
    chance: Chance | None = None,
) -> list[Channel]:
    """Samples and noise of every output.

    Parameters
    ----------
    mean_squares : ndarray or None, shape (q,)
        Of the noise-free outputs over the run; needed where the size of some noise is relative to them.
    chance : Chance, optional
        The random numbers of the seed, where they are made together with those of others.
    """
    left, channels = time.max_memory, []
    without_tables = all(follows_from_numbers(s) for stretches in resolved for s in stretches)
    for i, (name, stretches) in enumerate(zip(outputs, resolved, strict=True)):
        size = np.nan if mean_squares is None else float(mean_squares[i])
        noise = [
            StretchNoise(s, absolute(s.noise, size), seed, f"{name}/{k}", time.start, time.end, left, chance)
            for k, s in enumerate(stretches)
        ]
        if not without_tables:  # else that is asked when all of them are needed at once
            left -= sum(one.memory(left) for one in noise)
        samples = find_samples(stretches, time.start, seed, name, int(left / SAMPLE_BYTES), chance)
        if not without_tables:
            left -= samples.size * SAMPLE_BYTES
        channels.append(Channel(name, stretches, samples, noise))
    silent = not any(s.continuous for c in channels for s in c.stretches)
    origin = channels[0].stretches[0].origin
    if silent and not any(c.samples.size for c in channels):
        path, regular = channels[0].stretches[0].paths["sampling"], channels[0].stretches[0].regular
        beyond = regular is not None and regular.offset > time.end - time.start
        raise Problem(
            (*path, "offset") if beyond else path,
            f"no sample arrives between {origin + time.start:g} and {origin + time.end:g}"
            + (f": the first comes {regular.offset:g} after the start" if regular is not None and beyond else ""),
        )
    return channels


def continuous_delays(channels: list[Channel]) -> list[Stretch]:
    """The stretches with a continuous, late output."""
    return [s for c in channels for s in c.stretches if s.continuous and not s.undelayed]


def check_delays(channels: list[Channel]) -> tuple[float, float]:
    """The smallest and the largest continuous delay; (inf, 0) without any.

    Raises
    ------
    Problem
        Where a delay is negative or not a number.
    """
    ranges = [delay_range(s) for s in continuous_delays(channels)]
    return min((low for low, _ in ranges), default=np.inf), max((high for _, high in ranges), default=0.0)
