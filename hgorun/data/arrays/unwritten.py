"""Which cells of a data set of HDF5 were never written, and read as its fill value."""

from __future__ import annotations

import h5py
import numpy as np

_BYTE = 1  # whose fill value in netCDF is a number as any other


def unwritten(data: h5py.Dataset, stored: np.ndarray, axis: int, place: int | None) -> np.ndarray:
    """Rows that no program has written, as far as the file says so.

    It does of chunks without a place in the file, of a data set without any, and where a fill value was chosen that is
    no zero: the netCDF library and others choose one that nobody measures.

    Parameters
    ----------
    data : Dataset
    stored : ndarray, shape (n,)
        What is read of it.
    axis : int
        Along which rows are counted.
    place : int or None
        Of the column on the other axis; None where there is none.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    fill = data.fillvalue
    chosen = data.id.get_create_plist().fill_value_defined() == h5py.h5d.FILL_VALUE_USER_DEFINED
    gone: np.ndarray = (
        stored == fill if chosen and fill and stored.dtype.itemsize > _BYTE else np.zeros(stored.shape, dtype=bool)
    )
    if data.chunks is None:
        gone |= data.id.get_space_status() == h5py.h5d.SPACE_STATUS_NOT_ALLOCATED
        return gone
    size = data.chunks[axis]
    there = np.zeros(-(-stored.size // size), dtype=bool)
    across = None if place is None else place // data.chunks[1 - axis] * data.chunks[1 - axis]

    def keep(chunk: h5py.h5d.StoreInfo) -> None:
        offset = chunk.chunk_offset
        if across is None or offset[1 - axis] == across:
            there[offset[axis] // size] = True

    data.id.chunk_iter(keep)
    gone |= ~np.repeat(there, size)[: stored.size]
    return gone
