"""Columns of Parquet files; needs pyarrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hgorun.data.arrays import ArrayColumn
from hgorun.errors import ConfigError, HgorunError, printable

if TYPE_CHECKING:
    import pyarrow

_FIRST = 1_000  # rows in which the first value of a column is looked for
_NO_DATE = "1970-01-01"  # stands for a column of dates that begins with missing ones


class Parquet:
    """Dates stay what they are there: in UTC where the column has a time zone.

    Raises
    ------
    HgorunError
        When pyarrow is missing.
    """

    def __init__(self) -> None:
        if find_spec("pyarrow") is None:
            raise HgorunError("Parquet files need the package pyarrow: pip install 'hgorun[parquet]'")

    def catalogue(self, path: Path) -> Mapping[str, ArrayColumn]:
        """The columns."""
        from pyarrow.parquet import ParquetFile

        with ParquetFile(path) as file:
            rows = file.metadata.num_rows
            batch = next(file.iter_batches(batch_size=_FIRST, use_threads=False), None)
            return {
                field.name: ArrayColumn(rows, "", "" if batch is None else _sample(batch.column(place)))
                for place, field in enumerate(file.schema_arrow)
            }

    def columns(self, path: Path, names: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Numbers, dates or texts; what is missing is NaN, NaT or None.

        Raises
        ------
        ConfigError
            For a column of durations.
        """
        from pyarrow import types
        from pyarrow.parquet import read_table

        found = read_table(path, columns=list(names), use_threads=False)
        for name in names:
            if types.is_duration(found.column(name).type):
                said = "durations, whose unit is not that of numbers: write them as numbers of seconds"
                raise ConfigError(said, file=str(path), key=name)
        return {name: _array(found.column(name)) for name in names}

    def zoned(self, path: Path, name: str) -> bool:
        """Whether the column has a time zone."""
        from pyarrow.parquet import read_schema

        return getattr(read_schema(path).field(name).type, "tz", None) is not None


def _sample(values: pyarrow.Array) -> str:
    from pyarrow import types

    there = values.drop_null()
    if not len(there):
        return _NO_DATE if types.is_timestamp(values.type) or types.is_date(values.type) else ""
    first = there[0].as_py()
    return printable(first.isoformat() if isinstance(first, date) else str(first))[:100]


def _array(values: pyarrow.ChunkedArray) -> np.ndarray:
    import pyarrow
    from pyarrow import types

    kind = values.type
    if types.is_timestamp(kind) or types.is_date(kind):
        return np.asarray(values.cast(pyarrow.timestamp("ns")).to_numpy())
    if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
        double = values if types.is_float32(kind) else values.cast(pyarrow.float64(), safe=False)
        return np.asarray(double.to_numpy())
    return np.asarray(values.cast(pyarrow.string()).to_numpy(zero_copy_only=False), dtype=object)
