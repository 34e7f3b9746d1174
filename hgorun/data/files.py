"""Files of measurements, by what they begin with."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from pathlib import Path

from hgorun.config.data import Csv
from hgorun.config.kinds import HDF5, HEAD, MEASUREMENTS, PARQUET, kind_of
from hgorun.config.nearest import MEASURED, no_file
from hgorun.data.csv.csv_table import CsvFile
from hgorun.data.table import TableFile
from hgorun.errors import ConfigError, KeyPath, Problem
from hgorun.originals import note_originals

_CONFIGURATIONS = (".yaml", ".yml")
_NAMED = {".parquet": "a Parquet table", ".h5": "an HDF5 file", ".hdf5": "an HDF5 file", ".nc": "a netCDF file"}


def open_table(path: Path, told: Csv, key: KeyPath | None, clocks: Mapping[str, Collection[str | None]]) -> TableFile:
    """A file whose columns are known and not yet read.

    Parameters
    ----------
    path : Path
    told : Csv
        How a text is written.
    key : tuple or None
        That names the file.
    clocks : mapping of str to collection of str
        Of columns of time stamps, the formats in which they are read, None for numbers: what tells a row of units
        from one of data.

    Raises
    ------
    Problem
        At the key that names it, when there is no such file.
    ConfigError
        When it is no file of measurements, or there is none and no key names it.
    """
    if not os.path.isfile(path):
        what = "this is a folder; name the file of the log in it" if os.path.isdir(path) else no_file(path, MEASURED)
        if key is None:
            raise ConfigError(what, file=str(path))
        raise Problem(key, f"{path}: {what}")
    note_originals([path])
    try:
        with path.open("rb") as stream:
            kind = kind_of(stream.read(HEAD))
    except OSError as error:
        raise ConfigError(f"cannot be read: {error.strerror}", file=str(path)) from None
    if kind is None and path.suffix.lower() in _CONFIGURATIONS:
        raise ConfigError(
            f"this is a configuration, not a log: {MEASUREMENTS}, and a command takes one configuration, with the log "
            "behind it or as its data.file",
            file=str(path),
        )
    if kind is None and (named := _NAMED.get(path.suffix.lower())):
        raise ConfigError(f"this is not {named}, as its name says: was it cut off?", file=str(path))
    if kind is None:
        return CsvFile(path, told, clocks)
    if kind not in (HDF5, PARQUET):
        raise ConfigError(f"this is {kind.what}: {kind.instead}", file=str(path), line=1)
    # what texts do not need
    from hgorun.data.arrays.arrays import ArrayFile
    from hgorun.data.arrays.hdf5 import Hdf5
    from hgorun.data.arrays.parquet import Parquet

    return ArrayFile(path, Hdf5() if kind is HDF5 else Parquet(), told)
