"""What the texts of a column of dates show of all: that they are no times, or that digits are missing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.config.types import describe
from hgorun.data.cells import Stamps
from hgorun.data.clocks import ClockColumn
from hgorun.data.table import Table
from hgorun.data.times.dates import NAT
from hgorun.data.times.fractions import without_zeros
from hgorun.data.times.intervals import TWO_TIMES, ends_change
from hgorun.errors import ConfigError


def odd_texts(column: ClockColumn, table: Table) -> Iterator[str]:
    """What is to be told of dates whose texts show that they are read as something else.

    Raises
    ------
    ConfigError
        Where that is certain.
    """
    cells = column.cells
    if isinstance(cells, Stamps) and (shown := without_zeros(cells.first, cells.pattern)):
        message = (
            f"{describe(shown)}: fractions of a second have several widths, and none begins with 0: if they are whole "
            "milliseconds without zeros in front, write these into the file (.027 for 27 ms)"
        )
        there = table.columns[cells][table.columns[cells] != NAT]
        if np.any(np.diff(there) < 0):
            raise ConfigError(message, file=str(table.path), line=int(table.lines[0]), key=cells.column)
        yield f"column {cells.column!r}: {message}"
    if isinstance(cells, Stamps) and True in cells.zoned and ends_change(cells.first):
        shown = cells.first[0]
        message = f"{describe(shown)}: what is read as a time zone is another one in most rows; {TWO_TIMES}"
        raise ConfigError(message, file=str(table.path), line=int(table.lines[0]), key=cells.column)
