"""The lines of a block that are no comments and not empty, of which machine code reads row after row."""

from __future__ import annotations

import string
from collections.abc import Iterator

import numpy as np

from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.text import Block

_BEHIND_MARK = string.ascii_uppercase + "#"
_OF_TAGS = string.digits + string.ascii_letters + "_"


class KeptLines:
    """A block without its comments, as far as no row has a quote: from there on an end of a line may belong to a cell.

    Parameters
    ----------
    block : Block
    dialect : Dialect
        Whose sign of comments is one byte.

    Attributes
    ----------
    numbers : ndarray of int, shape (n,)
        Of the lines that are kept.
    block : Block
        These alone.
    comments : list of (int, str)
        Those with as many separators as a row, with their lines.
    """

    def __init__(self, block: Block, dialect: Dialect) -> None:
        self._whole = block
        self.comments: list[tuple[int, str]] = []
        text = np.frombuffer(block.text, dtype=np.uint8)
        starts = np.append(0, np.flatnonzero(text == ord("\n")) + 1)
        left_out = self._left_out(text, starts[:-1], dialect)
        kept = np.flatnonzero(~left_out)
        self.numbers = (block.line + kept).astype(np.int32)
        self._starts = np.append(starts[kept], text.size)  # in the whole block
        self.block, self._places = block, self._starts
        if kept.size < left_out.size:
            lengths = np.diff(starts)
            self.block = Block(text[np.repeat(~left_out, lengths)].tobytes(), block.line)
            self._places = np.append(0, np.cumsum(lengths[kept]))

    def _left_out(self, text: np.ndarray, starts: np.ndarray, dialect: Dialect) -> np.ndarray:
        """Which lines are comments or empty, by their first byte: others with spaces in front are left to others."""
        first = text[starts]
        found: np.ndarray = (first == ord("\n")) | (first == ord(dialect.comment))
        comments = np.flatnonzero(found & (first != ord("\n")))
        like = _second_bytes(dialect)[text[starts[comments] + 1]]
        for line in comments[like].tolist():  # which may begin with a text for a missing value, as #N/A
            start = int(starts[line])
            end = self._whole.text.index(b"\n", start)
            row = self._whole.text[start:end].decode("utf-8", "replace")
            found[line] = dialect.is_comment(row)
        if b'"' in self._whole.text:
            lines = np.searchsorted(starts, np.flatnonzero(text == ord('"')), side="right") - 1
            of_rows = lines[~found[lines]]
            found[of_rows[0] if of_rows.size else found.size :] = False
        self.comments += self._as_rows(text, starts, comments[found[comments]], dialect)
        return found

    def _as_rows(
        self, text: np.ndarray, starts: np.ndarray, comments: np.ndarray, dialect: Dialect
    ) -> Iterator[tuple[int, str]]:
        """Those of some comments that have as many separators as a row, and one more at most."""
        if not comments.size:
            return
        before = np.searchsorted(np.flatnonzero(text == ord(dialect.separator)), np.append(starts, text.size))
        more = np.diff(before)[comments] - len(dialect.names)
        for line in comments[(more == -1) | (more == 0)].tolist():
            start = int(starts[line])
            row = self._whole.text[start : self._whole.text.index(b"\n", start)]
            yield self._whole.line + line, row.decode("utf-8", "replace")

    def place(self, row: int) -> int:
        """The byte of :attr:`block` with which a kept line begins."""
        return int(self._places[row])

    def original(self, row: int, stop: int) -> Block:
        """Kept lines with what stands between them."""
        return Block(self._whole.text[self._starts[row] : self._starts[stop]], int(self.numbers[row]))


def _second_bytes(dialect: Dialect) -> np.ndarray:
    """Which bytes may follow the sign of comments in a row: one whose first cell is a text for a missing value, or as
    :func:`hgorun.data.csv.marked_rows.is_marked_row` has it."""
    found = np.zeros(256, dtype=bool)
    found[[*map(ord, _BEHIND_MARK)]] = True
    found[128:] = True  # letters, also capital ones of i and k, and spaces
    if dialect.words:
        found[[*map(ord, _OF_TAGS)]] = True
    for one in dialect.missing:
        if not one.startswith(dialect.comment):
            continue
        if one == dialect.comment:  # the cell ends
            found[[*b" \t\n\v\f\r\x1c\x1d\x1e\x1f", ord(dialect.separator)]] = True
            continue
        found[[*one[1].encode()[:1], *one[1].upper().encode()[:1]]] = True
    return found
