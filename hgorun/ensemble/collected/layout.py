"""The data sets of a collected file: netCDF-4, without time stamps, written piece by piece."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import chain
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Trajectories, as_text
from hgorun.ensemble.collected.rows import rectangles
from hgorun.result.hdf5 import digests

MEMBER = "member"
_TEXT = h5py.string_dtype()


@dataclass(eq=False)
class Column:
    """A data set with a value, or an array of them, for every member.

    Attributes
    ----------
    data : h5py.Dataset
    axes : int
        Dimensions along which members lie.
    """

    data: h5py.Dataset
    axes: int
    _digest: Any = field(default_factory=sha256)
    _begun: bool = False

    def write(self, start: int, values: NDArray[Any]) -> None:
        """Write the values of further members.

        Parameters
        ----------
        start : int
            The number of the first one, which is that behind the last one written.
        values : ndarray, shape (members, ...)
        """
        if self.data.dtype.kind == "O":
            texts = [as_text(value) for value in values.ravel().tolist()]
            self._digest.update(("\n" * self._begun + "\n".join(texts)).encode())  # as digests.of_names has it
            self._begun = True
            if not any(texts):  # what is not written is empty
                return
            values = np.array(texts, dtype=object).reshape(values.shape)
        else:
            values = np.ascontiguousarray(values, dtype=self.data.dtype)
            self._digest.update(values.data if values.size else b"")
        for place, first, last in rectangles(self.data.shape[: self.axes], start, start + len(values)):
            shape = tuple(one.stop - one.start for one in place)
            self.data[place] = values[first - start : last - start].reshape(*shape, *values.shape[1:])

    def close(self) -> None:
        """Say what the digest of everything written is."""
        self.data.attrs[digests.ATTRIBUTE] = self._digest.hexdigest()


class Layout:
    """A file with its dimensions.

    Parameters
    ----------
    file : h5py.File
    members : mapping of str to int
        Names and sizes of the dimensions along which members lie.
    coordinates : str, optional
        Names of coordinates that are no dimensions.
    """

    def __init__(self, file: h5py.File, members: Mapping[str, int], coordinates: str | None) -> None:
        self._file, self._members, self._coordinates = file, members, coordinates

    def scale(self, name: str, size: int, values: Iterable[NDArray[Any]], **attributes: str) -> None:
        """A dimension with its coordinate, which comes in pieces."""
        pieces = iter(values)
        first = next(pieces)
        data = self._file.create_dataset(name, (size,), _kind(first.dtype), track_times=False)
        data.attrs.update(attributes)
        column, at = Column(data, 1), 0
        for piece in chain([first], pieces):
            column.write(at, piece)
            at += len(piece)
        column.close()
        data.make_scale(name)

    def names(self, name: str, words: tuple[str, ...]) -> None:
        """A dimension whose coordinate is a list of names."""
        self.scale(name, len(words), [np.array(words, dtype=object)])

    def fixed(self, name: str, values: NDArray[Any], dimensions: tuple[str, ...], **attributes: str) -> None:
        """Something that is the same for all members."""
        data = self._made(name, values.shape, values.dtype, dimensions, attributes)
        column = Column(data, 1)
        column.write(0, values)
        column.close()

    def column(self, name: str, kind: Any, inner: tuple[str, ...], **attributes: Any) -> Column:
        """Something with a value for every member, still to be written.

        Parameters
        ----------
        inner : tuple of str
            Dimensions of the value of one member.
        """
        shape = (*self._members.values(), *(self._file[one].shape[0] for one in inner))
        if self._coordinates is not None and name not in self._coordinates.split():
            attributes["coordinates"] = self._coordinates
        return Column(self._made(name, shape, kind, (*self._members, *inner), attributes), len(self._members))

    def trajectories(self, count: int, time: NDArray[np.float64]) -> Group:
        """The group of the trajectories, of so many members."""
        base = "trajectories/"
        self._file.create_group("trajectories", track_order=True)
        member = self._file.create_dataset(f"{base}member", (count,), np.int64, track_times=False)
        member.make_scale("member")
        self.scale(f"{base}time", time.size, [time])
        n, m = self._file["state"].shape[0], self._file["observer"].shape[0]
        x = self._made(f"{base}x", (count, time.size, n), float, (f"{base}member", f"{base}time", "state"), {})
        inner = (f"{base}member", "observer", f"{base}time", "state")
        xhat = self._made(f"{base}xhat", (count, m, time.size, n), float, inner, {})
        return Group(Column(member, 1), Column(x, 1), Column(xhat, 1), count)

    def _made(
        self, name: str, shape: tuple[int, ...], kind: Any, dimensions: tuple[str, ...], attributes: Mapping[str, Any]
    ) -> h5py.Dataset:
        data = self._file.create_dataset(name, shape, _kind(np.dtype(kind)), track_times=False)
        for axis, dimension in enumerate(dimensions):
            data.dims[axis].attach_scale(self._file[dimension])
        data.attrs.update({key: value for key, value in attributes.items() if value is not None})
        return data


@dataclass(frozen=True, eq=False)
class Group:
    """The trajectories in a file."""

    member: Column
    x: Column
    xhat: Column
    count: int

    def write(self, start: int, found: Trajectories) -> None:
        """Write the trajectories of further members, from a place on."""
        columns = ((self.member, found.member), (self.x, found.x), (self.xhat, found.xhat))
        for column, values in columns:
            column.write(start, values)
            if start + len(found.member) == self.count:
                column.close()


def _kind(dtype: np.dtype[Any]) -> Any:
    """The type of a data set: netCDF knows no truth values, and texts of any length are objects here."""
    return _TEXT if dtype.kind in "Ob" else dtype.newbyteorder("<")
