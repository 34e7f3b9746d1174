"""What coverage need not measure: slow and costly tests that are not marked ``measured``, and further cases.

Of tests that are marked ``measured_once`` these are all cases but the first.

A traced interpreter is two or three times slower, in the libraries that are called as well. Drawings and pages are not
traced: matplotlib and bokeh run nothing of this package there.
"""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import ParamSpec, TypeVar

import coverage
import pytest

# Called rarely: behind an untraced call its caller is traced again only when it calls something.
_DRAWN = {
    "matplotlib.figure": ("Figure.draw", "Figure.savefig", "Figure.subplots"),
    "bokeh.embed": ("file_html",),
}

P = ParamSpec("P")
R = TypeVar("R")


class Measured:
    """Which tests coverage measures: those that take no turns, or are marked ``measured``."""

    def __init__(self) -> None:
        self._seen = set[str]()

    @contextmanager
    def of(self, item: pytest.Item) -> Iterator[None]:
        test = item.nodeid.partition("[")[0]
        further = test in self._seen and item.get_closest_marker("measured_once") is not None
        self._seen.add(test)
        with nullcontext() if is_wanted(item) and not further else unmeasured():
            yield


def is_wanted(item: pytest.Item) -> bool:
    """Whether a test takes no turns and is not marked ``unmeasured``."""
    return item.get_closest_marker("unmeasured") is None and not takes_turns(item)


def takes_turns(item: pytest.Item) -> bool:
    """Whether a test is slow or costly, and not marked ``measured``; that mark may name the cases that it is for."""
    needed = item.get_closest_marker("measured")
    if needed is not None and (not needed.args or item.nodeid.partition("[")[2][:-1] in needed.args):
        return False
    return any(item.get_closest_marker(mark) is not None for mark in ("slow", "costly"))


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


def leave_out_drawings() -> None:
    """As soon as matplotlib or bokeh has been imported; what they are called for is traced."""
    for module, names in _DRAWN.items():
        for path in names:
            *inside, name = path.split(".")
            owner = functools.reduce(lambda part, one: getattr(part, one, None), inside, sys.modules.get(module))
            function = getattr(owner, name, None)
            if function is not None and not hasattr(function, "__wrapped__"):
                setattr(owner, name, untraced(function))


def untraced(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, inside of which no line is traced."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        tracer = sys.gettrace()
        sys.settrace(None)
        try:
            return function(*args, **kwargs)
        finally:
            sys.settrace(tracer)

    return call
