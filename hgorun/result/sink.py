"""Where HDF5 writes: a file whose failures are ours to report."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import h5py

from hgorun.files import written_whole

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class Sink(io.FileIO):
    """A file for HDF5, which crashes where a write fails: it never sees one fail, and we say what happened."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self.failed: OSError | None = None

    def write(self, data: ReadableBuffer) -> int:
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left and self.failed is None:
                left = left[super().write(left) or 0 :]
        except OSError as error:
            self.failed = error
        return size

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size) if self.failed is None else size or 0
        except OSError as error:
            self.failed = error
            return size or 0


@contextmanager
def hdf5_written_whole(
    path: Path, libver: tuple[str, str] | None = None, *, kept: int | None = None
) -> Iterator[h5py.File]:
    """An HDF5 file that is written whole or not at all.

    Parameters
    ----------
    path : Path
    libver : (str, str), optional
        The form of the file.
    kept : int, optional
        Bytes of each data set that HDF5 keeps in memory, where its own default is too much.

    Raises
    ------
    HgorunError
        When the file cannot be written, whatever HDF5 has said of it: it may read again what has not been written.
    """
    with written_whole(path) as part, Sink(part) as sink:
        try:
            with h5py.File(sink, "w", track_order=True, libver=libver, rdcc_nbytes=kept) as file:
                yield file
        except Exception:
            if sink.failed is None:
                raise
        if sink.failed is not None:
            raise sink.failed
