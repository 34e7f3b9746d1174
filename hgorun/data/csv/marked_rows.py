"""Rows that begin as comments do: their first cell is an error of a spreadsheet, such as #DIV/0!, or a tag, such as #2.

A row that is taken for a comment is lost without a word, and so is a comment that is taken for a row.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from hgorun.data.csv.splitting import SPACES, cells_of
from hgorun.patterns import Pattern

_MARK = "#"
_ERROR = Pattern(
    r"#(?:N/?[AV](?: N/?[AV])?|¡?[A-ZÀ-Ý][A-Za-zÀ-ÿ0-9_/]*[!?]|GETTING_DATA"
    r"|(?i:error|bad|deleted|nan|inf|null|overflow|ovl|ref|value|num|name))"
)
_NARROW = Pattern(r"#{3,}")  # for a number that is wider than its column
_DIGITS = Pattern(r"\d+")
_TAG = Pattern(r"#\w*\d\w*")


def is_marked_row(line: str, sign: str, separator: str, width: int, words: Collection[str]) -> bool:
    """Whether a line that begins with the sign of comments is such a row.

    Parameters
    ----------
    line, sign, separator : str
    width : int
        How many columns there are.
    words : collection of str
        The first cells of other rows where these are words, see :func:`words_in`. One of them behind the sign is a
        row that somebody has made a comment.
    """
    if sign != _MARK:
        return False
    cells = cells_of(line, separator)
    if len(cells) != width and (len(cells) != width + 1 or cells[-1].strip()):
        return False
    first = cells[0].strip()
    if _ERROR.fullmatch(first) or separator == SPACES:  # words of a comment may be as many as the columns
        return _ERROR.fullmatch(first) is not None
    if _NARROW.fullmatch(first):
        return True
    form = _without_digits(first[1:])
    return is_tag(first) and bool(words) and all(_without_digits(word) != form for word in words)


def _without_digits(name: str) -> str:
    """What names have in common that are counted on."""
    return _DIGITS.sub("0", name)


def is_tag(cell: str) -> bool:
    """Whether a cell may be a tag: the mark, and behind it a number or a name with one."""
    return _TAG.fullmatch(cell.strip()) is not None


def words_in(firsts: Iterable[str]) -> frozenset[str]:
    """The first cells of rows, if each is a word or a tag, or empty; else none."""
    texts = {text.strip() for text in firsts} - {""}
    return frozenset(texts) if all(text[0].isalpha() or is_tag(text) for text in texts) else frozenset()
