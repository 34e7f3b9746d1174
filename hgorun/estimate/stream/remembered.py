"""What has happened, remembered for samples that come late: from where they were taken all is carried out again."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from operator import attrgetter

from hgorun.estimate.stream.event import Event
from hgorun.estimate.stream.following import Following, State

_time = attrgetter("t")


class Remembered:
    """The newest events of a run, with the state before each of them.

    Parameters
    ----------
    run : Following
    most : int
        So many events are remembered.

    Attributes
    ----------
    events : deque of Event
    before : deque of State
        Of the run, before each of the events.
    """

    def __init__(self, run: Following, most: int) -> None:
        self._run, self._most = run, most
        self.events: deque[Event] = deque(maxlen=most)
        self.before: deque[State] = deque(maxlen=most)

    def replace(self, events: Sequence[Event], before: Sequence[State]) -> None:
        """Remember others."""
        self.events = deque(events, self._most)
        self.before = deque(before, self._most)

    def go_on(self, event: Event) -> None:
        """Carry an event out, and remember it."""
        run = self._run
        if self._most == 0:
            run.carry_out(event)
            return
        before = run.state()
        run.carry_out(event)
        self.before.append(before)  # what is refused is not remembered
        self.events.append(event)

    def go_back(self, event: Event, *, together: bool = False) -> None:
        """Let something happen at an earlier time: from there all is carried out again.

        Parameters
        ----------
        event : Event
        together : bool
            With samples of other outputs that were taken at the same time, as if they had come at once.

        Raises
        ------
        ValueError
            For an event that is older than all that is remembered, or where one is refused; all is as before then.
        """
        place = bisect_right(self.events, event.t, key=_time)
        self._again(event, place, self._beside(event, place) if together else None)

    def keep(self, event: Event) -> None:
        """Keep what is estimated at a time for samples that come later.

        As in a file, that is done before anything of the same outputs that arrives at this time counts alpha anew:
        C xhat - alpha + alpha is the same number as C xhat, but rounded otherwise.
        """
        place = bisect_right(self.events, event.t, key=_time)
        arrived = self._arrived(event, place)
        self._again(event, place, arrived[0] if arrived else None)

    def go_on_beside_late(self, event: Event) -> None:
        """As :meth:`go_on`, but what is kept for its samples is kept before late ones that have arrived just now."""
        place = len(self.events)
        arrived = self._arrived(event, place)
        if not arrived or any(self.events[k].taken == event.t for k in arrived):  # those go one after the other
            self.go_on(event)
            return
        self._again(Event(event.t, event.take), place, arrived[0])
        self.go_on(replace(event, take=()))

    def _arrived(self, event: Event, place: int) -> list[int]:
        """The events before ``place`` at the same time that have samples of the outputs of which something is kept."""
        own = {i for i, _ in event.take}
        first = bisect_left(self.events, event.t, hi=place, key=_time)
        return [k for k in range(first, place) if not own.isdisjoint(i for i, *_ in self.events[k].samples)]

    def _again(self, event: Event, place: int, other: int | None) -> None:
        """Carry out all again from an event on that is put at a place, or joined to the event ``other``."""
        now = self._run.live.t
        if event.t >= now and other is None:
            self.go_on(event)
            return
        if event.t < (self.before[0][0][0] if self.before else now):
            raise self._too_old(event.t)
        again = [event, *islice(self.events, place, None)]
        if other is not None:
            again = list(islice(self.events, other, None))
            again[0], place = again[0].joined(event), other
        run, kept = self._run, self._run.state()
        left = [(self.events.pop(), self.before.pop()) for _ in range(place, len(self.events))]
        if left:
            run.go_back(left[-1][1])
        try:
            for one in again:
                self.go_on(one)
        except BaseException:  # what is refused, or interrupted, has not been
            while len(self.events) > place:
                self.events.pop()
                self.before.pop()
            for one, state in reversed(left):
                self.events.append(one)
                self.before.append(state)
            run.restore(kept)
            raise

    def _too_old(self, t: float) -> ValueError:
        origin = self._run.system.experiment.origin
        if t < 0.0:
            taken = f"a sample taken at {origin + t:.12g}"
            return ValueError(f"{taken} is before {origin:.12g}, where estimates begin (time.start)")
        since = f", since {origin + self.before[0][0][0]:.12g}" if self.before else ""
        return ValueError(
            f"a sample taken at {origin + t:.12g} is older than all that is remembered (events: {self._most}{since}): "
            "begin anew with a larger --remembered N of the command, or remembered of Estimator"
        )

    def _beside(self, event: Event, place: int) -> int | None:
        """Among the events before ``place`` the first one at the same time with samples of other outputs alone.

        So the second samples of several outputs are together, as the first ones are, in whatever order they come.
        """
        own, found = {i for i, *_ in event.samples}, None
        for number in range(place - 1, -1, -1):
            one = self.events[number]
            if one.t != event.t:
                break
            if one.samples and own.isdisjoint(i for i, *_ in one.samples):
                found = number
        return found
