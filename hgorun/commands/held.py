"""A file that one process at a time may use, such as the checkpoint of a stream."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hgorun.errors import ConfigError
from hgorun.files import FILE_MODE
from hgorun.process import unfinished


@contextmanager
def held_alone(path: Path) -> Iterator[None]:
    """Hold a file for this block alone: whoever else would hold it meanwhile, in this process or another, is refused.

    The lock is on a file beside it, .NAME.lock, for the file itself is replaced whenever it is written. The system lets
    go of it however the process ends. Where the system or the place has no such locks, nobody is refused.

    Raises
    ------
    ConfigError
        When it is held already.
    """
    target = Path(os.path.realpath(path))  # one file, by whichever name
    lock = target.with_name(f".{target.name}.lock")
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        handle = _locked(lock)
    except BlockingIOError:
        raise ConfigError(
            f"another process has it in use ({lock.name} is locked): end that process, or name another file",
            file=str(path),
        ) from None
    except (ImportError, OSError):
        yield
        return
    unfinished.add(lock)
    try:
        yield
    finally:
        lock.unlink(missing_ok=True)  # while it is held: nobody else's is removed
        os.close(handle)
        unfinished.discard(lock)


def _locked(lock: Path) -> int:
    """The handle of a file that is locked.

    Raises
    ------
    BlockingIOError
        When somebody else has locked it.
    OSError, ImportError
        When it cannot be made or locked, or the system has no such locks.
    """
    import fcntl

    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, FILE_MODE)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(handle).st_nlink:  # else it is that of somebody who has removed it meanwhile
                return handle
        except OSError:
            os.close(handle)
            raise
        os.close(handle)
