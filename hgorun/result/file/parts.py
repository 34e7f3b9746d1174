"""A result file whose trajectories are written part by part, while the run goes on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import h5py
import numpy as np

from hgorun.native.rows import copied
from hgorun.result.file.writing import form, write
from hgorun.result.hdf5.growing import Background, Constant, Growing
from hgorun.result.hdf5.sink import hdf5_and_sink
from hgorun.result.hdf5.writer import Writer
from hgorun.result.records.data import Measurements, ResultData


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Trajectories:
    """Some points of the trajectories of a result, see :class:`~hgorun.result.records.data.ResultData`.

    Attributes
    ----------
    time, x, u, y : ndarray, shapes (N,), (N, n), (N, m), (N, q)
    measured : Measurements or None
        Of these points, where outputs are measured continuously.
    xhat : mapping of str to ndarray, shape (N, n)
    internal : mapping of str to mapping of str to ndarray, shape (N, ...)
    """

    time: np.ndarray
    x: np.ndarray
    u: np.ndarray
    y: np.ndarray
    measured: Measurements | None
    xhat: Mapping[str, np.ndarray]
    internal: Mapping[str, Mapping[str, np.ndarray]]

    def along_time(self, numbers: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """All of them, with the paths of their data sets.

        Parameters
        ----------
        numbers : ndarray of int, shape (N,)
            Of the points.
        """
        yield "time", self.time
        yield "plant/x", self.x
        if self.u.shape[1]:
            yield "plant/u", self.u
        yield "plant/y", self.y
        if self.measured is not None:
            yield "measurement/number", numbers
            yield "measurement/time", self.measured.time
            yield "measurement/taken", self.measured.taken
            yield "measurement/y", self.measured.y
        for label, xhat in self.xhat.items():
            yield f"observers/{label}/xhat", xhat
            for name, values in self.internal[label].items():
                yield f"observers/{label}/state/{name}", values


class ResultInParts(AbstractContextManager["ResultInParts"]):
    """A result file that is written whole or not at all, though never in memory as a whole.

    Parameters
    ----------
    path : Path
    observers : int
        How many there will be.

    Raises
    ------
    HgorunError
        When the file cannot be written.
    """

    def __init__(self, path: Path, observers: int) -> None:
        self._path, self._form = path, form(observers)
        self._open = ExitStack()
        self._growing: dict[str, Growing | Constant] = {}
        self._same: dict[str, str] = {}

    def __enter__(self) -> ResultInParts:
        with ExitStack() as opened:
            self._file, sink = opened.enter_context(hdf5_and_sink(self._path, self._form))
            self._background = opened.enter_context(Background(sink))
            self._open = opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        return self._open.__exit__(kind, error, trace)

    def append(self, path: str, rows: np.ndarray, total: int, *, lasting: bool = False) -> None:
        """The next rows of a data set that will have so many in ``total``.

        Parameters
        ----------
        path : str
        rows : ndarray
        total : int
        lasting : bool
            Whether they stay what they are; others are copied.
        """
        if path not in self._growing:
            group, _, name = path.rpartition("/")
            self._growing[path] = Growing(self._group(group), name, total, rows, self._background)
        growing = self._growing[path]
        assert isinstance(growing, Growing)
        growing.append(rows if lasting else copied(rows))

    def constant(self, path: str, shape: tuple[int, ...], value: np.generic) -> None:
        """A data set of one number."""
        group, _, name = path.rpartition("/")
        self._growing[path] = Constant(self._group(group), name, shape, value, self._background)

    def same(self, path: str, other: str) -> None:
        """A data set that is the other one, under a second name: it takes no room, and has its attributes."""
        self._same[path] = other

    def _group(self, path: str) -> h5py.Group:
        folder: h5py.Group = self._file
        for one in path.split("/") if path else ():
            folder = folder[one] if one in folder else folder.create_group(one, track_order=True)
        return folder

    def whole(self, path: str) -> Growing:
        """A data set that has all its rows, to be read in parts."""
        growing = self._growing[path]
        assert isinstance(growing, Growing)
        growing.finished()
        return growing

    def finish(self, result: ResultData) -> None:
        """Everything else.

        Parameters
        ----------
        result : ResultData
            Without points.
        """
        write(result, Writer(self._file, self._growing, self._same))
