"""Lines of a text file that belong to rows, one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.marked_rows import is_tag
from hgorun.data.csv.splitting import cells_of
from hgorun.data.csv.text import Block
from hgorun.data.csv.units_row import is_value


class RowLines:
    """Lines from the first row of values on, without comments and empty ones, but for those inside quotes.

    Attributes
    ----------
    begin, end : int
        The line on which the present row began, and the last one so far.
    inside : int
        How many of its lines, behind the first, look like rows.
    separator, text : str
        Between cells, and the last line so far.
    tags : list of (int, str)
        Rows that begin as comments do, with their tags.
    judge : callable
        Gets every comment with its line.
    """

    def __init__(
        self,
        blocks: Iterator[Block],
        dialect: Dialect,
        tags: list[tuple[int, str]],
        judge: Callable[[int, str], None],
    ) -> None:
        self._lines = _numbered(blocks)
        self._dialect = dialect
        self.separator = dialect.separator
        self._open = False
        self.begin = self.end = dialect.first
        self.inside, self.text = 0, ""
        self.tags, self.judge = tags, judge

    def taken(self) -> int:
        """Where the row began that has ended now."""
        self._open, self.inside = False, 0
        return self.begin

    def __iter__(self) -> Iterator[str]:
        d = self._dialect
        for number, text in self._lines:
            if not self._open:
                if number < d.first or not text.strip():
                    continue
                if d.is_comment(text):
                    self.judge(number, text)
                    continue
                self._open, self.begin = True, number
                if d.words and is_tag(first := cells_of(text, d.separator)[0]) and text.lstrip().startswith(d.comment):
                    self.tags.append((number, first.strip()))
            else:
                self.inside += self._looks_like_a_row(text)
            self.end, self.text = number, text
            yield f"{text}\n"  # inside quotes it belongs to the cell

    def _looks_like_a_row(self, text: str) -> bool:
        """Whether a line has as many cells as a row, and a number or a date among them."""
        found = cells_of(text, self._dialect.separator)
        return len(found) == self._dialect.width and any(map(is_value, found))


def _numbered(blocks: Iterator[Block]) -> Iterator[tuple[int, str]]:
    for block in blocks:
        lines = block.text.decode("utf-8").split("\n")
        lines.pop()  # behind the last newline
        yield from enumerate(lines, start=block.line)
