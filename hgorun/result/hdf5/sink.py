"""Where HDF5 writes: a file whose failures are ours to report."""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EDQUOT, EFBIG, ENOSPC
from pathlib import Path
from typing import TYPE_CHECKING

import h5py

from hgorun.files import written_whole
from hgorun.result.hdf5.written_at import write_at

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer


_KEPT = 1 << 16  # bytes: what HDF5 reads again is its own lists of what there is, in pieces no longer than that


class Sink(io.FileIO):
    """A file for HDF5, which crashes where a write fails: it never sees one fail, and we say what happened.

    It crashes as well where it reads something else than what it has written, so that this is kept from then on.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self.failed: OSError | None = None
        self._unwritten: dict[int, bytes] = {}  # by place
        self._reserved = False
        self._turn = threading.Lock()

    def write(self, data: ReadableBuffer) -> int:
        left = whole = memoryview(data).cast("B")
        place = self.tell()
        try:
            while left and self.failed is None:
                left = left[self.put(left) :]
        except OSError as error:
            self.failed = error
        if left and len(whole) <= _KEPT:
            self._unwritten[place] = bytes(whole)
        return len(whole)

    def put(self, data: memoryview) -> int:
        """Write bytes: how many of them there was room for."""
        return super().write(data) or 0

    def readinto(self, room: WriteableBuffer) -> int:
        """What HDF5 reads again; zeros where that is lost."""
        whole = memoryview(room).cast("B")
        start, done = self.tell(), super().readinto(room) or 0
        if self.failed is None:
            return done
        end = start + len(whole)
        whole[done:] = bytes(len(whole) - done)
        for place, piece in self._unwritten.items():
            first, last = max(place, start), min(place + len(piece), end)
            if first < last:
                whole[first - start : last - start] = piece[first - place : last - place]
        return len(whole)

    def write_at(self, place: int, data: memoryview) -> None:
        """Write bytes at a place, beside what HDF5 writes at others.

        One thread at a time: a file system lets others wait, and that is done by trying again and again, where the
        processor has other work.
        """
        left = data.cast("B")
        with self._turn:
            while left and self.failed is None:
                try:
                    done = write_at(self.fileno(), left, place)
                except OSError as error:
                    self.failed = error
                    return
                left, place = left[done:], place + done

    def read_at(self, place: int, room: memoryview) -> None:
        """Read what was written at a place."""
        left = room.cast("B")
        while left and self.failed is None:
            try:
                done = os.preadv(self.fileno(), [left], place)
                if not done:
                    raise EOFError(f"the file ends at byte {place}")
            except OSError as error:
                self.failed = error
                return
            left, place = left[done:], place + done

    def reserve(self, place: int, size: int) -> None:
        """Take the room for bytes that will come: a disk that is too small says so at once, and the file ends sooner.

        Without it file systems choose the place of gigabytes when the file gets its name, and that waits for the disk.
        """
        if size and self.failed is None and hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self.fileno(), place, size)
                self._reserved = True
            except OSError as error:
                if error.errno in (ENOSPC, EFBIG, EDQUOT):  # others: this file system cannot
                    self.failed = error

    def settle(self) -> None:
        """Take the room for what HDF5 has written itself, where room was reserved for the rest.

        A file system that has still to choose the place of a few bytes sends the whole file to the disk when it is
        closed or gets its name, and waits for that: a gigabyte takes seconds.
        """
        if self._reserved:
            self.reserve(0, os.fstat(self.fileno()).st_size)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size) if self.failed is None else size or 0
        except OSError as error:
            self.failed = error
            return size or 0


@contextmanager
def hdf5_and_sink(path: Path, libver: tuple[str, str] | None = None) -> Iterator[tuple[h5py.File, Sink]]:
    """An HDF5 file that is written whole or not at all, and what it is written to.

    Parameters
    ----------
    path : Path
    libver : (str, str), optional
        The form of the file.

    Raises
    ------
    HgorunError
        When the file cannot be written, whatever HDF5 has said of it: it may read again what has not been written.
    """
    with written_whole(path) as part, Sink(part) as sink:
        try:
            with h5py.File(sink, "w", track_order=True, libver=libver) as file:
                yield file, sink
            sink.settle()
        except Exception:
            if sink.failed is None:
                raise
        if sink.failed is not None:
            raise sink.failed


@contextmanager
def hdf5_written_whole(path: Path, libver: tuple[str, str] | None = None) -> Iterator[h5py.File]:
    """The file of :func:`hdf5_and_sink`."""
    with hdf5_and_sink(path, libver) as (file, _):
        yield file
