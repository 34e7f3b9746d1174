"""Cells of HDF5 that no program has written hold no measurement, whatever they read as."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from logs import noisy

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording
from hgorun.errors import ConfigError

TIMES, VALUES = noisy(20)


def recorded(path: Path, column: str = "y", **changes: Any) -> Recording:
    block = {"file": path.name, "time": "t", "outputs": {"S": column}} | changes
    return read(Data.model_validate(block), path.parent)


def file_of(path: Path, written: int, times: int = 20, **options: Any) -> Path:
    """A log for 20 samples of which the first ones are written."""
    with h5py.File(path, "w") as file:
        options = {"chunks": (5,)} | options
        for name, values, count in (("t", TIMES, times), ("y", VALUES, written)):
            data = file.create_dataset(name, shape=(20,), **({"dtype": "f8"} | (options if count < 20 else {})))
            data[:count] = values[:count]
    return path


@pytest.mark.parametrize(
    ("options", "written", "left"),
    [
        ({"fillvalue": -9999.0}, 15, 15),
        ({"fillvalue": -9999.0}, 12, 12),  # the rest of its chunk, too
        ({"fillvalue": -9999.0, "chunks": None}, 12, 12),
        ({"fillvalue": 1e20, "compression": "gzip", "maxshape": (None,)}, 12, 12),
        ({"fillvalue": -9999, "dtype": "i4"}, 12, 12),
        ({}, 15, 15),
        ({"fillvalue": 0.0}, 10, 10),
        ({}, 12, 15),  # zeros beside what was written may be measured
    ],
)
def test_what_was_never_written_is_missing(tmp_path: Path, options: dict[str, Any], written: int, left: int) -> None:
    found = recorded(file_of(tmp_path / "log.h5", written, **options))
    signal = found.outputs["S"]
    assert signal.taken.tolist() == TIMES[:left].tolist()
    right = VALUES.astype(options.get("dtype", "f8"))[:written].tolist()
    assert signal.values.tolist() == [*right, *[0.0] * (left - written)]
    assert [(note.kind, note.line, note.count) for note in found.notes] == [("missing", left + 1, 20 - left)]


def test_rows_for_later_samples_have_no_time_either(tmp_path: Path) -> None:
    found = recorded(file_of(tmp_path / "log.h5", 15, times=15))
    assert found.outputs["S"].taken.tolist() == TIMES[:15].tolist()


def test_a_data_set_that_was_only_created_has_no_value(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no value is left: the value is missing"):
        recorded(file_of(tmp_path / "log.h5", 0, chunks=None))


@pytest.mark.parametrize("fill", [0.0, None])
def test_zeros_that_were_written_stay(tmp_path: Path, fill: float | None) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = TIMES
        data = file.create_dataset("y", shape=(20,), dtype="f8", chunks=(5,), fillvalue=fill, compression="gzip")
        data[:] = np.arange(20.0) % 3
    assert recorded(tmp_path / "log.h5").outputs["S"].values.tolist() == (np.arange(20.0) % 3).tolist()


@pytest.mark.parametrize(("fill", "dtype"), [(255, "u1"), (-127, "i1")])
def test_a_byte_has_no_number_to_spare(tmp_path: Path, fill: int, dtype: str) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = TIMES[:3]
        file.create_dataset("y", data=np.array([1, fill, 3], dtype=dtype), fillvalue=fill)
    assert recorded(tmp_path / "log.h5").outputs["S"].values.tolist() == [1, fill, 3]


@pytest.mark.parametrize("across", [False, True])
def test_columns_of_one_data_set_each_have_their_chunks(tmp_path: Path, across: bool) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = TIMES
        shape, chunks = ((3, 20), (2, 5)) if across else ((20, 3), (5, 2))
        data = file.create_dataset("y", shape=shape, dtype="f8", chunks=chunks)
        if across:
            data.attrs["MATLAB_class"] = np.bytes_("double")
            data[:2, :15], data[2, :10] = np.ones((2, 1)) * VALUES[:15], VALUES[:10]
        else:
            data[:15, :2], data[:10, 2] = np.ones(2) * VALUES[:15, None], VALUES[:10]
    for column, left in (("y/0", 15), ("y/1", 15), ("y/2", 10)):
        assert recorded(tmp_path / "log.h5", column).outputs["S"].values.tolist() == VALUES[:left].tolist()
