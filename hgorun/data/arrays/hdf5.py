"""Columns of HDF5 and netCDF-4 files, result files of our own among them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from hgorun.config.data import MISSING
from hgorun.data.arrays.arrays import ArrayColumn
from hgorun.data.arrays.matlab import is_across, is_logical, is_of_matlab, no_column
from hgorun.data.arrays.netcdf import absent_texts, text, unpacked
from hgorun.data.arrays.unwritten import unwritten
from hgorun.errors import ConfigError, printable

_DEEP = 5  # groups inside each other
_MANY = 10_000
_SHOWN = 8  # names of a record that a message writes


class Hdf5:
    """A column is a data set of one dimension, named by its path, or a labelled column of one of two dimensions.

    In result files these are ``measurement/y/x1``, ``plant/x/x2`` and the like; of MATLAB vectors, and columns of
    matrices and of the fields of structs.
    """

    def catalogue(self, path: Path) -> Mapping[str, ArrayColumn]:
        """The columns."""
        with h5py.File(path, "r") as file:
            return {name: _described(data, place) for name, data, place in _columns(file, path)}

    def columns(self, path: Path, names: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Numbers or texts."""
        with h5py.File(path, "r") as file:
            found = {name: (data, place) for name, data, place in _columns(file, path)}
            return {name: _values(*found[name], path, name) for name in names}

    def passed_over(self, path: Path, name: str) -> str:
        """Links, values elsewhere, and what holds other things or has other dimensions."""
        with h5py.File(path, "r") as file:
            return _passed_over(file, name)

    def zoned(self, path: Path, name: str) -> bool:
        """Dates are texts there."""
        return False


def _columns(
    group: h5py.Group, path: Path, above: str = "", depth: int = 0
) -> Iterator[tuple[str, h5py.Dataset, int | None]]:
    """Names, data sets, and which column of two dimensions is meant; what is a link could lead anywhere."""
    if len(group) > _MANY or depth > _DEEP:
        raise ConfigError("more groups and data sets than a log has", file=str(path))
    for name in group:
        if not isinstance(name, str) or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue  # a name that is no text cannot be asked for
        member = group[name]
        if no_column(member, name):
            continue
        here = f"{above}{name}"
        if isinstance(member, h5py.Group):
            yield from _columns(member, path, f"{here}/", depth + 1)
        elif isinstance(member, h5py.Dataset) and not member.is_virtual and not member.external:
            yield from ((f"{here}{label}", member, place) for label, place in _parts(member))


def _parts(data: h5py.Dataset) -> Iterator[tuple[str, int | None]]:
    if data.dtype.kind not in "fiub" and h5py.check_string_dtype(data.dtype) is None:
        return
    if data.ndim == 1:
        yield "", None
    elif data.ndim == 2 and is_of_matlab(data):
        yield from (
            (("", 0),) if 1 in data.shape else ((f"/{place}", place) for place in range(min(data.shape[0], _MANY)))
        )
    elif data.ndim == 2 and data.shape[1] <= _MANY:
        labels = data.attrs.get("labels")
        texts = list(labels) if isinstance(labels, np.ndarray) and labels.shape == data.shape[1:] else []
        texts = texts if len(set(texts)) == len(texts) else []
        for place in range(data.shape[1]):
            yield f"/{texts[place] if texts and isinstance(texts[place], str) else place}", place


def _passed_over(group: h5py.Group, name: str) -> str:
    above, _, last = name.strip("/").rpartition("/")
    for part in above.split("/") if above else ():
        if not part or not isinstance(group.get(part, getlink=True), h5py.HardLink):
            return ""
        group = group[part]
        if why := no_column(group, part):
            return f"in {part}, which {why}"
        if not isinstance(group, h5py.Group):
            records = isinstance(group, h5py.Dataset) and group.dtype.names
            said = f"in records of {part}, which are not taken apart: write each of {{}} as a data set of its own"
            return said.format(", ".join(records[:_SHOWN])) if records else ""
    link = group.get(last, getlink=True) if last else None
    if link is not None and not isinstance(link, h5py.HardLink):
        return "is a link, which is not followed"
    data = None if link is None else group[last]
    if data is not None and (why := no_column(data, last)):
        return why
    if not isinstance(data, h5py.Dataset):
        return ""
    if data.is_virtual or data.external:
        return "has its values in other files, which are not opened"
    if not data.shape:
        return "is empty" if data.shape is None else "is a single value"
    if data.ndim > 2:
        return f"has {data.ndim} dimensions, and a column has one"
    if data.dtype.names:
        names = ", ".join(data.dtype.names[:_SHOWN])
        return f"holds records, which are not taken apart: write each of {names} as a data set of its own"
    return "" if any(_parts(data)) else f"holds neither numbers nor texts ({data.dtype.name})"


def _described(data: h5py.Dataset, place: int | None) -> ArrayColumn:
    unit = data.attrs.get("units", "")
    if place is not None and isinstance(unit, np.ndarray) and unit.shape == data.shape[1:]:
        unit = unit[place]
    else:
        unit = text(data.attrs, "units")
    if place is not None and isinstance(unit, str) and unit.count(";") == data.shape[1] - 1:
        unit = unit.split(";")[place].strip()  # those of several columns, as in results
    sample = "" if data.dtype.kind in "fiub" else _first_text(data, place)
    rows = data.shape[1 if place is not None and is_across(data) else 0]
    return ArrayColumn(int(rows), unit if isinstance(unit, str) else "", sample, text(data.attrs, "calendar"))


def _first_text(data: h5py.Dataset, place: int | None) -> str:
    """The first that is not missing."""
    texts = (str(value) for value in _texts(data, place, _MANY))
    return printable(next((found for found in texts if found.strip().lower() not in MISSING), ""))[:100]


def _values(data: h5py.Dataset, place: int | None, path: Path, name: str) -> np.ndarray:
    kind = data.dtype.kind
    if kind not in "fiub":
        return _texts(data, place)
    across = place is not None and is_across(data)
    where = slice(None) if place is None else (place, slice(None)) if across else (slice(None), place)
    stored = np.asarray(data[where])
    if kind == "b" or is_logical(data):
        return stored.astype(bool)
    try:
        values = unpacked(stored, data.attrs, data.fillvalue)
    except ValueError as error:
        raise ConfigError(str(error), file=str(path), key=name) from None
    gone = unwritten(data, stored, int(across), place)
    return np.where(gone, np.nan, values) if gone.any() else values


def _texts(data: h5py.Dataset, place: int | None, count: int | None = None) -> np.ndarray:
    texts, rows = data.asstr(), slice(count)
    found = np.asarray(texts[rows] if place is None else texts[rows, place], dtype=object)
    found[np.isin(found, list(absent_texts(data.attrs)))] = ""
    return found
