"""Work on a stranger's file in a process of its own: the HDF5 library can hang, crash or take all memory on it."""

from __future__ import annotations

import faulthandler
import gc
import os
import pickle
import select
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NoReturn, TypeVar, cast

from hgorun.errors import HgorunError

T = TypeVar("T")

_CHUNK = 2**20


class Failed(Exception):
    """The work did not end, or ended the process that did it; the message says which."""


def guarded(work: Callable[[], T], *, seconds: float, memory: int) -> T:
    """What a function returns, or the `HgorunError` that it raises, from a child process with limits.

    Where processes cannot be forked the function is called as it is.

    Parameters
    ----------
    work : callable
        Returns something that can be pickled, and changes nothing.
    seconds : float
        After which the child is ended.
    memory : int
        Bytes that the child may take beside what this process has.

    Raises
    ------
    Failed
        When the child was ended, by us or by the system.
    """
    if os.name != "posix":
        return work()
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(out)
        _serve(work, into, seconds, memory)
    os.close(into)
    try:
        answer = _received(out, time.monotonic() + seconds)
    finally:
        os.close(out)
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)  # it has nothing more to do
        os.waitpid(child, 0)
    if not answer:
        raise Failed("reading it crashes or takes too much memory")
    fine, value = pickle.loads(answer)  # from ourselves
    if not fine:
        raise value
    return cast(T, value)


def _received(out: int, deadline: float) -> bytes:
    parts: list[bytes] = []
    while True:
        ready, _, _ = select.select([out], [], [], max(deadline - time.monotonic(), 0.0))
        if not ready:
            raise Failed("reading it takes too long")
        part = os.read(out, _CHUNK)
        if not part:
            return b"".join(parts)
        parts.append(part)


def _serve(work: Callable[[], object], into: int, seconds: float, memory: int) -> NoReturn:
    """In the child: carry the work out within the limits, send what comes of it, and end."""
    try:
        gc.disable()  # what is finalised here may wait for threads of the parent, which are not in the child
        faulthandler.disable()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)  # messages of HDF5 and malloc are meant for programmers
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
        _limit(seconds, memory)
        try:
            answer = pickle.dumps((True, work()), protocol=5)
        except HgorunError as error:
            answer = pickle.dumps((False, error))
        left = memoryview(answer)
        while left:
            left = left[os.write(into, left) :]
    finally:
        os._exit(0)


def _limit(seconds: float, memory: int) -> None:
    import resource

    pages = Path("/proc/self/statm")
    taken = int(pages.read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE") if pages.exists() else 2**33
    for what, limit in ((resource.RLIMIT_AS, taken + memory), (resource.RLIMIT_CPU, int(seconds) + 1)):
        _, hard = resource.getrlimit(what)
        with suppress(OSError, ValueError):
            resource.setrlimit(what, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
