"""Data sets whose rows come some at a time: threads take their digests and write them while the run goes on.

They are contiguous in the file, so what is written goes from the arrays to the file and not through HDF5, which would
copy it and hold up all other threads meanwhile. Their digests tell what was damaged, as those of other data sets do.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache, lru_cache, partial
from hashlib import sha256
from queue import Queue
from types import TracebackType

import h5py
import numpy as np

from hgorun.native.rows import all_are
from hgorun.result.hdf5 import digests
from hgorun.result.hdf5.sink import Sink

_PIECE = 1 << 16
_THREADS = 2
_WAITING = 4  # pieces that may wait for each thread: they are memory


class Growing:
    """A data set that is given its rows some at a time.

    As long as all its numbers are the same it takes no room: it is a :class:`Constant` if that is so to the end.

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
        self._group, self._name = group, name
        self._background, self._lane, self._digest = background, background.lane(), sha256()
        self._like, self._rows, self._given, self._passed = like[:0], rows, 0, 0
        self._value: np.generic | None = like.flat[0] if like.size else None  # of all rows so far
        self._data: h5py.Dataset | None = None
        self._place = 0

    def append(self, rows: np.ndarray) -> None:
        """Take the next rows, which are not to change any more."""
        if self._data is None and not self._goes_on(rows):
            self._take_room()
        if rows.size:
            same = self._data is None
            self._background.put(partial(self._take_same, rows.size) if same else partial(self._take, rows), self._lane)
        self._given += len(rows)

    def _goes_on(self, rows: np.ndarray) -> bool:
        """Whether rows have the one number of all before, bit by bit."""
        if self._value is None:
            return False
        if rows.size and rows[-1:].flat[-1].tobytes() != self._value.tobytes():  # which mostly tells already
            return False
        return all_are(rows, self._value)

    def _take_room(self) -> None:
        """From now on the rows differ; those before are written."""
        shape = (self._rows, *self._like.shape[1:])
        self._data = _contiguous(self._group, self._name, shape, self._like.dtype)
        self._place = self._data.id.get_offset() or 0
        self._background.sink.reserve(self._place, self._data.id.get_storage_size())
        for first in range(0, self._given, _PIECE):
            some = (min(_PIECE, self._given - first), *shape[1:])
            self._background.put(partial(self.write, np.broadcast_to(np.asarray(self._value), some)), self._lane)

    def _take_same(self, count: int) -> None:
        """Digest the one number so many times, in the thread that does so."""
        assert self._value is not None
        self._digest.update(_repeated(digests.little(np.asarray(self._value)).tobytes(), count))

    def _take(self, rows: np.ndarray) -> None:
        """Digest and write the next rows, in the thread that does so."""
        rows = digests.little(rows)
        self._digest.update(rows.data)
        self.write(rows)

    def write(self, rows: np.ndarray) -> None:
        """Write the next rows, in the thread that does so."""
        content = digests.little(rows).data
        self._background.sink.write_at(self._place + self._passed, content)
        self._passed += content.nbytes

    def read(self, first: int, stop: int) -> np.ndarray:
        """Some of the rows that have been written, after :meth:`finished`."""
        shape, kind = self._like.shape[1:], self._like.dtype
        if self._value is not None and not self._passed:
            return np.full((stop - first, *shape), self._value)
        found = np.empty((stop - first, *shape), dtype=kind.newbyteorder("<"))
        if found.size:
            self._background.sink.read_at(self._place + first * found[:1].nbytes, found.data)
        return found.astype(kind, copy=False)

    def finished(self) -> h5py.Dataset:
        """The data set, with all that has come and its digest."""
        self._background.wait()
        assert self._given == self._rows
        if self._data is None and self._value is None:
            self._take_room()
        if self._data is None:
            assert self._value is not None
            self._data = _of_one_number(self._group, self._name, (self._rows, *self._like.shape[1:]), self._value)
        if digests.ATTRIBUTE not in self._data.attrs:
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
    background : Background
        What takes its digest.
    """

    def __init__(
        self, group: h5py.Group, name: str, shape: tuple[int, ...], value: np.generic, background: Background
    ) -> None:
        self._data, self._value, self._background = _of_one_number(group, name, shape, value), value, background
        background.put(partial(_digest_of, self._data.size, value.tobytes()), background.lane())

    def finished(self) -> h5py.Dataset:
        """The data set with its digest."""
        self._background.wait()
        self._data.attrs[digests.ATTRIBUTE] = _digest_of(self._data.size, self._value.tobytes())
        return self._data


def _of_one_number(group: h5py.Group, name: str, shape: tuple[int, ...], value: np.generic) -> h5py.Dataset:
    chunks = tuple(max(1, min(size, _PIECE)) for size in shape)
    return group.create_dataset(name, shape=shape, dtype=value.dtype, chunks=chunks, fillvalue=value, track_times=False)


@cache
def _digest_of(count: int, value: bytes) -> str:
    """The digest of a number so many times."""
    found, piece = sha256(), value * _PIECE
    for _ in range(count // _PIECE):
        found.update(piece)
    found.update(value * (count % _PIECE))
    return found.hexdigest()


@lru_cache(4)
def _repeated(value: bytes, count: int) -> bytes:
    """A number so many times: the rows that come are mostly as many as before."""
    return value * count


class Background(AbstractContextManager["Background"]):
    """Threads that write, each what it is given in that order.

    Parameters
    ----------
    sink : Sink
        Where to.
    """

    def __init__(self, sink: Sink) -> None:
        self.sink = sink
        self._queues = [Queue[Callable[[], object] | None](_WAITING) for _ in range(_THREADS)]
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

    def put(self, work: Callable[[], object], lane: int) -> None:
        """Let a thread do some work."""
        self._require()
        self._queues[lane].put(work)

    def wait(self) -> None:
        """Until all has been written."""
        for queue in self._queues:
            queue.join()
        self._require()

    def _require(self) -> None:
        if (error := self._error or self.sink.failed) is not None:
            raise error

    def _work(self, queue: Queue[Callable[[], object] | None]) -> None:
        while (work := queue.get()) is not None:
            try:
                if self._error is None:
                    work()
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
