"""Many samples that are known already, carried out in one native call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.engine.layout import ACTION_WORDS, ARRIVE, JUMP, NOTHING, REBASE, SET, SHOW, TAKE, HybridSystem
from hgorun.engine.live import Live
from hgorun.engine.plan import Floats, Integers
from hgorun.estimate.stream.arriving import Arriving
from hgorun.estimate.stream.following import Following
from hgorun.estimate.stream.live_system import TOGETHER, slot_of

_Row = tuple[tuple[int, ...], str]  # of the action table, and what of it is the sample's own

_ZERO, _ONE = 0, 1  # the first two numbers that are set; values and times follow


@dataclass(frozen=True, eq=False, repr=False)
class Kinds:
    """What each kind of sample makes happen: that of an output, or of an input that comes with the samples.

    Attributes
    ----------
    rows : ndarray of int, shape (kinds, k, 5)
        Rows of the engine's action table, those of the outputs first.
    own, value, time : ndarray of bool, shape (kinds, k)
        Rows with a slot of the sample's own, and those that set its value or its time.
    outputs : int
    """

    rows: Integers
    own: np.ndarray
    value: np.ndarray
    time: np.ndarray
    outputs: int

    @classmethod
    def of(cls, system: HybridSystem, corrections: Sequence[int], inputs: int) -> Kinds:
        """Those of a system with some inputs that come with the samples."""
        layout = system.held
        found: list[list[_Row]] = []
        for i in range(system.outputs):
            rows: list[_Row] = [((TAKE, i, 0, 0, 0), "own"), ((ARRIVE, i, 0, 0, 0), "own")]
            if system.has_alpha:
                rows.append(((REBASE, i, 0, slot_of(i), slot_of(i + 1)), ""))
            rows += [((JUMP, number, 0, 0, 0), "") for number in corrections]
            if layout.flags:
                flag = layout.fresh(i)
                rows = [((SET, flag, _ONE, 0, 0), ""), *rows, ((SET, flag, _ZERO, 0, 0), "")]
            found.append(rows)
        for number in range(inputs):
            place, slope, since, _ = layout.input(number)
            found.append(
                [((SET, place, 0, 0, 0), "value"), ((SET, slope, _ZERO, 0, 0), ""), ((SET, since, 0, 0, 0), "time")]
            )
        most = max(map(len, found)) + 1
        table = np.zeros((len(found), most, ACTION_WORDS), dtype=np.int64)
        table[:, :, 0] = NOTHING
        table[:, -1, 0] = SHOW
        marked = {name: np.zeros((len(found), most), dtype=bool) for name in ("own", "value", "time")}
        for kind, rows in enumerate(found):
            for k, (row, mark) in enumerate(rows):
                table[kind, k] = row
                if mark:
                    marked[mark][kind, k] = True
        return cls(table, marked["own"], marked["value"], marked["time"], system.outputs)

    def carry_out(self, live: Live, regime: int, times: Floats, kinds: Integers, values: Floats) -> Floats | None:
        """All states after each of some samples, shape (N, states); None where they have to be taken one by one.

        Parameters
        ----------
        times, kinds, values : ndarray, shape (N,)
            N is at most ``live.at_once``; times ascend, and none is before ``live.t``.
        """
        count = times.size
        numbers = np.arange(count)
        slots = live.slots + numbers
        for i in range(self.outputs):  # what the run goes on from is where single samples leave it
            slots[np.flatnonzero(kinds == i)[-1:]] = slot_of(i)
        live.samples[slots] = values
        actions = self.rows[kinds]
        place = actions[:, :, 2]
        for marked, what in ((self.own, slots), (self.value, 2 + numbers), (self.time, 2 + count + numbers)):
            place[...] = np.where(marked[kinds], what[:, None], place)
        place[:, -1] = numbers
        return live.go_through(times, regime, actions, np.concatenate([[0.0, 1.0], values, times]))


class Together:
    """Many samples of a run, with the bits of one after the other.

    Parameters
    ----------
    run : Following
    arriving : Arriving
        Single samples of the run.
    decided : bool
        Whether something is decided between two samples, so that they are taken one by one.
    """

    def __init__(self, run: Following, arriving: Arriving, *, decided: bool) -> None:
        self._run, self._system, self._live, self._arriving = run, run.system, run.live, arriving
        self._simple = self._system.follows_states and not decided

    @property
    def kinds(self) -> dict[str, int]:
        """The numbers of outputs and of inputs that come with samples, by name."""
        outputs, inputs = self._system.outputs, self._system.inputs
        given = {name: len(outputs) + i for name, i in inputs.items() if name not in outputs}
        return {**outputs, **given}

    def at_once(self, t: Floats, kinds: Integers) -> int:
        """How many of some samples may be taken together, see :meth:`hgorun.Estimator.at_once`."""
        if not self._simple or self._run.unchecked:
            return 0
        heard = np.array([*self._run.heard, *([True] * len(self._system.inputs))])
        since = t - self._system.experiment.origin
        fits = heard[kinds] & (since >= np.append(self._live.t, since[:-1]))
        gaps = np.diff(since, prepend=self._live.t)
        fits &= since < self._live.free_until
        fits &= gaps <= self._arriving.reach  # one further off is refused where it is taken alone
        if self._system.joint:
            fits &= (gaps > 0) & np.append(gaps[1:] > 0, False)
        count = len(fits) if fits.all() else int(np.argmin(fits))
        return min(count, TOGETHER)

    def take(self, t: Floats, kinds: Integers, values: Floats) -> dict[str, tuple[Floats, np.ndarray]]:
        """As many as that, see :meth:`hgorun.Estimator.update_many`."""
        system, run, live = self._system, self._run, self._live
        since = t - system.experiment.origin
        rows = self._kinds.carry_out(live, run.regime, since, kinds, values)
        if rows is None:
            rows = self._one_by_one(t, kinds, values)
        for i in range(len(system.outputs)):
            own = since[kinds == i]
            if own.size:
                run.newest[i] = (float(own[-1]),) * len(system.labels)
        lost = live.diverged[:, None] <= since
        readouts = zip(system.labels, system.structure.estimates, lost, strict=True)
        return {label: (readout.along(since, system.p, rows), gone) for label, readout, gone in readouts}

    def _one_by_one(self, t: Floats, kinds: Integers, values: Floats) -> Floats:
        """All states after each of some samples, of which one loses an observer."""
        names, rows = {kind: name for name, kind in self.kinds.items()}, np.empty((t.size, self._live.z.size))
        outputs = len(self._system.outputs)
        for k, (now, kind, value) in enumerate(zip(t.tolist(), kinds.tolist(), values.tolist(), strict=True)):
            given = {names[kind]: value}
            self._arriving.take(now, *((given, None, None) if kind < outputs else ({}, None, given)))
            rows[k] = self._live.z
        return rows

    @cached_property
    def _kinds(self) -> Kinds:
        return Kinds.of(self._system.structure.system, self._system.corrections, len(self._system.inputs))
