"""Millions of rows of plain numbers and dates at once.

Machine code reads them up to the first row with anything else. That row, and all that is wrong, is for
:mod:`hgorun.data.csv.rows`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np

from hgorun.data.cells import Cells, Flags, Numbers, Stamps
from hgorun.data.csv.decimals import powers
from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.plain_rows import WORDS, code
from hgorun.data.csv.splitting import SPACES
from hgorun.data.csv.text import Block
from hgorun.data.times.dates import iso_stamps


class Bulk:
    """Reads blocks of a table.

    Parameters
    ----------
    dialect : Dialect
    wanted : sequence of Cells
    """

    def __init__(self, dialect: Dialect, wanted: Sequence[Cells]) -> None:
        self._dialect, self._wanted = dialect, wanted
        self._places = [dialect.names.index(cells.column) for cells in wanted]
        one_byte = all(len(sign.encode()) == 1 for sign in (dialect.separator, dialect.comment))
        self.suits = (
            all(map(_is_plain, wanted))
            and len(set(self._places)) == len(wanted)
            and dialect.separator != SPACES
            and one_byte
            and dialect.width == len(dialect.names)
        )
        if self.suits:  # made once, and kept: two threads that ask at the same time would get one each
            self._code, self._powers = code(), powers()

    def rows(self, block: Block, start: int, columns: Sequence[np.ndarray]) -> tuple[int, int]:
        """Read rows from a byte of a block on, up to the first that is not plain.

        Parameters
        ----------
        block : Block
        start : int
        columns : sequence of ndarray, each with a place for every line from there on
            Written to: the columns wanted.

        Returns
        -------
        int
            How many rows there were.
        int
            The byte behind them.
        """
        return self.dated(block, columns, *self.scanned(block, start, columns))

    def scanned(self, block: Block, start: int, columns: Sequence[np.ndarray]) -> tuple[int, int]:
        """As :meth:`rows`, with where dates stand in place of these: what several threads may do at once."""
        dialect, text = self._dialect, np.frombuffer(block.text, dtype=np.uint8)
        plan, kinds = np.zeros((2, dialect.width), dtype=np.int64)
        for place, cells, column in zip(self._places, self._wanted, columns, strict=True):
            plan[place] = column.ctypes.data
            kinds[place] = isinstance(cells, Stamps)
        signs = (dialect.separator, dialect.decimal, dialect.comment)
        tables = (plan.ctypes.data, kinds.ctypes.data, self._powers.ctypes.data)
        taken = (ctypes.c_int64 * len(WORDS))(
            text.ctypes.data, text.size, dialect.width, *map(ord, signs), *tables, start
        )
        count = int(self._code.run(ctypes.addressof(taken)))
        return count, int(taken[-1])

    def dated(self, block: Block, columns: Sequence[np.ndarray], count: int, stop: int) -> tuple[int, int]:
        """Put dates, and whether flags are good, in the place of what was scanned; what is left of it."""
        text = np.frombuffer(block.text, dtype=np.uint8)
        for cells, column in zip(self._wanted, columns, strict=True):
            if isinstance(cells, Flags):
                column[:count] = np.isin(column[:count], cells.good)
            elif isinstance(cells, Stamps):
                dates, behind = _dates(cells, text, column[:count])
                if dates < count:  # that row is not plain
                    count, stop = dates, block.text.rfind(b"\n", 0, behind) + 1
        return count, stop


def _is_plain(cells: Cells) -> bool:
    if isinstance(cells, Flags):
        return not any(isinstance(good, str) for good in cells.good)
    return isinstance(cells, Numbers) or cells.pattern is None


def _dates(cells: Stamps, text: np.ndarray, column: np.ndarray) -> tuple[int, int]:
    """Put dates in the place of where they stand, up to the first that is not plain: its row, and where it stands."""
    if not column.size:
        return 0, 0
    starts, lengths = column >> 32, column & (2**32 - 1)
    stamps, known, zoned = iso_stamps(text, starts, lengths)
    dated = lengths > 0
    if not cells.zoned and known[first := int(dated.argmax())] and dated[first]:
        cells.zoned.add(bool(zoned[first]))
    known &= ~dated | (zoned == next(iter(cells.zoned), False))  # the two kinds do not mix
    column[:] = stamps
    count = column.size if known.all() else int(known.argmin())
    _keep_first(cells, text, starts[:count], lengths[:count])
    return count, int(starts[count]) if count < column.size else 0


def _keep_first(cells: Stamps, text: np.ndarray, starts: np.ndarray, lengths: np.ndarray) -> None:
    """Keep the texts of the first dates."""
    there = np.flatnonzero(lengths)[: cells.MANY - len(cells.first)]
    spans = zip(starts[there].tolist(), lengths[there].tolist(), strict=True)
    cells.first.extend(text[start : start + length].tobytes().decode().strip() for start, length in spans)
