"""Inputs as they were recorded, and what sets them at the events of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.layout import SET, Held
from hgorun.measurement.channels import Channel
from hgorun.measurement.late import stepped_between
from hgorun.measurement.schedule import first_of, nearest_event
from hgorun.native.places import places_in
from hgorun.simulation.design.first_inputs import Recorded
from hgorun.simulation.timeline.kinds import Kind, Numbered


@dataclass(frozen=True, eq=False, repr=False)
class RecordedInputs:
    """Inputs as they were recorded: each is a straight line from one of its times to the next.

    Attributes
    ----------
    times : ndarray, shape (N,)
        From these times on the lines hold; the first is not after the start of the run.
    levels, slopes : ndarray, shape (N, m)
        u(t) = level + slope (t - time); held values have slope zero.
    held : bool
        Whether all are: then levels alone are set.
    shown : ndarray, shape (N,), optional
        Where output points begin to show a line, see :meth:`shown_from`.
    """

    times: np.ndarray
    levels: np.ndarray
    slopes: np.ndarray
    held: bool = False
    shown: np.ndarray | None = None

    def first(self, numbers: Sequence[int]) -> Recorded:
        """How they begin, by their numbers among all inputs."""
        return tuple(zip(numbers, self.levels[0].tolist(), self.slopes[0].tolist(), strict=True))

    def at(self, times: np.ndarray) -> np.ndarray:
        """u at several times, shape (len(times), m)."""
        i = self._lines(times)
        if self.held:
            return np.asarray(self.levels[i] + 0.0)  # nothing is -0, as where slopes are multiplied
        return np.asarray(self.levels[i] + self.slopes[i] * (times - self.times[i])[:, None])

    def slopes_at(self, times: np.ndarray) -> np.ndarray:
        """u' at several times, where it jumps the one behind them, shape (len(times), m)."""
        return np.asarray(self.slopes[self._lines(times)])

    def shown_from(self, events: np.ndarray, tolerance: float) -> RecordedInputs:
        """The same for output points: one that counts as an event for states shows the inputs from that event on.

        Parameters
        ----------
        events : ndarray
            Of the run.
        tolerance : float
            How much before an event a point counts as one at it.
        """
        moments = self.times if self.times[0] >= events[0] else np.maximum(self.times, events[0])
        if first_of(moments, events) is None:
            moments = events[nearest_event(events, moments)]
        return replace(self, shown=moments - tolerance)

    def _lines(self, times: np.ndarray) -> np.ndarray | slice:
        """Which line holds at each of several times."""
        return last_of(self.times if self.shown is None else self.shown, times)

    def values(self, channels: Sequence[Channel], *, before: bool) -> list[np.ndarray]:
        """What is set in w: of every time the numbers of every line; at every sample the inputs ``before``."""
        lines = self.levels
        if not self.held:
            lines = np.stack(np.broadcast_arrays(self.levels, self.slopes, self.times[:, None]), axis=2)
        return [lines.ravel(), self.at(_times_before(channels)).ravel()] if before else [lines.ravel()]

    def actions(
        self, events: np.ndarray, channels: Sequence[Channel], held: Held, first: int, *, before: bool
    ) -> Iterator[Kind]:
        """What sets the lines at their times, and at every sample the inputs at the sample before.

        Parameters
        ----------
        before : bool
            Whether something steps from sample to sample; otherwise the inputs before are left out.
        first : int
            Place of the first value of :meth:`values` among all that is set.
        """
        places = np.array([held.input(i) for i in range(self.levels.shape[1])])
        # held ones keep the slope that w begins with, zero, so that it does not matter since when they are
        lines, last = places[:, : 1 if self.held else 3].ravel().tolist(), places[:, 3].tolist()
        at = nearest_event(events, np.maximum(self.times, events[0]))
        behind = first + len(lines) * at.size
        for k, place in enumerate(lines):
            yield Kind.of(at, -3, SET, place, Numbered(first + k, len(lines)))
        if before:
            sample = nearest_event(events, _arrivals(channels))
            for k, place in enumerate(last):
                yield Kind.of(sample, -3, SET, place, Numbered(behind + k, len(last)))


def last_of(times: np.ndarray, sought: np.ndarray) -> np.ndarray | slice:
    """Where the last of some ascending times is that is not after each sought one; the first where all are."""
    if sought.size:  # where one of them follows each time, as at the times themselves, nothing is sought
        first = max(int(np.searchsorted(times, sought[0], side="right")) - 1, 0)
        some = slice(first, first + sought.size)
        own, following = times[some], times[first + 1 : some.stop + 1]
        if own.size == sought.size and np.all(own <= sought) and np.all(sought[: following.size] < following):
            return some
    return np.asarray(np.maximum(places_in(times, sought, "right") - 1, 0))


def _arrivals(channels: Sequence[Channel]) -> np.ndarray:
    """When the samples arrive that observers jump at."""
    return stepped_between(channels).samples.arrival


def _times_before(channels: Sequence[Channel]) -> np.ndarray:
    """For every sample the time of the one before; for the first its own."""
    times = _arrivals(channels)
    return np.concatenate([times[:1], times[:-1]])
