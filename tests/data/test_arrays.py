"""Parquet, HDF5 and netCDF, results of our own among them: the numbers of a CSV file with the same table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow
import pytest
from logs import noisy
from pyarrow import parquet

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording
from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy()
GAPPED = np.where(np.arange(VALUES.size) % 7 == 3, np.nan, VALUES)
STAMPS = np.datetime64("2024-05-31T12:00:00", "ns") + np.rint(TIMES * 1e9).astype("timedelta64[ns]")


def hdf5(path: Path, **columns: Any) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file.create_dataset(f"log/{name}", data=values)


def parquet_file(path: Path, **columns: Any) -> None:
    parquet.write_table(pyarrow.table(columns), path)


def recorded(path: Path, prefix: str, **changes: Any) -> Recording:
    block = {"file": path.name, "time": f"{prefix}t", "outputs": {"S": f"{prefix}glucose"}} | changes
    return read(Data.model_validate(block), path.parent)


WRITTEN = [(hdf5, "log/", "log.h5"), (parquet_file, "", "log.parquet")]


@pytest.mark.parametrize(("write", "prefix", "name"), WRITTEN)
def test_numbers(tmp_path: Path, write: Any, prefix: str, name: str) -> None:
    write(tmp_path / name, t=TIMES, glucose=GAPPED, state=np.arange(TIMES.size) % 2)
    quality = {"column": f"{prefix}glucose", "quality": {"column": f"{prefix}state", "good": [0]}}
    recording = recorded(tmp_path / name, prefix, outputs={"S": quality})
    kept = ~np.isnan(GAPPED) & (np.arange(TIMES.size) % 2 == 0)
    signal = recording.outputs["S"]
    np.testing.assert_array_equal(signal.taken, TIMES[kept])
    np.testing.assert_array_equal(signal.values, VALUES[kept])
    np.testing.assert_array_equal(signal.lines, np.flatnonzero(kept) + 1)
    assert [(note.kind, note.line) for note in recording.notes] == [("missing", 4), ("quality", 2)]


@pytest.mark.parametrize("zone", [None, "UTC"])
def test_dates_of_parquet(tmp_path: Path, zone: str | None) -> None:
    dates = pyarrow.array(STAMPS).cast(pyarrow.timestamp("ns", zone))
    parquet_file(tmp_path / "log.parquet", t=dates, glucose=VALUES)
    recording = recorded(tmp_path / "log.parquet", "")
    np.testing.assert_allclose(recording.outputs["S"].taken, TIMES - TIMES[0], atol=1e-9)
    assert recording.origin.epoch == STAMPS[0]
    assert recording.origin.zone == (zone or "")


def test_dates_as_text(tmp_path: Path) -> None:
    hdf5(tmp_path / "log.h5", t=[str(stamp) for stamp in STAMPS], glucose=VALUES)
    recording = recorded(tmp_path / "log.h5", "log/")
    np.testing.assert_allclose(recording.outputs["S"].taken, TIMES - TIMES[0], atol=1e-9)


def test_integers_and_texts_that_are_numbers(tmp_path: Path) -> None:
    parquet_file(tmp_path / "log.parquet", t=[1, 2, 4], glucose=["1.5", None, "2.25"])
    signal = recorded(tmp_path / "log.parquet", "").outputs["S"]
    np.testing.assert_array_equal(signal.taken, [1, 4])
    np.testing.assert_array_equal(signal.values, [1.5, 2.25])


def test_durations_are_refused_by_name(tmp_path: Path) -> None:
    parquet_file(tmp_path / "log.parquet", t=np.arange(3).astype("timedelta64[ns]"), glucose=[1.0, 2.0, 3.0])
    with pytest.raises(ConfigError, match=r"log\.parquet: t: durations, .*: write them as numbers of seconds"):
        recorded(tmp_path / "log.parquet", "")


def test_what_netcdf_stores_is_unpacked(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = np.arange(4.0)
        file["glucose"] = np.array([-9999, 1500, -9999, -250], dtype="i2")
        file["glucose"].attrs.update(
            {"_FillValue": np.array([-9999], dtype="i2"), "scale_factor": 0.5, "add_offset": 10.0}
        )
    signal = recorded(tmp_path / "log.h5", "").outputs["S"]
    np.testing.assert_array_equal(signal.taken, [1, 3])
    np.testing.assert_array_equal(signal.values, [760, -115])


def test_labelled_columns_of_a_result(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["time"] = TIMES
        both = file.create_dataset("plant/x", data=np.stack([VALUES, -VALUES], axis=1))
        both.attrs["labels"] = ["x1", "x2"]
        both.attrs["units"] = ["g/L", "g"]
    block = {"file": "run.h5", "time": "time", "outputs": {"y": "plant/x/x2"}}
    recording = read(Data.model_validate(block), tmp_path, units={"y": "g"})
    np.testing.assert_array_equal(recording.outputs["y"].values, -VALUES)
    with pytest.raises(Problem, match=r"the file says g in .*run.h5, the model has kg"):
        read(Data.model_validate(block), tmp_path, units={"y": "kg"})


@pytest.mark.parametrize(("write", "prefix", "name"), WRITTEN)
@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"t": [0.0, 1, 2], "glucose": [1.0, np.inf, 2]}, r":2: .*glucose: expected a number, found an infinite one"),
        ({"t": [0.0, 1, 2], "glucose": ["1", "bad", "2"]}, r":2: .*glucose: expected a number, found 'bad'"),
        ({"t": [0.0, 2, 1], "glucose": [1.0, 2, 3]}, r":3: outputs\.S: the time stamp 1 s lies before"),
        ({"t": [], "glucose": []}, "no rows"),
    ],
)
def test_what_is_refused(
    tmp_path: Path, write: Any, prefix: str, name: str, columns: dict[str, Any], message: str
) -> None:
    write(tmp_path / name, **columns)
    with pytest.raises(ConfigError, match=message):
        recorded(tmp_path / name, prefix)


def test_columns_of_different_lengths(tmp_path: Path) -> None:
    hdf5(tmp_path / "log.h5", t=TIMES, glucose=VALUES[:-1])
    with pytest.raises(Problem, match=r"log/t has 40 rows, and log/glucose 39, which no other column has: time below"):
        recorded(tmp_path / "log.h5", "log/")


def test_links_are_not_followed(tmp_path: Path) -> None:
    hdf5(tmp_path / "other.h5", t=TIMES, glucose=VALUES)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["log/t"] = TIMES
        file["log/glucose"] = h5py.ExternalLink("other.h5", "log/glucose")
    with pytest.raises(Problem, match="no column"):
        recorded(tmp_path / "log.h5", "log/")


@pytest.mark.parametrize(("write", "prefix", "name"), WRITTEN)
def test_memory_is_bounded(tmp_path: Path, write: Any, prefix: str, name: str) -> None:
    write(tmp_path / name, t=TIMES, glucose=VALUES)
    with pytest.raises(ConfigError, match=r"limit of data\.max_memory"):
        recorded(tmp_path / name, prefix, max_memory=500)


@pytest.mark.costly
@pytest.mark.parametrize(("write", "prefix", "name"), WRITTEN)
def test_damaged_files(tmp_path: Path, write: Any, prefix: str, name: str) -> None:
    write(tmp_path / name, t=TIMES, glucose=VALUES)
    whole = (tmp_path / name).read_bytes()
    random = np.random.default_rng(0)
    for _ in range(8):
        damaged = bytearray(whole[: int(random.integers(9, len(whole)))])
        for k in random.integers(8, len(damaged), 5):
            damaged[k] = int(random.integers(256))
        (tmp_path / name).write_bytes(damaged)
        with pytest.raises((ConfigError, Problem)):
            recorded(tmp_path / name, prefix)


@pytest.mark.parametrize("begin", [b"PK\x03\x04", b"\x1f\x8b\x08", b"CDF\x01", b"BZh9", b"\xd0\xcf\x11\xe0"])
def test_files_that_are_not_read_say_what_they_are(tmp_path: Path, begin: bytes) -> None:
    (tmp_path / "log.csv").write_bytes(begin + bytes(100))
    with pytest.raises(ConfigError, match="this is"):
        recorded(tmp_path / "log.csv", "")


@pytest.mark.parametrize(("write", "prefix", "name"), WRITTEN)
def test_dates_of_a_column_that_begins_with_missing_ones(tmp_path: Path, write: Any, prefix: str, name: str) -> None:
    known: Any = STAMPS + np.timedelta64(1, "s")
    known[:5] = np.datetime64("NaT")
    texts = ["" if np.isnat(one) else str(one) for one in known]
    stamps = [str(one) for one in STAMPS]
    write(tmp_path / name, t=stamps, glucose=VALUES, known=texts if write is hdf5 else known)
    block = {"S": {"column": f"{prefix}glucose", "available": f"{prefix}known"}}
    signal = recorded(tmp_path / name, prefix, outputs=block).outputs["S"]
    np.testing.assert_allclose(signal.available - signal.taken, 1, atol=1e-6)
    assert signal.taken.size == STAMPS.size - 5


SLOW = TIMES[::6]
RATES = {"lt/t": TIMES, "lt/v": VALUES, "ft/t": SLOW, "ft/v": SLOW**2, "ft/state": np.arange(SLOW.size) % 2}


def of_rates(path: Path, kind: str) -> None:
    with h5py.File(path, "w") as file:
        for name, values in RATES.items():
            file[name] = values[None, :] if kind == "matlab" else values
            if kind == "matlab":
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
            elif kind == "netcdf" and name.endswith("/t"):
                file[name].make_scale(name)


@pytest.mark.parametrize("kind", ["hdf5", "matlab", "netcdf"])
def test_signals_of_several_rates_in_one_file(tmp_path: Path, kind: str) -> None:
    of_rates(tmp_path / "log.h5", kind)
    quality = {"column": "ft/state", "good": [0]}
    block = {
        "file": "log.h5",
        "time": "lt/t",
        "outputs": {"S": "lt/v", "X": {"column": "ft/v", "time": "ft/t", "quality": quality}},
        "inputs": {"F": {"column": "ft/v", "time": "ft/t"}},
    }
    recording = read(Data.model_validate(block), tmp_path)
    np.testing.assert_array_equal(recording.outputs["S"].taken, TIMES)
    np.testing.assert_array_equal(recording.outputs["S"].values, VALUES)
    np.testing.assert_array_equal(recording.outputs["X"].taken, SLOW[::2])
    np.testing.assert_array_equal(recording.outputs["X"].values, SLOW[::2] ** 2)
    np.testing.assert_array_equal(recording.inputs["F"].times, SLOW)
    np.testing.assert_array_equal(recording.inputs["F"].values, SLOW**2)


def test_times_of_another_rate_are_refused_with_the_key(tmp_path: Path) -> None:
    of_rates(tmp_path / "log.h5", "hdf5")
    said = rf"lt/t has {TIMES.size:,} rows, and ft/v {SLOW.size:,}, as ft/state, ft/t: time below the signal names"
    with pytest.raises(Problem, match=said) as refused:
        recorded(tmp_path / "log.h5", "lt/", outputs={"S": "lt/v", "X": "ft/v"})
    assert refused.value.path == ("data", "time", "column")
    alone = {"column": "lt/v", "quality": {"column": "ft/state", "good": [0]}}
    said = rf"ft/state has {SLOW.size:,} rows, and lt/v {TIMES.size:,}, as lt/t$"
    with pytest.raises(Problem, match=said):
        recorded(tmp_path / "log.h5", "lt/", outputs={"S": alone})
