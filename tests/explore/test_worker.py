"""What a live page computes, and in which order."""

from __future__ import annotations

import threading
import time

import pytest

from hgorun.explore import worker
from hgorun.explore.worker import AT_ONCE, LATER, SOON, Job, Worker


def test_what_takes_long_begins_when_nothing_else_has_come_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    """A change that comes meanwhile is before it, however short the pause, and the next pause counts anew."""
    monkeypatch.setattr(worker, "QUIET", 0.15)
    faults: list[Exception] = []
    done: list[tuple[str, float]] = []
    ended = threading.Event()
    made = Worker(faults.append)

    def named(name: str) -> Job:
        return lambda: done.append((name, time.monotonic()))

    made.submit(named("curves"), AT_ONCE)
    made.submit(named("limits"), LATER)
    made.submit(ended.set, LATER)
    made.submit(named("bounds"), SOON)
    time.sleep(0.05)
    made.submit(named("next curves"), AT_ONCE)
    assert ended.wait(10)
    assert [name for name, _ in done] == ["curves", "bounds", "next curves", "limits"]
    assert done[3][1] - done[2][1] >= 0.15
    assert not faults


def test_a_fault_does_not_end_the_work() -> None:
    faults: list[Exception] = []
    ended = threading.Event()
    made = Worker(faults.append)
    made.submit(lambda: 1 // 0)  # type: ignore[arg-type]  # a job that fails
    made.submit(ended.set)
    assert ended.wait(10)
    assert [type(fault) for fault in faults] == [ZeroDivisionError]
