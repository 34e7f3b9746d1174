"""Jobs on several processes, with progress for a person at a terminal."""

from __future__ import annotations

import multiprocessing
import queue
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeAlias

from hgorun.errors import HgorunError, SimulationError
from hgorun.process import processors, serve
from hgorun.progress import shown
from hgorun.reproduce.job import Job, Outcome, Work

Messages: TypeAlias = "queue.Queue[tuple[int, float, str]]"
"""The number of a job, the completed fraction of it, and what is being done."""

Progress: TypeAlias = Callable[[int, float, str], None]

_queue: Messages  # of the worker's process: where it reports to
_threads: int  # likewise: how many carry members of an ensemble out
_OFTEN = 0.1  # seconds between two reports of a worker


def run_all(works: Sequence[Work], *, workers: int | None = None, show: bool = True) -> list[Outcome]:
    """Do all jobs, the stale parts of them.

    Parameters
    ----------
    works : sequence of Work
    workers : int, optional
        Processes at once; by default one a processor.
    show : bool
        Whether progress is shown on stderr.

    Raises
    ------
    HgorunError
        What went wrong first; the other jobs are finished, and what is finished stays.
    """
    stale = [i for i, work in enumerate(works) if not work.done]
    outcomes = {i: work.outcome() for i, work in enumerate(works) if work.done}
    count = min(workers or processors(), len(stale))
    with _progress(len(stale), show) as progress:
        if count == 1:
            for number, i in enumerate(stale):

                def report(part: float, what: str, number: int = number, name: str = works[i].study.name) -> None:
                    progress(number, part, f"{name}: {what}")

                outcomes[i] = works[i].run(report)
                progress(number, 1.0, "")
        elif count > 1:
            outcomes |= _in_parallel([works[i].job for i in stale], stale, count, progress)
    return [outcomes[i] for i in range(len(works))]


def _in_parallel(jobs: list[Job], places: list[int], count: int, progress: Progress) -> dict[int, Outcome]:
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager:
        messages = manager.Queue()
        own = messages, max(processors() // count, 1)
        pool = ProcessPoolExecutor(count, mp_context=context, initializer=_start, initargs=own)
        try:
            futures = {pool.submit(_work, job, i): i for i, job in enumerate(jobs)}
            return {places[i]: outcome for i, outcome in _collected(futures, messages, progress)}
        except BaseException:
            for process in list((pool._processes or {}).values()):
                process.terminate()  # files are written whole or not at all
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _collected(
    futures: dict[Future[Outcome], int], messages: Messages, progress: Progress
) -> Iterator[tuple[int, Outcome]]:
    left, failed = set(futures), None
    while left:
        finished, left = wait(left, timeout=_OFTEN, return_when=FIRST_COMPLETED)
        while True:
            try:
                progress(*messages.get_nowait())
            except queue.Empty:
                break
        for future in finished:
            try:
                outcome = future.result()
            except HgorunError as error:
                failed = failed or error
            except BrokenProcessPool:
                raise SimulationError(
                    "a worker process was killed; what it had finished is kept: run the command again"
                ) from None
            else:
                progress(futures[future], 1.0, "")
                yield futures[future], outcome
    if failed is not None:
        raise failed


def _start(messages: Messages, threads: int) -> None:
    """In a new worker."""
    global _queue, _threads
    _queue, _threads = messages, threads
    serve()


def _work(job: Job, number: int) -> Outcome:
    work, last = Work(job), 0.0

    def report(part: float, what: str) -> None:
        nonlocal last
        if time.monotonic() - last > _OFTEN:
            last = time.monotonic()
            _queue.put((number, part, f"{work.study.name}: {what}"))

    return work.run(report, threads=_threads)


@contextmanager
def _progress(jobs: int, show: bool) -> Iterator[Progress]:
    """How far all jobs are together."""
    parts = [0.0] * jobs
    with shown(jobs, "", show=show) as whole:

        def progress(number: int, part: float, what: str) -> None:
            parts[number] = max(parts[number], part)
            whole.update(sum(parts), what=what or None)

        yield progress
