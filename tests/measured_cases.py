"""What coverage need not measure: of tests that are marked ``measured_once`` all cases but the first.

A traced interpreter is two or three times slower, in the libraries that are called as well.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import coverage
import pytest


def further_cases(items: Sequence[pytest.Item]) -> set[str]:
    """The names of all cases but the first of each test that is marked."""
    seen = set[str]()
    further = set[str]()
    for item in items:
        if item.get_closest_marker("measured_once") is not None:
            test = item.nodeid.partition("[")[0]
            if test in seen:
                further.add(item.nodeid)
            seen.add(test)
    return further


@contextmanager
def unmeasured() -> Iterator[None]:
    """Nothing is measured inside, neither here nor in forks nor in processes that are started."""
    measuring = coverage.Coverage.current()
    if measuring is None:
        yield
        return
    names = [name for name in os.environ if name.startswith("COVERAGE_PROCESS_")]
    told = {name: os.environ.pop(name) for name in names}
    measuring.stop()
    try:
        yield
    finally:
        measuring.start()
        os.environ.update(told)
