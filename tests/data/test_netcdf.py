"""netCDF as xarray and h5netcdf write it: the dates and the values that xarray reads; what cannot be read is named."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import pytest
import xarray
from logs import noisy

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording
from hgorun.data.times.dates import counted
from hgorun.errors import ConfigError

TIMES, VALUES = noisy(12)


def netcdf(path: Path, times: np.ndarray, values: np.ndarray | None = None, **attributes: Any) -> None:
    """A file of h5netcdf; attributes of the values begin with ``S_``."""
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"t": times.size}
        for name, data, mark in (
            ("t", times, ""),
            ("glucose", VALUES[: times.size] if values is None else values, "S_"),
        ):
            own = {k.removeprefix(mark): v for k, v in attributes.items() if k.startswith("S_") == bool(mark)}
            variable = file.create_variable(name, ("t",), data.dtype, fillvalue=own.pop("_FillValue", None))
            variable[:] = data
            variable.attrs.update(own)


def recorded(path: Path, unit: str = "s", time: Any = "t", **changes: Any) -> Recording:
    block = {"file": path.name, "time": time, "outputs": {"S": "glucose"}} | changes
    return read(Data.model_validate(block), path.parent, time_unit=unit)


@pytest.mark.parametrize(
    ("units", "spelt", "first", "step"),
    [
        ("days since 2024-01-01", "d since 2024-1-1", 3, 0.3),
        ("hours since 2024-01-01T06:30", "Hr  since  2024-01-01 6:30", -8, 2.7),
        ("minutes since 1800-01-01 00:00", "mins since 1800-01-01", 118_000_000, 1.5),
        ("seconds since 2024-01-01 00:00:00.25", "sec SINCE 2024-01-01T0:0:0.25", 7, 0.07),
        ("seconds since 1970-01-01T00:00:00Z", "s since 1970-01-01 UTC", 1_700_000_000, 3.3),
        ("milliseconds since 2024-01-01 12:00:00 +02:00", "msec since 2024-01-01 12:00 +2", 0, 31.4),
        ("milliseconds since 2024-01-01 12:00:00 -06:30", "ms since 2024-01-01T12:00-0630", 5, 31.4),
        ("microseconds since 2023-12-31", "us since 2023-12-31 00:00:00.000", 9, 1234.5),
    ],
)
@pytest.mark.parametrize("whole", [True, False])
def test_dates_are_those_that_xarray_reads(
    tmp_path: Path, units: str, spelt: str, first: int, step: float, whole: bool
) -> None:
    times = first + np.arange(3, 15) ** 2 if whole else first + step * np.cumsum(np.arange(3, 15))
    netcdf(tmp_path / "log.nc", times, units=units)
    with xarray.open_dataset(tmp_path / "log.nc", engine="h5netcdf") as independent:
        dates = independent["t"].values
    netcdf(tmp_path / "log.nc", times, units=spelt)
    recording = recorded(tmp_path / "log.nc", "min")
    origin = recording.origin
    assert origin.epoch is not None
    assert abs(origin.epoch - dates[0]) <= np.timedelta64(0 if whole else 10_000, "ns")
    expected = (dates - dates[0]) / np.timedelta64(1, "m")
    np.testing.assert_allclose(recording.outputs["S"].taken, expected, rtol=1e-12, atol=0 if whole else 2e-7)
    assert origin.zone == ("UTC" if any(sign in units for sign in ("Z", "+", " -06")) else "")


def test_hours_that_count_from_the_year_1(tmp_path: Path) -> None:
    """xarray has no such dates without another package; Python counts the days of the same calendar."""
    hours = 24 * (date(2024, 2, 29).toordinal() - 1) + np.arange(12)
    netcdf(tmp_path / "log.nc", hours, units="hours since 1-1-1 00:00:00", calendar="proleptic_gregorian")
    recording = recorded(tmp_path / "log.nc", "h")
    assert recording.origin.epoch == np.datetime64("2024-02-29")
    assert recording.outputs["S"].taken.tolist() == list(range(12))


@pytest.mark.costly
def test_what_xarray_writes_is_read(tmp_path: Path) -> None:
    dates = np.datetime64("2024-03-31T00:30", "ns") + np.arange(12) * np.timedelta64(90_000_000_001, "ns")
    values = np.where(np.arange(12) == 4, np.nan, VALUES)
    data = xarray.Dataset({"glucose": ("t", values)}, coords={"t": dates})
    packing = {"dtype": "i2", "scale_factor": 0.01, "add_offset": 20.0, "_FillValue": -32768}
    data.to_netcdf(tmp_path / "log.nc", engine="h5netcdf", encoding={"glucose": packing})
    recording = recorded(tmp_path / "log.nc", "h")
    signal = recording.outputs["S"]
    kept = np.arange(12) != 4
    assert recording.origin.epoch == dates[0]
    np.testing.assert_allclose(signal.taken, ((dates - dates[0]) / np.timedelta64(1, "h"))[kept], rtol=1e-14)
    with xarray.open_dataset(tmp_path / "log.nc", engine="h5netcdf") as independent:
        np.testing.assert_allclose(signal.values, independent["glucose"].values[kept], rtol=1e-6)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"units": "days since 2024-01-01", "calendar": "360_day"}, "the calendar '360_day' is not that of dates"),
        ({"units": "days since 2024-01-01", "calendar": "julian"}, "the calendar 'julian' is not that of dates"),
        ({"units": "months since 2024-01-01"}, "counts in 'months', which has no fixed length"),
        ({"units": "days since the flood"}, "expected units such as days since 2024-05-31 13:45:10, found"),
        ({"units": "days since 2024-02-30"}, "'days since 2024-02-30': day"),
        ({"units": "hours since 0001-01-01"}, "before 1582-10-15 this calendar is Julian"),
        ({"units": "days since 9000-01-01"}, "expected a date between 1678 and 2262, found 0 days since 9000-01-01"),
    ],
)
def test_dates_that_cannot_be_told_are_refused_and_numbers_are_read_with_a_unit(
    tmp_path: Path, attributes: dict[str, Any], message: str
) -> None:
    netcdf(tmp_path / "log.nc", np.arange(12.0), **attributes)
    with pytest.raises(ConfigError, match=rf"log\.nc:?1?: t: .*{message}"):
        recorded(tmp_path / "log.nc")
    recording = recorded(tmp_path / "log.nc", "h", {"column": "t", "unit": "d"})
    assert recording.outputs["S"].taken.tolist() == (24 * np.arange(12.0)).tolist()
    assert recording.origin.epoch is None


MISSING_AND_LEFT: list[tuple[str, dict[str, Any], list[float], list[float]]] = [
    ("f8", {"missing_value": [-1.0, 9.0]}, [1, -1, 9, 2], [1, 2]),
    ("f4", {"missing_value": np.array([-999.9])}, [1, -999.9, 2, 3], [1, 2, 3]),
    ("f8", {"missing_value": "-1.0"}, [1, -1, 2, 3], [1, 2, 3]),
    ("f8", {"valid_range": [0.0, 2.5]}, [1, -1, 9, 2], [1, 2]),
    (
        "f4",
        {"valid_max": 2.1, "valid_min": [0.1]},
        [0.1, 0, 2.1, 2.2],
        [float(np.float32(0.1)), float(np.float32(2.1))],
    ),
    ("i2", {"valid_max": np.int16(50), "scale_factor": [0.5]}, [10, 60, 50, 20], [5, 25, 10]),
    ("i2", {"valid_max": 25.0, "scale_factor": 0.5}, [10, 60, 50, 20], [5, 25, 10]),  # of what they stand for
    ("i2", {"scale_factor": "0.5", "add_offset": [1.0]}, [10, 20, 30, 40], [6, 11, 16, 21]),
    ("i1", {"_Unsigned": "true", "scale_factor": 2.0, "missing_value": np.int8(-1)}, [-128, -1, 5, 6], [256, 10, 12]),
    ("i4", {"missing_value": np.array([-99, -98], dtype="i4"), "add_offset": 0.5}, [-99, 1, -98, 2], [1.5, 2.5]),
]


@pytest.mark.parametrize(("kind", "attributes", "stored", "expected"), MISSING_AND_LEFT)
def test_values_are_those_of_the_conventions(
    tmp_path: Path, kind: str, attributes: dict[str, Any], stored: list[float], expected: list[float]
) -> None:
    values = np.array(stored, dtype=kind)
    netcdf(tmp_path / "log.nc", np.arange(4.0), values, **{f"S_{name}": one for name, one in attributes.items()})
    signal = recorded(tmp_path / "log.nc").outputs["S"]
    np.testing.assert_array_equal(signal.values, expected)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"scale_factor": [1.0, 2.0]}, r"the attribute scale_factor is .*: expected one finite number"),
        ({"scale_factor": "half"}, "the attribute scale_factor is 'half': expected a number"),
        ({"scale_factor": 0.0}, "the attribute scale_factor is 0"),
        ({"add_offset": np.nan}, "the attribute add_offset is .*: expected one finite number"),
        ({"missing_value": "n.a."}, "the attribute missing_value is 'n.a.': expected a number"),
        ({"missing_value": -999.9}, "the attribute missing_value is -999.9, which no number of int16 is"),
        ({"valid_range": [1.0]}, r"the attribute valid_range is .*: expected \[low, high\]"),
        ({"valid_range": [2.0, 1.0]}, r"the attribute valid_range is .*: expected \[low, high\]"),
        ({"valid_min": [2.0, 1.0]}, "the attribute valid_min has 2 numbers: expected one"),
    ],
)
def test_attributes_that_say_something_else_are_refused(
    tmp_path: Path, attributes: dict[str, Any], message: str
) -> None:
    values = np.arange(4, dtype="i2")
    netcdf(tmp_path / "log.nc", np.arange(4.0), values, **{f"S_{name}": one for name, one in attributes.items()})
    with pytest.raises(ConfigError, match=rf"log\.nc: glucose: {message}"):
        recorded(tmp_path / "log.nc")


def test_texts_and_what_was_never_written_may_be_missing(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = np.arange(4.0)
        file.create_dataset("glucose", (4,), "f8", fillvalue=9.969209968386869e36)[:2] = [1, 2]
        file["text"] = ["1.5", "gone", "", "2"]
        file["text"].attrs["_FillValue"] = "gone"
    signal = recorded(tmp_path / "log.h5").outputs["S"]
    assert (signal.taken.tolist(), signal.values.tolist()) == ([0, 1], [1, 2])
    assert recorded(tmp_path / "log.h5", outputs={"S": "text"}).outputs["S"].values.tolist() == [1.5, 2]


def test_days_in_single_precision_are_as_exact_as_their_numbers() -> None:
    quarters = np.arange(0, 400, 0.25)  # binary fractions: exact in single precision
    day = 86_400_000_000_000
    stamps, wrong = counted(quarters.astype(np.float32), day, 20_000 * day)
    assert wrong is None
    np.testing.assert_array_equal(stamps, 20_000 * day + (4 * quarters).astype(np.int64) * (day // 4))
