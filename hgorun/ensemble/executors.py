"""Who carries blocks of members out: threads of this process, other processes, or the workers of a cluster.

None of them has an influence on any number: each makes its members from the same text.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import TypeAlias

from hgorun.ensemble.carried import Carried, carry_out
from hgorun.ensemble.cuts import Cuts, Range
from hgorun.ensemble.recipe import ensemble_of
from hgorun.errors import SimulationError

Executor: TypeAlias = Callable[[str, Cuts], Iterator[Carried]]
"""From a recipe and the members that are missing, the blocks as they are finished."""

EXECUTORS = ("threads", "processes", "dask")
_DEATHS = 3  # of processes that may be killed while they carry out one block
_AHEAD = 2  # blocks that wait for each worker


def processors() -> int:
    """How many blocks run at once: the processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads(jobs: int) -> Executor:
    """Block after block, each on so many threads of this process."""

    def run(recipe: str, cuts: Cuts) -> Iterator[Carried]:
        for start, stop in cuts:
            yield carry_out(recipe, start, stop, jobs)

    return run


def processes(jobs: int) -> Executor:
    """So many blocks at once, each in a process of its own.

    What a process was carrying out when it was killed is carried out again.
    """

    def run(recipe: str, cuts: Cuts) -> Iterator[Carried]:
        again: list[Range] = []
        deaths: dict[Range, int] = {}
        while True:
            pool = _Pool(recipe, jobs)
            try:
                yield from pool.finished(cuts, again)
                return
            except BrokenProcessPool:
                again = pool.unfinished
                for one in again:
                    deaths[one] = deaths.get(one, 0) + 1
                if again and max(deaths.values()) > _DEATHS:
                    raise SimulationError(
                        "worker processes are killed again and again, perhaps for want of memory; what is finished is "
                        "kept: run the command again, with fewer --jobs"
                    ) from None
            finally:
                pool.close()

    return run


class _Pool:
    """Processes, and the blocks that they have to do."""

    def __init__(self, recipe: str, jobs: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(recipe,))
        self._recipe, self._room = recipe, _AHEAD * jobs
        self._left: dict[Future[Carried], Range] = {}

    @property
    def unfinished(self) -> list[Range]:
        """The blocks that were begun or waiting."""
        return sorted(self._left.values())

    def finished(self, cuts: Cuts, again: list[Range]) -> Iterator[Carried]:
        """The blocks as they are finished, those first that were begun before."""
        todo = iter((*again, *()))
        for start, stop in self._fill(todo, len(again)):
            self._submit(start, stop)
        while True:
            for start, stop in self._fill(cuts, self._room - len(self._left)):
                self._submit(start, stop)
            if not self._left:
                return
            done, _ = wait(self._left, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=lambda f: self._left[f]):
                carried = future.result()
                del self._left[future]
                yield carried

    @staticmethod
    def _fill(ranges: Iterator[Range], count: int) -> Iterator[Range]:
        for _ in range(count):
            with suppress(StopIteration):
                yield next(ranges)

    def _submit(self, start: int, stop: int) -> None:
        self._left[self._pool.submit(carry_out, self._recipe, start, stop)] = start, stop

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        for process in list((self._pool._processes or {}).values()):
            process.terminate()
        self._pool.shutdown(cancel_futures=True)


def _start(recipe: str) -> None:
    """In a new process: Ctrl-C is the parent's business, and an end in time is an orderly one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    ensemble_of(recipe)
