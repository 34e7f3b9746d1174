"""Blocks as files in a folder: what their names say, and their bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hgorun.errors import ConfigError, HgorunError

_TOGETHER = 64  # blocks, or
_BYTES = 2**24  # of them, that are read by one process


class Damaged(HgorunError):
    """A block's file does not have the bytes that it was written with.

    Attributes
    ----------
    path : Path
    """

    exit_code = 2

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path}: the block is damaged; run the sweep again to make it anew")
        self.path = path


@dataclass(frozen=True)
class Stored:
    """A block's file: the members from ``start`` to before ``stop``, and the hash of its bytes."""

    start: int
    stop: int
    digest: str
    path: Path


def together(blocks: Iterable[Stored]) -> Iterator[list[Stored]]:
    """As many blocks at a time as are read by one process."""
    size, waiting = 0, list[Stored]()
    for one in blocks:
        waiting.append(one)
        size += one.path.stat().st_size if one.path.is_file() else 0
        if len(waiting) == _TOGETHER or size > _BYTES:
            yield waiting
            size, waiting = 0, []
    if waiting:
        yield waiting


def digest(data: bytes) -> str:
    """The hash of a block's bytes, as its name has it."""
    return hashlib.sha256(data).hexdigest()[:32]


def content(one: Stored) -> bytes:
    """The bytes of a block's file.

    Raises
    ------
    Damaged
        When they are not those that were written, or it is gone.
    ConfigError
        When it cannot be read.
    """
    try:
        data = one.path.read_bytes()
    except FileNotFoundError:
        raise Damaged(one.path) from None
    except OSError as error:
        raise ConfigError(f"the block cannot be read: {error.strerror}", file=str(one.path)) from None
    if digest(data) != one.digest:
        raise Damaged(one.path)
    return data
