"""Things that are made in a thread, a few ahead of whoever uses them."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from queue import Empty, Queue
from typing import TypeVar

_T = TypeVar("_T")


@contextmanager
def ahead(things: Iterable[_T], count: int = 1) -> Iterator[Iterator[_T]]:
    """The same things one after the other, each made while those before are used.

    Parameters
    ----------
    things : iterable
        Gone through by the thread; what it raises is raised where the thing is asked for.
    count : int
        So many may wait to be used: they are memory.
    """
    made: Queue[list[_T] | BaseException] = Queue(count)  # things are held here by nobody but who uses them
    enough = threading.Event()

    def make() -> None:
        error: BaseException = StopIteration()
        try:
            for thing in things:
                made.put([thing])
                del thing
                if enough.is_set():
                    return
        except BaseException as raised:
            error = raised
        made.put(error)

    def used() -> Iterator[_T]:
        while True:
            found = made.get()
            if isinstance(found, StopIteration):
                return
            if isinstance(found, BaseException):
                raise found
            yield found.pop()

    thread = threading.Thread(target=make, name="making things ahead", daemon=True)
    thread.start()
    try:
        yield used()
    finally:
        enough.set()
        while thread.is_alive():  # it may wait for room
            try:
                made.get(timeout=0.01)
            except Empty:
                continue
        thread.join()
