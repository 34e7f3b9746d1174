"""The process as its surroundings see it: streams that can be written, and signals that end it in order.

Only the standard library is imported here: Ctrl-C must be heard from the first moment on.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import NoReturn

INTERRUPTED, TERMINATED, CLOSED_PIPE = 130, 143, 141
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENAS = -1, -3, -8  # parameters of glibc's mallopt
_PIECES, _KEPT = 2**23, 2**26  # bytes of an array that may take another one's place, and of what is free for that
_TURN = 5e-4  # seconds of Python before another thread gets it that waits: a tenth of what is usual
_PATIENCE = 0.8  # seconds that Python code has to answer a signal, before the process ends without it
INTERRUPTION_SAID = "hgorun: interrupted; no file is left half-written"
TERMINATION_SAID = "hgorun: terminated; no file is left half-written"

unfinished: set[Path] = set()
"""Temporary files that this process is writing."""

_ended_by: list[int] = []  # exit codes of the signals that came, the first one first
_instead: list[int] = []  # the exit code of a process that a signal ends, where it is not the signal's
_postponed: list[list[int]] = []  # codes of signals that wait for the end of what is done whole
_said: set[str] = set()  # what has been said on stderr
_remaining: list[Callable[[], str]] = []  # what is to be said besides where a signal ends the process


def run(main: Callable[[], Callable[[], None]]) -> None:
    """Run a command line in a process of its own.

    Parameters
    ----------
    main : callable
        Imports the command line and returns its entry point: importing takes long enough to be interrupted.
    """
    try:
        _prepare_streams()  # first: a pipe of our own would take the number of a stream that is closed
        _listen()
        if not sys.warnoptions:  # of numpy, scipy, ...: they are meant for programmers
            warnings.simplefilter("ignore")
        main()()
    except BaseException:
        if not _ended_by:
            raise
        # libraries turn an interruption into whatever suits them, most of all while they are imported; and Python
        # itself would end by the signal if code that was run from a string had been interrupted
        _leave(_ended_by[0])


def _leave(code: int) -> NoReturn:
    """End at once, with nothing half-written and one line that says so."""
    _tidy()
    if not _said & {INTERRUPTION_SAID, TERMINATION_SAID}:
        say_ended(code)
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    os._exit(_instead[0] if _instead else code)


def end_with(code: int) -> NoReturn:
    """End a process that a signal ends in its course, with an exit code that says more than which signal it was."""
    _instead[:] = [code]
    raise SystemExit(code)


def processors() -> int:
    """How many things run at once: the processors that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def take_short_turns() -> None:
    """Let no thread keep Python to itself for long, from now on.

    Threads that compute in numpy and machine code need Python for moments, and one that would wait for it as long as
    Python lets others go on leaves a processor idle.
    """
    sys.setswitchinterval(_TURN)


def keep_memory() -> None:
    """Let arrays of some megabytes take the place of those that are gone, from now on, in all threads.

    As a rule the C library gives such memory back at once and asks for other, which the system has to fill with zeros:
    for whoever goes through gigabytes piece by piece that takes longer than to compute with them.
    """
    import ctypes

    allocator = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if allocator is not None:  # other libraries have other ways
        for parameter, value in ((_MMAP_THRESHOLD, _PIECES), (_TRIM_THRESHOLD, _KEPT), (_ARENAS, 1)):
            allocator(parameter, value)


def _tidy() -> None:
    """Remove what is half-written."""
    for path in tuple(unfinished):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def say(text: str) -> None:
    """A line on stderr, if that can be written."""
    _said.add(text)
    try:
        print(text, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        silence(sys.stderr)


def say_ended(code: int) -> None:
    """Say that a signal has ended the process, and what is to be said besides."""
    say(INTERRUPTION_SAID if code == INTERRUPTED else TERMINATION_SAID)
    while _remaining:
        say(_remaining.pop(0)())


@contextmanager
def told_where_ended(words: Callable[[], str]) -> Iterator[None]:
    """Say a line, which is asked for then, if a signal ends the process while this lasts."""
    _remaining.append(words)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        raise  # it is said by whoever ends the process
    except BaseException:
        _remaining.remove(words)
        raise
    _remaining.remove(words)


def silence(stream: object) -> None:
    """Send what is still in a stream's buffer nowhere, so that the end of the process does not fail on it."""
    try:
        number = stream.fileno()  # type: ignore[attr-defined]  # pytest's streams have none
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, number)
        os.close(nowhere)
    except (OSError, ValueError, AttributeError):
        return


def _prepare_streams() -> None:
    """Streams that exist, and that can hold any text."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:  # closed: the next file opened would get its number, and be written by whoever uses it
            if os.open(os.devnull, os.O_RDWR) != number:
                continue
            stream = open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115  # for the whole process
            setattr(sys, name, stream)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")


def _listen() -> None:
    """SIGINT and SIGTERM become exceptions; native code that keeps Python from raising them is not waited for."""
    for number, code in ((signal.SIGINT, INTERRUPTED), (signal.SIGTERM, TERMINATED)):
        if signal.getsignal(number) is signal.SIG_IGN:  # as nohup and shells' background jobs want it
            continue
        signal.signal(number, _raiser(code))
    if os.name == "posix":
        heard, told = os.pipe()
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        threading.Thread(target=_watch, args=(heard,), daemon=True).start()


def _raiser(code: int) -> Callable[[int, FrameType | None], None]:
    def handler(number: int, frame: FrameType | None) -> None:
        _ended_by.append(code)
        if _postponed:
            _postponed[0].append(code)
        else:
            _stop(code)

    return handler


def _stop(code: int) -> NoReturn:
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    raise SystemExit(code)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """What is done here is done whole: a signal that comes meanwhile is answered at its end, if that is soon."""
    waiting: list[int] = []
    _postponed.append(waiting)
    try:
        yield
    finally:
        _postponed.pop()
    if waiting:
        _stop(waiting[0])


@contextmanager
def until_interrupted(stop: Callable[[], None]) -> Iterator[None]:
    """Where Ctrl-C is the way to end what is done: it calls ``stop``, from the main thread, and is no interruption.

    Parameters
    ----------
    stop : callable
        What is done here has to come to its end soon after.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield  # signals are heard by the main thread alone
        return
    told = signal.set_wakeup_fd(-1)
    before = signal.signal(signal.SIGINT, lambda *_: stop())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)


def serve() -> None:
    """In a process that works for another one: Ctrl-C is the other's business, its end is ours, killed or not.

    SIGTERM ends it at once: a pool of processes would catch an exception, and wait for the next piece of work.
    """

    def end(*_: object) -> None:
        _tidy()
        os._exit(TERMINATED)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    from multiprocessing import connection, parent_process

    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(TERMINATED)


def _watch(heard: int) -> None:
    """End the process when a signal came and Python has not ended it soon after."""
    codes = {int(signal.SIGINT): INTERRUPTED, int(signal.SIGTERM): TERMINATED}
    while True:
        arrived = [codes[number] for number in os.read(heard, 64) if number in codes]
        if arrived and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            break
    time.sleep(_PATIENCE)
    multiprocessing = sys.modules.get("multiprocessing")
    for child in multiprocessing.active_children() if multiprocessing else ():
        child.terminate()
    _leave(arrived[0])
