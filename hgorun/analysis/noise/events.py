"""When noise enters the observers of a run: the samples with what each carries, and the changes of what is held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.analysis.noise.measured import noise_between
from hgorun.analysis.reasons import NoValue
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun

_MAX_EDGES = 60_000  # stretches, before it is given up
_SAME = 1e-9  # of the shortest regular stretch: edges closer than that are one


@dataclass(frozen=True)
class Edges:
    """Where the stretches of a run meet, and what happens there.

    Attributes
    ----------
    times : ndarray, shape (K,)
    taken : dict of int to list of (output, sample)
        At each edge the samples that were measured there.
    arriving : dict of int to list of (output, sample, v)
        Those that arrive there, with their noise.
    held : dict of int to ndarray, shape (K,)
        For each continuous output the held part of its noise from each edge on.
    """

    times: np.ndarray
    taken: dict[int, list[tuple[int, int]]]
    arriving: dict[int, list[tuple[int, int, float]]]
    held: dict[int, np.ndarray]


def edges_of(
    run: PreparedRun, result: Result, noise_free: Result, stretches: int, more: Sequence[float] | np.ndarray = ()
) -> Edges:
    """The edges of a run.

    Parameters
    ----------
    result, noise_free : Result
        With and without noise: the difference of their measurements is what a sample carries.
    stretches : int
        How many there are at least.
    more : sequence of float
        Times that have to be edges.

    Raises
    ------
    NoValue
        When there are too many.
    """
    start, end = run.time.start, run.time.end
    parts = [np.linspace(start, end, stretches + 1), np.asarray(more, dtype=float)]
    for channel in run.channels:
        samples = channel.samples
        parts += [samples.arrival[samples.used], samples.taken[samples.used]]
        if channel.stretches[0].continuous:
            parts.append(channel.noise[0].change_times())
    times = np.sort(np.concatenate(parts))
    times = times[(times >= start) & (times <= end)]
    times = times[np.diff(times, prepend=-np.inf) > _SAME * (end - start) / stretches]
    if times.size > _MAX_EDGES:
        raise NoValue(f"the run has {times.size} samples and changes of held noise, too many to follow")
    taken: dict[int, list[tuple[int, int]]] = {}
    arriving: dict[int, list[tuple[int, int, float]]] = {}
    known, noise = result.measurements.time, noise_between(run, result, noise_free)
    for i, channel in enumerate(run.channels):
        s = channel.samples
        for j in np.flatnonzero(s.used):
            v = float(noise[_nearest(known, s.arrival[j]), i])
            taken.setdefault(_nearest(times, s.taken[j]), []).append((i, int(j)))
            arriving.setdefault(_nearest(times, s.arrival[j]), []).append((i, int(j), v))
    inside = times + _SAME * (end - start)  # the side of a change that the stretch is on
    held = {
        i: channel.noise[0].held(inside) for i, channel in enumerate(run.channels) if channel.stretches[0].continuous
    }
    return Edges(times, taken, arriving, held)


def _nearest(times: np.ndarray, t: float) -> int:
    k = int(np.clip(np.searchsorted(times, t), 1, times.size - 1))
    return k if times[k] - t <= t - times[k - 1] else k - 1
