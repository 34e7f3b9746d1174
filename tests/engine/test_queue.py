"""Blocks that wait for a thread: each is carried out once, and the last ones are shared."""

from __future__ import annotations

import threading
from typing import cast

import pytest

from hgorun.engine.many import Worker
from hgorun.engine.queue import Queue


class Noted:
    """Takes no time, so that it is given more and more."""

    def __init__(self, parts: list[tuple[int, int]]) -> None:
        self.parts, self._lock = parts, threading.Lock()

    def run(self, first: int, stop: int) -> None:
        with self._lock:
            self.parts.append((first, stop))


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_every_block_is_carried_out_once_and_none_of_the_last_waits_for_many(workers: int) -> None:
    parts: list[tuple[int, int]] = []
    told: list[int] = []
    Queue(1000).carry_out([cast("Worker", Noted(parts)) for _ in range(workers)], told.append)
    assert sorted(i for first, stop in parts for i in range(first, stop)) == list(range(1000))
    assert told[-1] == 1000
    if workers > 1:
        assert all(stop - first <= max((1000 - first) // (2 * workers), 1) for first, stop in parts)
