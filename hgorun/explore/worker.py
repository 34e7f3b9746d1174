"""One thread that computes, so that a page answers meanwhile: what is urgent first."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable
from itertools import count
from time import monotonic
from typing import TypeAlias

Job: TypeAlias = Callable[[], None]

AT_ONCE, SOON, LATER = 0, 1, 2
QUIET = 0.6  # seconds without anything urgent, after which what is for later begins: what comes has to wait for it


class Worker:
    """Carries out jobs one after the other, in a thread that does not keep the process alive.

    A job has to answer for its own errors; one that it does not is given to ``failed``, and the next one is carried
    out.
    """

    def __init__(self, failed: Callable[[Exception], None]) -> None:
        self._jobs: list[tuple[int, int, Job]] = []
        self._numbers = count()
        self._failed = failed
        self._urgent = monotonic()  # when the latest of the urgent ones was done
        self._changed = threading.Condition()
        threading.Thread(target=self._work, daemon=True, name="hgorun explore").start()

    def submit(self, job: Job, urgency: int = AT_ONCE) -> None:
        """Carry out a job when it is its turn."""
        with self._changed:
            heapq.heappush(self._jobs, (urgency, next(self._numbers), job))
            self._changed.notify()

    def _next(self) -> tuple[int, Job]:
        with self._changed:
            while True:
                wait = None
                if self._jobs:
                    wait = self._urgent + QUIET - monotonic() if self._jobs[0][0] >= LATER else 0.0
                if wait is not None and wait <= 0:
                    urgency, _, job = heapq.heappop(self._jobs)
                    return urgency, job
                self._changed.wait(wait)

    def _work(self) -> None:
        while True:
            urgency, job = self._next()
            try:
                job()
            except Exception as error:
                self._failed(error)
            if urgency < LATER:
                self._urgent = monotonic()
