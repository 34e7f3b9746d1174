"""Many runs of one system, W of them side by side in vector registers, blocks of them on threads.

The members of an ensemble differ in their numbers: initial states, parameters, gain and bias of samples, held noise.
Each of them has the bits that it has alone, whatever the number of lanes and of threads. Trajectories are not kept
unless asked for: a :class:`Reduction` makes a few numbers of the rows of some lanes before the next ones are
integrated, while the rows are still in the cache.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.loose import fits
from hgorun.engine.many import Control, ManyProgram, Worker, beside, lanes_of, widest
from hgorun.engine.member_numbers import MemberNumbers, Outcome, Reduction
from hgorun.engine.members import INPUTS
from hgorun.engine.methods import METHODS
from hgorun.engine.plan import Floats, Plan
from hgorun.engine.queue import Queue
from hgorun.errors import SimulationError

_ROWS = 1 << 26  # numbers of the rows of a block: of long ones fewer are made side by side
_KEPT = 1 << 24  # numbers of rows that are kept at once for a reduction in Python


@dataclass(frozen=True, eq=False)
class _How:
    """How members are carried out; as the arguments of :meth:`Ensemble.run`."""

    rows: bool
    threads: int
    progress: Callable[[int], None] | None
    control: Control | None


class Ensemble:
    """Runs of one system.

    Parameters
    ----------
    system : HybridSystem
    method : str
        ``euler``, ``rk4``, ``dopri5`` or ``rodas5p``.
    lanes : int, optional
        So many members side by side; by default as many as are fastest here. It changes no number.
    """

    def __init__(self, system: HybridSystem, method: str, lanes: int | None = None) -> None:
        self.system, self.method = system, method
        self.lanes = lanes_of(system) if lanes is None else lanes
        self._others = {self.lanes: self}  # by their numbers of lanes
        self._programs: dict[tuple[tuple[int, ...] | None, bool, bool, bool], ManyProgram] = {}

    def run(
        self,
        plan: Plan,
        members: MemberNumbers,
        reduction: Reduction | None = None,
        *,
        rows: bool = False,
        threads: int = 1,
        progress: Callable[[int], None] | None = None,
        control: Control | None = None,
    ) -> Outcome:
        """Runs that have a plan in common; its gain, bias and holds are not read.

        Parameters
        ----------
        plan : Plan
        members : MemberNumbers
            Their numbers take memory: an ensemble of a million is given in parts of some thousands.
        reduction : Reduction, optional
            A compiled one runs in the native loop.
        rows : bool
            Keep all rows.
        threads : int
            So many at once, on as many threads.
        progress : callable, optional
            Called now and then with the number of members that are done; also the chance for Ctrl-C.
        control : Control, optional
            Of steps that an error estimate controls; they are fixed without. No history may be needed then, see
            :func:`~hgorun.engine.loose_adaptive.controllable`.

        Raises
        ------
        SimulationError
            Where a delay reaches further back than ``plan.reach``.
        """
        how = _How(rows, threads, progress, control)
        return self._run([plan.whole()], members, reduction, how)

    def run_each(
        self,
        plans: Sequence[Plan],
        members: MemberNumbers,
        reduction: Reduction | None = None,
        *,
        rows: bool = False,
        threads: int = 1,
        progress: Callable[[int], None] | None = None,
        control: Control | None = None,
    ) -> Outcome:
        """Runs each of which has a plan of its own, with its gain, bias and holds; all have one grid.

        They run side by side, each lane through its own events, but for those with continuous delays, many regimes or
        an embedded error estimate, which take a lane each, on threads. The members' own gain, bias and holds are not
        read; all else as in :meth:`run`.
        """
        plans = [plan.whole() for plan in plans]
        gain, bias, holds = (beside([getattr(plan, name) for plan in plans]) for name in ("gain", "bias", "holds"))
        numbers = replace(members, gain=gain, bias=bias, holds=holds)
        how = _How(rows, threads, progress, control)
        if control or (fits(self.system, METHODS[self.method]) and self.lanes > 1):
            return self._run(plans, numbers, reduction, how)
        return self._one_by_one(plans, numbers, reduction, how)

    def _one_by_one(
        self,
        plans: Sequence[Plan],
        members: MemberNumbers,
        reduction: Reduction | None,
        how: _How,
    ) -> Outcome:
        """Members that share nothing, each on one lane."""
        single, quiet = self._on(1), replace(how, threads=1, progress=None)

        def one(i: int) -> Outcome:
            own = members.some(slice(i, i + 1))
            return single._run(plans[i : i + 1], own, reduction, quiet)

        parts = [one(0)]  # compiled before there are threads
        with ThreadPoolExecutor(max(how.threads, 1)) as pool:
            for part in pool.map(one, range(1, len(plans))):
                parts.append(part)
                if how.progress:
                    how.progress(len(parts))
        return _joined(parts, how.rows)

    def _run(
        self,
        plans: Sequence[Plan],
        members: MemberNumbers,
        reduction: Reduction | None,
        how: _How,
    ) -> Outcome:
        """Runs that have one plan, or each its own."""
        loose, rows, lanes = len(plans) > 1 or how.control is not None, how.rows, self.lanes
        while lanes > 1 + loose and lanes * self.system.states * plans[0].grid.size > _ROWS:
            lanes //= 2
        if lanes < self.lanes:
            fewer = self._on(lanes)
            return fewer._run(plans, members, reduction, how)
        plan = widest(plans) if loose else plans[0]
        whole = self.system.states if rows else None
        threads = range(max(how.threads, 1))
        reducers = [reduction.reducer(self.lanes, whole=whole) if reduction else None for _ in threads]
        compiled = reducers[0] is not None
        if reduction is not None and not compiled and not rows:
            return self._in_parts(plans, members, reduction, how)
        shown = reduction.states if reduction is not None and compiled and not rows else None
        program = self._program(shown, loose=loose, adaptive=how.control is not None, rows=rows)
        count, s = members.count, self.system
        inputs = {name: _doubles(members.named(name)) for name in INPUTS}
        outputs = {
            "final": np.empty((s.states, count)),
            "first": np.empty((s.states, count)),
            "diverged": np.empty((s.observers, count)),
            "lost": np.empty((1, count)),
            "error": np.empty((s.states, count)),
            "tries": np.zeros((1, count)),
            "found": np.empty((reducers[0].size if reducers[0] else 0, count)),
            "kept": np.empty((plan.grid.size if rows else 0, s.states, count)),
        }
        workers = [
            Worker(program, plan, inputs, outputs, count, members.bound, reducer, plans if loose else (), how.control)
            for reducer in reducers
        ]
        Queue(-(-count // self.lanes)).carry_out(workers, _told(how.progress, self.lanes, count))
        if how.control is None and np.any(outputs["lost"] == -np.inf):
            raise SimulationError("a delay reaches further back than the history that is kept for it")
        reduced = np.empty((0, count))
        if reduction is not None:
            reduced = reduction.finished(outputs["found"]) if compiled else reduction.of(outputs["kept"], members.p)
        return Outcome(
            reduced=reduced,
            diverged=outputs["diverged"],
            plant_diverged=outputs["lost"][0],
            first=outputs["first"],
            last=outputs["final"],
            error=outputs["error"],
            rows=outputs["kept"] if rows else None,
            tries=outputs["tries"][0].astype(np.int64),
        )

    def _on(self, lanes: int) -> Ensemble:
        """The same on another number of lanes."""
        if lanes not in self._others:
            self._others[lanes] = Ensemble(self.system, self.method, lanes)
        return self._others[lanes]

    def _program(self, shown: Sequence[int] | None, *, loose: bool, adaptive: bool, rows: bool) -> ManyProgram:
        key = None if shown is None else tuple(shown), loose, adaptive, rows
        if key not in self._programs:
            self._programs[key] = ManyProgram(
                self.system, self.method, self.lanes, key[0], loose=loose, adaptive=adaptive, estimates=rows
            )
        return self._programs[key]

    def _in_parts(
        self,
        plans: Sequence[Plan],
        members: MemberNumbers,
        reduction: Reduction,
        how: _How,
    ) -> Outcome:
        """With a reduction in Python, which needs the rows of a part of the members at a time."""
        size = max(_KEPT // (plans[0].grid.size * self.system.states), 1)
        parts = []
        for first in range(0, members.count, size):
            some = members.some(slice(first, first + size))
            own = plans[first : first + size] if len(plans) > 1 else plans
            found = self._run(own, some, reduction, replace(how, rows=True, progress=None))
            parts.append(replace(found, rows=None))
            if how.progress:
                how.progress(first + some.count)
        return _joined(parts, False)


def _told(progress: Callable[[int], None] | None, lanes: int, count: int) -> Callable[[int], None]:
    """Progress in members, from that in blocks."""
    return lambda blocks: progress(min(blocks * lanes, count)) if progress else None


def _doubles(array: np.ndarray) -> Floats:
    """The same, of doubles whose strides are whole words."""
    fits = array.dtype == np.float64 and all(stride % 8 == 0 for stride in array.strides)
    return array if fits else np.ascontiguousarray(array, dtype=float)


def _joined(parts: Sequence[Outcome], rows: bool) -> Outcome:
    names = ["reduced", "diverged", "plant_diverged", "first", "last", "error", "tries", *(["rows"] if rows else [])]
    return Outcome(**{name: np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names})
