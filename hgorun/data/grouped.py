"""Points that may stand between thousands: 1.234 is more than a thousand in some countries, and a little more than one
in others.

Nothing in such a cell says which. The file may: with decimals of other lengths, with decimal commas, with numbers that
would jump.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np

from hgorun.data.units_row import NUMBER

_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}\.\d{3}", re.ASCII)
_SMALL = re.compile(r"[-+]?\d{1,3}", re.ASCII)
_LARGE = re.compile(r"[-+]?[1-9]\d{3,}", re.ASCII)
_COMMA = re.compile(r"[-+]?\d+,(?!\d{3}$)\d+", re.ASCII)  # decimals for sure
_OF_SHEETS = (";", "\t")  # which separate columns where commas are decimal signs
_FEWEST = 3  # numbers that show how a column is written
_JUMP = 20.0  # times the smallest: so large is no whole number among decimals


def may_be_grouped(rows: Sequence[Sequence[str]], separator: str) -> frozenset[int]:
    """Columns whose points are read as decimal signs, and may stand between thousands.

    Parameters
    ----------
    rows : sequence of sequence of str
        The first ones, with empty texts for missing values.
    separator : str
    """
    columns = [[text.strip() for text in column if text.strip()] for column in zip_longest(*rows, fillvalue="")]
    texts = {text for column in columns for text in column}
    commas = any(map(_COMMA.fullmatch, texts))
    decimals = any("." in text and NUMBER.fullmatch(text) and not _GROUPED.fullmatch(text) for text in texts)
    untold = separator in _OF_SHEETS and not decimals and not any(map(_LARGE.fullmatch, texts))
    return frozenset(k for k, column in enumerate(columns) if _is_doubtful(column, commas=commas, untold=untold))


def _is_doubtful(column: Sequence[str], *, commas: bool, untold: bool) -> bool:
    """Whether a column has points before three digits alone, and the file shows that they group, or shows nothing."""
    pointed = [abs(float(text)) for text in column if _GROUPED.fullmatch(text)]
    whole = [abs(float(text)) for text in column if _SMALL.fullmatch(text)]
    if len(pointed) < _FEWEST or len(pointed) + len(whole) < len(column):
        return False
    return commas or max(whole, default=0.0) > _JUMP * min(pointed) or (untold and not whole)


def still_may_be(values: np.ndarray) -> bool:
    """Whether all numbers of a column can be groups of three digits, as the first ones can."""
    sizes = np.abs(values[np.isfinite(values)])
    return bool(np.all((sizes < 1000) & ((sizes >= 1) | (sizes == 0))))


def told(column: str, sample: str) -> str:
    """What is told of such a column."""
    return (
        f"column {column!r}: the point in {sample} is read as a decimal point, and nothing tells whether it stands "
        'between thousands: csv: {thousands: "."} says that it does, {decimal: "."} that it does not'
    )
