"""Data sets of a result file, each with its digest and its named dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from hgorun.result.hdf5 import digests
from hgorun.result.hdf5.growing import Constant, Growing

_CHUNK = 2**20


class Writer:
    """Data sets without time stamps, each with its dimensions named.

    Parameters
    ----------
    file : h5py.File
    growing : mapping of str to Growing or Constant, optional
        By path, data sets whose rows have come already, in place of what is given for them.
    same : mapping of str to str, optional
        By path, the data set before whose second name it is, in place of what is given for it.
    """

    def __init__(
        self,
        file: h5py.File,
        growing: Mapping[str, Growing | Constant] | None = None,
        same: Mapping[str, str] | None = None,
    ) -> None:
        self.file, self._growing, self._same = file, growing or {}, same or {}
        # kept, since h5py needs as long to find one as to write it
        self._groups: dict[str, h5py.Group] = {"": file}
        self._scales: dict[str, h5py.Dataset] = {}

    def group(self, path: str) -> h5py.Group:
        if path not in self._groups:
            there = path in self.file
            self._groups[path] = self.file[path] if there else self.file.create_group(path, track_order=True)
        return self._groups[path]

    def data(self, path: str, values: Any, dimensions: tuple[str, ...] = (), **attributes: Any) -> h5py.Dataset:
        parent, _, name = path.rpartition("/")
        group = self.group(parent)
        if path in self._same:
            group[name] = self.file[self._same[path]]  # a hard link; what is said of it stands there already
            return group[name]
        array = np.asarray(values)
        if path in self._growing:
            data = self._growing[path].finished()
        elif array.dtype.kind == "O":
            data = group.create_dataset(name, data=values, track_times=False)
            data.attrs[digests.ATTRIBUTE] = digests.of_names([str(name) for name in array])
        else:
            data = group.create_dataset(name, data=array, track_times=False, **_layout(array.shape, array.dtype))
            data.attrs[digests.ATTRIBUTE] = digests.of_numbers(array)
        for axis, dimension in enumerate(dimensions):
            data.dims[axis].attach_scale(self._scales[dimension])
        for key, value in attributes.items():
            if value is not None:
                data.attrs[key] = value
        return data

    def scale(self, path: str, values: Any, **attributes: Any) -> None:
        data = self.data(path, values, **attributes)
        if path not in self._same:
            data.make_scale(path.rpartition("/")[2])
        self._scales[path] = data

    def index(self, data: h5py.Dataset, axis: int, size: int) -> None:
        """A dimension without coordinates: netCDF wants every axis to have one, and those of one length share it."""
        dimension = f"index_{size}"
        if dimension not in self._scales:
            self.scale(dimension, np.arange(1, size + 1))
        data.dims[axis].attach_scale(self._scales[dimension])

    def names(self, path: str, names: tuple[str, ...]) -> None:
        """A dimension whose coordinate is a list of names."""
        if names:
            self.scale(path, np.array(names, dtype=object).astype(h5py.string_dtype()))


def _layout(shape: tuple[int, ...], dtype: np.dtype[Any]) -> dict[str, Any]:
    """Checksums in the file, which HDF5 keeps for each chunk: whole rows, of about a MiB."""
    if not shape or 0 in shape:
        return {}
    of_a_row = int(np.prod(shape[1:], dtype=int)) * dtype.itemsize
    return {"fletcher32": True, "chunks": (max(1, min(shape[0], _CHUNK // of_a_row)), *shape[1:])}


def units_in(units: Mapping[str, str], names: tuple[str, ...]) -> str | None:
    """The attribute of a data set with these columns: their one unit, or one after the other; None where none is known.

    Parameters
    ----------
    units : mapping of str to str
        By name.
    names : tuple of str
        Of the columns.
    """
    each = [units.get(name, "") for name in names]
    if not any(each):
        return None
    return each[0] if len(set(each)) == 1 else "; ".join(each)


def labels_of(names: tuple[str, ...]) -> Any:
    return np.array(names, dtype=object).astype(h5py.string_dtype()) if names else None
