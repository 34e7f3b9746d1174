"""Columns of Parquet files; needs pyarrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hgorun.data.arrays.arrays import ArrayColumn
from hgorun.errors import ConfigError, HgorunError, printable

if TYPE_CHECKING:
    import pyarrow

_FIRST = 1_000  # rows in which the first value of a column is looked for
_SHOWN, _FEW = 200, 50  # rows that are kept as texts, and columns of a table of which they are
_AT_ONCE = 1 << 18  # decimals that are held as text
_DATE = "1970-01-01"  # stands for whatever date comes first


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
            if batch is None:
                return {field.name: ArrayColumn(rows, "", "") for field in file.schema_arrow}
            kept = batch.num_columns <= _FEW and any(map(_is_text, batch.schema.types))
            return {
                field.name: ArrayColumn(rows, "", _sample(column), texts=_texts(column[:_SHOWN]) if kept else ())
                for field, column in zip(file.schema_arrow, batch.columns, strict=True)
            }

    def columns(self, path: Path, names: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Numbers, dates or texts; what is missing is NaN, NaT or None.

        Raises
        ------
        ConfigError
            For a column of durations.
        """
        import pyarrow
        from pyarrow import types
        from pyarrow.parquet import read_schema, read_table

        schema, found = read_schema(path), {}
        for name in names:
            if (count := schema.names.count(name)) > 1:
                raise ConfigError(f"{count} columns called {name!r}", file=str(path))
            kind = schema.field(name).type
            if types.is_duration(kind):
                said = "durations, whose unit is not that of numbers: write them as numbers of seconds"
                raise ConfigError(said, file=str(path), key=name)
            values = read_table(path, columns=[name], use_threads=False).column(0)
            try:
                found[name] = _dates(values, path, name) if _is_date(kind) else _array(values)
            except (pyarrow.ArrowInvalid, pyarrow.ArrowNotImplementedError):
                said = f"a column of {kind}, found in place of numbers, dates or texts"
                raise ConfigError(said, file=str(path), key=name) from None
        return found

    def passed_over(self, path: Path, name: str) -> str:
        """All are columns."""
        return ""

    def zoned(self, path: Path, name: str) -> bool:
        """Whether the column has a time zone."""
        from pyarrow.parquet import read_schema

        return getattr(read_schema(path).field(name).type, "tz", None) is not None


def _sample(values: pyarrow.Array) -> str:
    there = values.drop_null()
    if _is_date(values.type):
        return _DATE
    return printable(str(there[0].as_py()))[:100] if len(there) else ""


def _is_text(kind: pyarrow.DataType) -> bool:
    from pyarrow import types

    plain = kind.value_type if types.is_dictionary(kind) else kind
    return bool(types.is_string(plain) or types.is_large_string(plain))


def _texts(values: pyarrow.Array) -> tuple[str, ...]:
    """Values as texts; none of lists and the like."""
    import pyarrow

    try:
        return tuple(printable(text or "") for text in values.cast(pyarrow.string()).to_pylist())
    except (pyarrow.ArrowInvalid, pyarrow.ArrowNotImplementedError):
        return ()


def _is_date(kind: pyarrow.DataType) -> bool:
    from pyarrow import types

    return bool(types.is_timestamp(kind) or types.is_date(kind))


def _dates(values: pyarrow.ChunkedArray, path: Path, name: str) -> np.ndarray:
    """In nanoseconds; the first that is out of their range is refused."""
    import pyarrow

    try:
        return np.asarray(values.cast(pyarrow.timestamp("ns")).to_numpy())
    except pyarrow.ArrowInvalid:
        coarse = values.cast(pyarrow.timestamp("s"), safe=False).cast(pyarrow.int64()).fill_null(0).to_numpy()
        row = int(np.argmax(np.abs(coarse.astype(float)) > 2.0**63 / 1e9)) + 1
        said = "expected a date between 1678 and 2262, found one far from them"
        raise ConfigError(said, file=str(path), line=row, key=name) from None


def _array(values: pyarrow.ChunkedArray) -> np.ndarray:
    """Numbers or texts."""
    import pyarrow
    from pyarrow import types

    kind = values.type
    if types.is_decimal(kind):  # a cast at once multiplies by a power of ten, and is off by a last bit
        parts = (values.slice(start, _AT_ONCE).cast(pyarrow.string()) for start in range(0, len(values), _AT_ONCE))
        return np.concatenate([part.cast(pyarrow.float64()).to_numpy() for part in parts])
    if types.is_integer(kind) or types.is_floating(kind):
        double = values if types.is_float32(kind) else values.cast(pyarrow.float64(), safe=False)
        return np.asarray(double.to_numpy())
    return np.asarray(values.cast(pyarrow.string()).to_numpy(zero_copy_only=False), dtype=object)
