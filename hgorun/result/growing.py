"""Data sets whose rows come some at a time: threads take their digests and write them while the run goes on.

They are contiguous in the file, so what is written goes from the arrays to the file and not through HDF5, which would
copy it and hold up all other threads meanwhile. Their digests tell what was damaged, as those of other data sets do.
"""

from __future__ import annotations

import threading
from contextlib import AbstractContextManager
from functools import cache
from hashlib import sha256
from queue import Queue
from types import TracebackType

import h5py
import numpy as np

from hgorun.result import digests
from hgorun.result.sink import Sink

_PIECE = 1 << 16
_THREADS = 2
_WAITING = 4  # pieces that may wait for each thread: they are memory


class Growing:
    """A data set that is given its rows some at a time.

    Parameters
    ----------
    group : h5py.Group
    name : str
    rows : int
        How many there will be.
    like : ndarray
        Some of them.
    background : Background
        What writes them.
    """

    def __init__(self, group: h5py.Group, name: str, rows: int, like: np.ndarray, background: Background) -> None:
        self._data = _contiguous(group, name, (rows, *like.shape[1:]), like.dtype)
        self._place: int = self._data.id.get_offset() or 0
        background.sink.reserve(self._place, self._data.id.get_storage_size())
        self._background, self._lane, self._digest = background, background.lane(), sha256()
        self._like, self._rows, self._given, self._passed = like[:0], rows, 0, 0

    def append(self, rows: np.ndarray) -> None:
        """Take the next rows, which are not to change any more."""
        self._given += len(rows)
        if rows.size:
            self._background.put(self, rows, self._lane)

    def write(self, rows: np.ndarray) -> None:
        """Write the next rows, in the thread that does so."""
        content = digests.little(rows).data
        self._digest.update(content)
        self._background.sink.write_at(self._place + self._passed, content)
        self._passed += content.nbytes

    def read(self, first: int, stop: int) -> np.ndarray:
        """Some of the rows that have been written, after :meth:`finished`."""
        shape, kind = self._like.shape[1:], self._like.dtype
        found = np.empty((stop - first, *shape), dtype=kind.newbyteorder("<"))
        if found.size:
            self._background.sink.read_at(self._place + first * found[:1].nbytes, found.data)
        return found.astype(kind, copy=False)

    def finished(self) -> h5py.Dataset:
        """The data set, with all that has come and its digest."""
        self._background.wait()
        assert self._given == self._rows
        self._data.attrs[digests.ATTRIBUTE] = self._digest.hexdigest()
        return self._data


class Constant:
    """A data set of one number, which takes no room.

    Parameters
    ----------
    group : h5py.Group
    name : str
    shape : tuple of int
    value : numpy scalar
    """

    def __init__(self, group: h5py.Group, name: str, shape: tuple[int, ...], value: np.generic) -> None:
        chunks = tuple(max(1, min(size, _PIECE)) for size in shape)
        self._data = group.create_dataset(
            name, shape=shape, dtype=value.dtype, chunks=chunks, fillvalue=value, track_times=False
        )
        self._value = value

    def finished(self) -> h5py.Dataset:
        """The data set with its digest."""
        self._data.attrs[digests.ATTRIBUTE] = _of_constant(self._data.size, self._value.tobytes())
        return self._data


@cache
def _of_constant(count: int, value: bytes) -> str:
    """The digest of a number so many times."""
    found, piece = sha256(), value * _PIECE
    for _ in range(count // _PIECE):
        found.update(piece)
    found.update(value * (count % _PIECE))
    return found.hexdigest()


class Background(AbstractContextManager["Background"]):
    """Threads that write, each what it is given in that order.

    Parameters
    ----------
    sink : Sink
        Where to.
    """

    def __init__(self, sink: Sink) -> None:
        self.sink = sink
        self._queues = [Queue[tuple[Growing, np.ndarray] | None](_WAITING) for _ in range(_THREADS)]
        self._lanes = 0
        self._error: Exception | None = None
        self._threads = [
            threading.Thread(target=self._work, args=(queue,), name="writing a result", daemon=True)
            for queue in self._queues
        ]

    def __enter__(self) -> Background:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._error = self._error or RuntimeError("nothing more is written")  # what still waits is left out
        for queue, thread in zip(self._queues, self._threads, strict=True):
            queue.put(None)
            thread.join()

    def lane(self) -> int:
        """Which thread writes the next data set: each of them in turn."""
        self._lanes += 1
        return self._lanes % _THREADS

    def put(self, growing: Growing, rows: np.ndarray, lane: int) -> None:
        """Let a thread write rows."""
        self._require()
        self._queues[lane].put((growing, rows))

    def wait(self) -> None:
        """Until all has been written."""
        for queue in self._queues:
            queue.join()
        self._require()

    def _require(self) -> None:
        if (error := self._error or self.sink.failed) is not None:
            raise error

    def _work(self, queue: Queue[tuple[Growing, np.ndarray] | None]) -> None:
        while (item := queue.get()) is not None:
            try:
                if self._error is None:
                    growing, rows = item
                    growing.write(rows)
            except Exception as error:
                self._error = error
            finally:
                queue.task_done()


def _contiguous(group: h5py.Group, name: str, shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> h5py.Dataset:
    """A data set that has its place in the file at once, and nothing in it."""
    said = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    said.set_layout(h5py.h5d.CONTIGUOUS)
    said.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    said.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    said.set_obj_track_times(False)
    kind = h5py.h5t.py_create(dtype.newbyteorder("<"), logical=True)
    return h5py.Dataset(h5py.h5d.create(group.id, name.encode(), kind, h5py.h5s.create_simple(shape), dcpl=said))
