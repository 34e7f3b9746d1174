"""Files that a command reads: configurations, recordings, the result that is made again. None is replaced."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_read: set[Path] = set()
_noting: list[bool] = []  # one entry for every command that runs


@contextmanager
def kept_as_they_are() -> Iterator[None]:
    """While this lasts, files that are read are noted, and are not to be replaced.

    Whoever calls from Python may replace what was read before, but for recordings: they know which files are in use.
    """
    _noting.append(True)
    try:
        yield
    finally:
        _noting.pop()
        if not _noting:
            _read.clear()


def note_originals(paths: Iterable[Path]) -> None:
    """Note files that are read, or will be, if a command runs."""
    if _noting:
        _read.update(path.absolute() for path in paths)


def is_original(path: Path) -> bool:
    """Whether a path leads to a file that has been noted, by whichever name: that of a link, or in other letters."""
    for original in tuple(_read):
        with suppress(OSError, ValueError):  # one of them is not there; a NUL in a name
            if os.path.samefile(original, path):
                return True
    return False
