"""Columns of HDF5 and netCDF-4 files, result files of our own among them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from hgorun.config.data import MISSING
from hgorun.data.arrays import ArrayColumn
from hgorun.errors import ConfigError, printable

_DEEP = 5  # groups inside each other
_MANY = 10_000


class Hdf5:
    """A column is a data set of one dimension, named by its path, or a labelled column of one of two dimensions.

    In result files these are ``measurement/y/x1``, ``plant/x/x2`` and the like.
    """

    def catalogue(self, path: Path) -> Mapping[str, ArrayColumn]:
        """The columns."""
        with h5py.File(path, "r") as file:
            return {name: _described(data, place) for name, data, place in _columns(file, path)}

    def columns(self, path: Path, names: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Numbers or texts."""
        with h5py.File(path, "r") as file:
            found = {name: (data, place) for name, data, place in _columns(file, path)}
            return {name: _values(*found[name]) for name in names}

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
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member = group[name]
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
    elif data.ndim == 2 and data.shape[1] <= _MANY:
        labels = data.attrs.get("labels")
        texts = list(labels) if isinstance(labels, np.ndarray) and labels.shape == data.shape[1:] else []
        for place in range(data.shape[1]):
            yield f"/{texts[place] if texts and isinstance(texts[place], str) else place}", place


def _described(data: h5py.Dataset, place: int | None) -> ArrayColumn:
    unit = data.attrs.get("units", "")
    if place is not None and isinstance(unit, str) and unit.count(";") == data.shape[1] - 1:
        unit = unit.split(";")[place].strip()  # those of several columns, as in results
    if place is not None and isinstance(unit, np.ndarray) and unit.shape == data.shape[1:]:
        unit = unit[place]
    texts = (str(value) for value in _values(data, place, 1 if data.dtype.kind in "fiub" else _MANY))
    sample = printable(next((text for text in texts if text.strip().lower() not in MISSING), ""))[:100]
    return ArrayColumn(int(data.shape[0]), unit if isinstance(unit, str) else "", sample)


def _values(data: h5py.Dataset, place: int | None, count: int | None = None) -> np.ndarray:
    rows = slice(count)
    if data.dtype.kind in "fiub":
        return _unpacked(np.asarray(data[rows] if place is None else data[rows, place]), data.attrs)
    texts = data.asstr()
    return np.asarray(texts[rows] if place is None else texts[rows, place], dtype=object)


def _unpacked(stored: np.ndarray, attributes: Mapping[str, object]) -> np.ndarray:
    """The values that stored ones stand for in netCDF: NaN where one is missing, else scaled."""
    absent = [_number(attributes, name) for name in ("_FillValue", "missing_value")]
    scale, offset = _number(attributes, "scale_factor"), _number(attributes, "add_offset")
    if scale is None and offset is None and not any(np.any(stored == one) for one in absent if one is not None):
        return stored
    values = stored.astype(float)
    for one in absent:
        if one is not None:
            values[stored == one] = np.nan
    return values * (1.0 if scale is None else scale) + (0.0 if offset is None else offset)


def _number(attributes: Mapping[str, object], name: str) -> float | None:
    """An attribute that is a number; None where there is none."""
    value = np.asarray(attributes.get(name))
    return float(value.ravel()[0]) if value.size == 1 and value.dtype.kind in "fiu" else None
