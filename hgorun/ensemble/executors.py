"""Who carries blocks of members out: threads of this process, other processes, or the workers of a cluster.

None of them has an influence on any number: each makes its members from the same text.
"""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED as FIRST
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Protocol, TypeAlias

from hgorun.ensemble.blocks.carried import Carried, carry_out
from hgorun.ensemble.blocks.cuts import Cuts, Range
from hgorun.ensemble.members.recipe import ensemble_of
from hgorun.errors import SimulationError
from hgorun.process import serve

Executor: TypeAlias = Callable[[str, Cuts, Callable[[int], None]], Iterator[Carried]]
"""From a recipe and the members that are missing, the blocks as they are finished.

Who carries out one block after the other may tell how many members of it are finished.
"""

EXECUTORS = ("threads", "processes", "dask")
_DEATHS = 3  # of processes that may be killed while they carry out one block
_AHEAD = 2  # blocks that wait for each worker


def threads(jobs: int) -> Executor:
    """Block after block, each on so many threads of this process."""

    def run(recipe: str, cuts: Cuts, told: Callable[[int], None]) -> Iterator[Carried]:
        for start, stop in cuts:
            yield carry_out(recipe, start, stop, jobs, told)

    return run


def processes(jobs: int) -> Executor:
    """So many blocks at once, each in a process of its own.

    What a process was carrying out when it was killed is carried out again.
    """

    def run(recipe: str, cuts: Cuts, _: Callable[[int], None]) -> Iterator[Carried]:
        flow, deaths = Flow(cuts, _AHEAD * jobs), Counter[Range]()
        while True:
            pool = _pool(recipe, jobs)
            try:
                yield from flow.finished(_submitting(pool, recipe), partial(wait, return_when=FIRST))
                return
            except BrokenProcessPool:
                deaths.update(list(flow.left))
                flow.again()
                if deaths.most_common(1)[0][1] > _DEATHS:
                    raise SimulationError(
                        "worker processes are killed again and again, perhaps for lack of memory; what is finished is "
                        "kept: run the command again, with fewer --jobs"
                    ) from None
            finally:
                _end(pool)

    return run


class AnyFuture(Protocol):
    """What is asked of a future, whoever has made it."""

    def done(self) -> bool:
        """Whether it has ended."""

    def result(self) -> Carried:
        """What it has given."""


class Flow:
    """Blocks on their way: there are never more of them than the workers need, so that memory stays the same.

    Attributes
    ----------
    left : dict of (start, stop) to future
        Those that have been begun, or are waiting for a worker.
    """

    def __init__(self, cuts: Cuts, room: int) -> None:
        self.left: dict[Range, AnyFuture] = {}
        self._cuts, self._room, self._again = cuts, room, list[Range]()

    def again(self) -> None:
        """Let all that have been begun be begun anew."""
        self._again = sorted({*self.left, *self._again})
        self.left.clear()

    def finished(
        self, submit: Callable[[int, int], AnyFuture], wait: Callable[[list[AnyFuture]], object]
    ) -> Iterator[Carried]:
        """The blocks as they are finished.

        Parameters
        ----------
        submit : callable
            Begins a block.
        wait : callable
            Returns when one of several futures has ended.
        """
        while True:
            while len(self.left) < self._room:
                one = self._again.pop(0) if self._again else next(self._cuts, None)
                if one is None:
                    break
                self.left[one] = Future()  # beginning it may fail
                self.left[one] = submit(*one)
            if not self.left:
                return
            wait(list(self.left.values()))
            for one in sorted(range for range, future in self.left.items() if future.done()):
                carried = self.left[one].result()
                del self.left[one]
                yield carried


def _pool(recipe: str, jobs: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(recipe,))


def _submitting(pool: ProcessPoolExecutor, recipe: str) -> Callable[[int, int], AnyFuture]:
    return lambda start, stop: pool.submit(carry_out, recipe, start, stop)


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes, whatever they are doing."""
    for process in list((pool._processes or {}).values()):
        process.terminate()
    pool.shutdown(cancel_futures=True)


def _start(recipe: str) -> None:
    """In a new process: what all its blocks need is made once."""
    serve()
    ensemble_of(recipe)
