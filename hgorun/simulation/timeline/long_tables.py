"""The engine's tables of a run that is too long for them: part by part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.plan import Following, Kept, PartNumbers, Plan, Segments
from hgorun.measurement.channels import joined
from hgorun.measurement.long import LongSchedule, Part
from hgorun.simulation.timeline.steps import counted_steps, steps_of_a_piece
from hgorun.simulation.timeline.tabulated import Tabulated
from hgorun.simulation.timeline.timeline import Stepping, Timeline


@dataclass(frozen=True, eq=False, repr=False)
class LongTables:
    """The tables of a run that is too long for them, part by part.

    Attributes
    ----------
    schedule : LongSchedule
    grid : ndarray
        Output times.
    system : HybridSystem
    stepping : Stepping
    """

    schedule: LongSchedule
    grid: np.ndarray
    system: HybridSystem
    stepping: Stepping

    def plan(self, origin: float) -> Plan:
        """The plan of all parts, with the first of them."""
        first = next(self.parts())
        left = self._steps - int(np.sum(first.counts[:, 2] - first.counts[:, 1]))
        numbers = first.numbers
        assert numbers is not None
        return Plan(
            spans=first.spans,
            counts=first.counts,
            actions=first.actions,
            grid=self.grid,
            slots=numbers.gain.size,
            gain=numbers.gain,
            bias=numbers.bias,
            holds=numbers.holds,
            origin=origin,
            following=Following(
                lambda: islice(self.parts(), 1, None),
                left,
                left + counted_steps(self.schedule, self.stepping.longest).segments - len(first.counts),
                self.schedule.time.end,
            ),
            numbers=numbers,
            kept=sum(self._kept),
        )

    @property
    def _steps(self) -> int:
        return self.stepping.total(self.schedule)

    @property
    def _kept(self) -> list[int]:
        """How many samples of every output are kept."""
        return [-(-c.samples.size // self.schedule.every) for c in self.schedule.channels]

    def parts(self) -> Iterator[Segments]:
        """The segments of the whole run, with the numbers of what is measured in them."""
        places, piece = np.cumsum([0, *self._kept]).tolist(), steps_of_a_piece(self._steps)
        tables: Tabulated | None = None
        for part in self.schedule.parts():
            timeline = Timeline(schedule=part.schedule, channels=part.channels, grid=self.grid)
            tables = Tabulated(timeline, self.system, self.stepping, piece=piece, before=tables)
            segments = tables.segments(0, part.schedule.size - (not part.last))
            measured = [channel.gain_and_bias for channel in part.channels]
            changes = [channel.held_changes[1] for channel in part.channels]
            numbers = PartNumbers(
                gain=joined([gain for gain, _ in measured]),
                bias=joined([bias for _, bias in measured]),
                holds=joined([*changes, tables.actions.values]),
                kept=self._places(part, places),
            )
            yield replace(segments, numbers=numbers)

    def _places(self, part: Part, places: Sequence[int]) -> tuple[Kept, ...]:
        """Which of the samples of a part are kept, and where."""
        every, found, base = self.schedule.every, [], 0
        for c, before, place in zip(part.channels, part.first, places, strict=False):
            skipped = -before % every
            if c.samples.size > skipped:
                some = slice(base + skipped, base + c.samples.size, every)
                first = place + (before + skipped) // every
                found.append(Kept(some, slice(first, first + len(range(c.samples.size)[skipped::every]))))
            base += c.samples.size
        return tuple(found)
