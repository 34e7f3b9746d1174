"""Samples as they are given to an estimator, and the events that they are."""

from __future__ import annotations

import math
from typing import Any

from hgorun.estimate.stream.event import Event, Inputs, Places, Samples
from hgorun.estimate.stream.following import Following
from hgorun.estimate.stream.given import as_number, numbers_by_name
from hgorun.estimate.stream.live_system import slot_of
from hgorun.estimate.stream.remembered import Remembered

_FARTHEST = 1e8  # steps to the next event, a minute or so: what is further off is on another clock, as that of Unix


class Arriving:
    """What comes to a run.

    Parameters
    ----------
    run : Following
    past : Remembered
        Of the run.

    Attributes
    ----------
    reach : float
        No event is further off than that.
    """

    def __init__(self, run: Following, past: Remembered) -> None:
        system = run.system
        self._run, self._system, self._past, self._live = run, system, past, run.live
        self._origin, self.reach = system.experiment.origin, _FARTHEST * system.step
        self._places = {name: (i, slot_of(i)) for name, i in system.outputs.items()}
        self._joint = system.joint

    def since_start(self, t: float, reached: float | None = None) -> float:
        """The time of an event on the clock of the run, of which ``reached`` is the last event otherwise.

        Raises
        ------
        ValueError
            Where it is before the last event, or so far ahead that it is of another clock.
        """
        since = t - self._origin
        if reached is None:
            reached = self._live.t
        if 0.0 <= since - reached <= self.reach:
            return since
        if not since >= reached:  # NaN, too
            raise ValueError(f"t = {t:.12g} is before {self._origin + reached:.12g}, which has been reached")
        raise ValueError(
            f"t = {t:.12g} is more than {_FARTHEST:.0e} steps after {self._origin + reached:.12g}: time.start may be "
            "missing"
        )

    def take(self, t: Any, y: Any, available: Any, u: Any) -> None:
        """Samples, as :meth:`hgorun.Estimator.update` describes them."""
        if type(t) is not float:
            t = as_number("t", t)
        places, samples = self._samples(y)
        inputs = () if u is None else self._inputs(u)
        if available is None or available == t:
            self._take_on_time(self.since_start(t), places, samples, inputs)
        else:
            self._take_late(t, places, samples, as_number("available", available), inputs)

    def _take_on_time(self, now: float, places: Places, samples: Samples, inputs: Inputs) -> None:
        """Samples that are known when they are taken."""
        event = Event(now, places, samples, inputs, now)
        if now != self._live.t:
            self._past.go_on(event)
        elif self._joint:
            self._past.go_back(event, together=True)
        else:
            self._past.go_on_beside_late(event)

    def _samples(self, y: Any) -> tuple[Places, Samples]:
        """Places of samples that are known when they are taken, and the samples; those that are missing left out."""
        places: list[tuple[int, int]] = []
        samples: list[tuple[int, int, float]] = []
        for name, value in y.items() if type(y) is dict else numbers_by_name("y", y):
            place = self._places.get(name) or self._places[self._unknown(name, value)]
            if type(value) is not float:
                value = as_number(f"y[{name!r}]", value)
            if value - value == 0.0:
                places.append(place)
                samples.append((*place, value))
            elif value == value:
                raise ValueError(_infinite("y", name, value))
        if len(places) > 1:
            places.sort()
            samples.sort()
        return tuple(places), tuple(samples)

    def _unknown(self, name: Any, value: Any) -> str:
        """Refuse what is no output."""
        as_number(f"y[{name!r}]", value)
        self._system.output(name)
        return str(name)

    def _inputs(self, u: Any) -> Inputs:
        """Inputs that change; one whose value is missing does not."""
        given = [(self._system.input(name), name, value) for name, value in numbers_by_name("u", u)]
        for _, name, value in given:
            if math.isinf(value):
                raise ValueError(_infinite("u", name, value))
        return tuple((i, value) for i, _, value in given if value == value)

    def _take_late(self, t: float, places: Places, given: Samples, known: float, inputs: Inputs) -> None:
        """Samples that are known later than they are taken."""
        run, past = self._run, self._past
        now, taken = self.since_start(known), t - self._origin
        if taken > now:
            raise ValueError(f"taken at {t:.12g}, after it was known at {known:.12g}")
        if taken == now:  # times that differ by less than the clock of the run can tell
            self._take_on_time(now, places, given, inputs)
            return
        if not run.by_innovation(t):
            if "replay" in self._system.treatments.values():
                past.go_back(Event(taken, places, given, (), taken), together=True)
            past.go_on(Event(now, (), (), inputs, now))
            return
        slots = tuple((i, run.next_slot(i)) for i, _, _ in given)
        past.keep(Event(taken, slots))
        samples = tuple((i, slot, value) for (i, slot), (_, _, value) in zip(slots, given, strict=True))
        past.go_on(Event(now, (), samples, inputs, taken))


def _infinite(group: str, name: str, value: float) -> str:
    return f"{group}[{name!r}]: expected a finite number, or NaN for a missing value, found {value:g}"
