"""Files of measurements, by what they begin with."""

from __future__ import annotations

import os
from pathlib import Path

from hgorun.config.data import Csv
from hgorun.config.nearest import near_file
from hgorun.data.csv_table import CsvFile
from hgorun.data.table import TableFile
from hgorun.errors import ConfigError, KeyPath, Problem

_HDF5 = b"\x89HDF\r\n\x1a\n"
_PARQUET = b"PAR1"
_NOT_READ = {
    b"PK\x03\x04": "a zip archive or a workbook of Excel: save the sheet as CSV",
    b"\xd0\xcf\x11\xe0": "an old workbook of Excel: save the sheet as CSV",
    b"\x1f\x8b": "compressed by gzip: unpack it first",
    b"BZh": "compressed by bzip2: unpack it first",
    b"\xfd7zXZ": "compressed by xz: unpack it first",
    b"CDF": "netCDF of the old kind: nccopy -k nc4 makes one that is read",
}


def open_table(path: Path, told: Csv, key: KeyPath | None) -> TableFile:
    """A file whose columns are known and not yet read.

    Raises
    ------
    Problem
        At the key that names it, when there is no such file.
    ConfigError
        When it is no file of measurements, or there is none and no key names it.
    """
    if not os.path.isfile(path):
        what = "not a regular file" if os.path.exists(path) else f"there is no such file{near_file(path)}"
        if key is None:
            raise ConfigError(what, file=str(path))
        raise Problem(key, f"{path}: {what}")
    try:
        with path.open("rb") as stream:
            begin = stream.read(8)
    except OSError as error:
        raise ConfigError(f"cannot be read: {error.strerror}", file=str(path)) from None
    for mark, what in _NOT_READ.items():
        if begin.startswith(mark):
            raise ConfigError(f"this is {what}", file=str(path), line=1)
    if begin != _HDF5 and not begin.startswith(_PARQUET):
        return CsvFile(path, told)
    # what texts do not need
    from hgorun.data.arrays import ArrayFile
    from hgorun.data.hdf5 import Hdf5
    from hgorun.data.parquet import Parquet

    return ArrayFile(path, Hdf5() if begin == _HDF5 else Parquet(), told)
