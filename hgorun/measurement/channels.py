"""What an observer gets of an output: its samples and its noise, stretch after stretch."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.noise import StretchNoise, absolute
from hgorun.measurement.sampling import EVENT_BYTES, SAMPLE_BYTES, Samples, find_samples
from hgorun.measurement.signals import delay_range
from hgorun.measurement.variants import CONTINUOUS, DELAYED, HELD, SILENT
from hgorun.noise.base import RandomNoise

_DRAW_BYTES = 16  # of memory that a draw takes until those that a stretch needs are left


@dataclass(frozen=True, eq=False, repr=False)
class Channel:
    """One output: its stretches, its samples, and its noise in each stretch."""

    name: str
    stretches: list[Stretch]
    samples: Samples
    noise: list[StretchNoise]

    @cached_property
    def timing(self) -> Hashable:
        """What decides when something happens; equal for channels whose noise alone differs."""
        stretches = tuple((s.start, s.end, s.continuous, s.delay) for s in self.stretches)
        return stretches, self.samples, self.held_changes[0].tobytes()

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
            inside = s.stretch == i
            if inside.any():
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
        if any(noise.random for noise in self.noise):
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

    @cached_property
    def _heard(self) -> np.ndarray:
        """When samples arrive that are used, with one before all time."""
        return np.concatenate([[-np.inf], self.samples.arrival[self.samples.used]])

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
        # the start of the unbroken run of sampled stretches that each one belongs to
        starts = [s.start for s in self.stretches]
        for i in range(1, len(starts)):
            if not continuous[i] and not continuous[i - 1]:
                starts[i] = starts[i - 1]
        newest = self._heard[np.searchsorted(self._heard, times, side="right") - 1]
        heard = newest >= np.array(starts)[stretch]
        kind = np.where(continuous[stretch], late[stretch], np.where(heard, HELD, SILENT))
        return np.column_stack([kind, np.where(continuous[stretch], stretch, 0)])


class HeardBefore(Channel):
    """An output of which samples have arrived before those that it has."""

    @cached_property
    def _heard(self) -> np.ndarray:
        return np.concatenate([[self.stretches[0].start], self.samples.arrival[self.samples.used]])


def joined(parts: list[np.ndarray]) -> np.ndarray:
    """Arrays one after the other along the last axis, in one piece of memory, as native code reads them."""
    return np.concatenate(parts, axis=-1)


def find_channels(
    resolved: list[list[Stretch]],
    outputs: tuple[str, ...],
    time: Time,
    seed: int,
    mean_squares: np.ndarray | None,
) -> list[Channel]:
    """Samples and noise of every output.

    Parameters
    ----------
    mean_squares : ndarray or None, shape (q,)
        Of the noise-free outputs over the run; needed where the size of some noise is relative to them.
    """
    left = time.max_memory
    channels = []
    for i, (name, stretches) in enumerate(zip(outputs, resolved, strict=True)):
        for stretch in stretches:
            left -= _held_bytes(stretch, time, left)
        samples = find_samples(stretches, time.start, seed, name, int(left / SAMPLE_BYTES))
        left -= samples.arrival.size * SAMPLE_BYTES
        size = np.nan if mean_squares is None else float(mean_squares[i])
        noise = [
            StretchNoise(s, absolute(s.noise, size), seed, f"{name}/{k}", time.start, time.end)
            for k, s in enumerate(stretches)
        ]
        channels.append(Channel(name, stretches, samples, noise))
    silent = not any(s.continuous for c in channels for s in c.stretches)
    origin = channels[0].stretches[0].origin
    if silent and not any(c.samples.arrival.size for c in channels):
        raise Problem(
            channels[0].stretches[0].paths["sampling"],
            f"no sample arrives between {origin + time.start:g} and {origin + time.end:g}",
        )
    return channels


def _held_bytes(stretch: Stretch, time: Time, left: float) -> float:
    """Memory of the held noise of a stretch: its draws from the start of the run, its changes as events."""
    total = 0.0
    for j, item in enumerate(stretch.noise):
        if isinstance(item, RandomNoise) and item.hold is not None:
            draws = (stretch.end - time.start) / item.hold
            events = (stretch.end - stretch.start) / item.hold if stretch.continuous else 0.0
            total += draws * _DRAW_BYTES + events * (SAMPLE_BYTES if stretch.undelayed else EVENT_BYTES)
            if total > left:
                raise Problem(
                    (*stretch.paths["noise"], j, "hold"),
                    f"{draws:.3g} draws take about {total / 2**30:.3g} GiB; "
                    f"time.max_memory leaves {left / 2**30:.3g} GiB for them",
                )
    return total


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
