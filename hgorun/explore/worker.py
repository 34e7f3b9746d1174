"""One thread that computes, so that a page answers meanwhile: what is urgent first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from itertools import count
from queue import PriorityQueue
from typing import TypeAlias

Job: TypeAlias = Callable[[], None]

AT_ONCE, SOON, LATER = 0, 1, 2


class Worker:
    """Carries out jobs one after the other, in a thread that does not keep the process alive.

    A job has to answer for its own errors; one that it does not is given to ``failed``, and the next one is carried
    out.
    """

    def __init__(self, failed: Callable[[Exception], None]) -> None:
        self._jobs: PriorityQueue[tuple[int, int, Job]] = PriorityQueue()
        self._numbers = count()
        self._failed = failed
        threading.Thread(target=self._work, daemon=True, name="hgorun explore").start()

    def submit(self, job: Job, urgency: int = AT_ONCE) -> None:
        """Carry out a job when it is its turn."""
        self._jobs.put((urgency, next(self._numbers), job))

    def _work(self) -> None:
        while True:
            _, _, job = self._jobs.get()
            try:
                job()
            except Exception as error:
                self._failed(error)
