"""What the texts of a column of dates show of all: that they are no times, or that digits are missing."""

from __future__ import annotations

from hgorun.config.types import describe
from hgorun.data.cells import Stamps
from hgorun.data.clocks import ClockColumn
from hgorun.data.table import Table
from hgorun.data.times.intervals import TWO_TIMES, ends_change
from hgorun.errors import ConfigError


def require_times(column: ClockColumn, table: Table) -> None:
    """Refuse dates whose texts show that they are read as something else.

    Raises
    ------
    ConfigError
    """
    cells = column.cells
    if isinstance(cells, Stamps) and True in cells.zoned and ends_change(cells.first):
        shown = cells.first[0]
        message = f"{describe(shown)}: what is read as a time zone is another one in most rows; {TWO_TIMES}"
        raise ConfigError(message, file=str(table.path), line=int(table.lines[0]), key=cells.column)
