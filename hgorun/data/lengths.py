"""Columns of a file that are not all of one length, as data sets of several rates are."""

from __future__ import annotations

from pathlib import Path

from hgorun.config.nearest import listed
from hgorun.data.table import TableFile
from hgorun.errors import KeyPath, Problem


def require_one_length(file: Path, table: TableFile, beside: str, values: str, path: KeyPath) -> None:
    """Refuse a column that is read row by row beside the values of a signal, and has another number of rows.

    Parameters
    ----------
    file : Path
    table : TableFile
    beside : str
        Of times, or of the quality.
    values : str
        Not among the names where that has been told.
    path : KeyPath
        The key that names the column beside.

    Raises
    ------
    Problem
    """
    if values not in table.names:
        return
    rows, wanted = table.rows(beside), table.rows(values)
    if rows != wanted:
        fitting = [name for name in table.names if name != values and table.rows(name) == wanted]
        there = f"as {listed(fitting, beside)}" if fitting else "which no other column has"
        own = ": time below the signal names the column that has its times" if path[-2] == "time" else ""
        message = f"{file}: {beside} has {rows:,} rows, and {values} {wanted:,}, {there}{own}"
        raise Problem(path, message)
