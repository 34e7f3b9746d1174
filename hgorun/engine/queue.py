"""Blocks of members that wait for a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

from hgorun.engine.many import Worker

_SLICE = 0.05  # seconds of native code between two checks for Ctrl-C


class Queue:
    """Blocks that wait for a thread."""

    def __init__(self, count: int) -> None:
        self._count, self._next, self.done, self._workers = count, 0, 0, 1
        self._lock = threading.Lock()

    def carry_out(self, workers: Sequence[Worker], told: Callable[[int], None]) -> None:
        """All of them, by one worker in this thread or by several in theirs; told of the number of blocks done."""
        self._workers = len(workers)
        if len(workers) == 1:
            for _ in self._work(workers[0]):
                told(self.done)
            return
        with ThreadPoolExecutor(len(workers)) as pool:
            futures = [pool.submit(lambda one=worker: list(self._work(one))) for worker in workers]  # type: ignore[misc]  # of a default
            try:
                while wait(futures, timeout=2 * _SLICE).not_done:
                    told(self.done)
            except BaseException:
                self._next = self._count  # nothing more is begun
                raise
            for future in futures:
                future.result()
        told(self.done)

    def _work(self, worker: Worker) -> Iterator[None]:
        size = 1
        while True:
            with self._lock:
                first, left = self._next, self._count - self._next
                # of the last blocks none gets so many that the others wait for it
                share = left if self._workers == 1 else max(left // (2 * self._workers), 1)
                stop = first + min(size, share, left)
                self._next = stop
            if first >= stop:
                return
            before = time.perf_counter()
            worker.run(first, stop)
            size = max(1, int(size * min(_SLICE / max(time.perf_counter() - before, 1e-6), 8.0)))
            with self._lock:
                self.done += stop - first
            yield
