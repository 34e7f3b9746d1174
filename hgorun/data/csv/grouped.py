"""Points that may stand between thousands: 1.234 is more than a thousand in some countries, and a little more than one
in others.

Nothing in such a cell says which. The file may: with decimals of other lengths, with decimal commas, with numbers that
would jump.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import zip_longest

import numpy as np

from hgorun.data.csv.units_row import NUMBER
from hgorun.data.faults.sentinels import are_usual, sentinels
from hgorun.patterns import Pattern
from hgorun.pieces import everywhere, extremes

_GROUPED = Pattern(r"[-+]?[1-9]\d{0,2}\.\d{3}", re.ASCII)
_SMALL = Pattern(r"[-+]?\d{1,3}", re.ASCII)
_LARGE = Pattern(r"[-+]?[1-9]\d{3,}", re.ASCII)
_COMMA = Pattern(r"[-+]?\d+,(?!\d{3}$)\d+", re.ASCII)  # decimals for sure
_OF_SHEETS = (";", "\t")  # which separate columns where commas are decimal signs
_FEWEST = 3  # numbers that show how a column is written
_JUMP = 20.0  # times the smallest: so large is no whole number among decimals
_FALL = 200.0  # times the next one: so much less is a number whose thousand is read as one


def may_be_grouped(rows: Sequence[Sequence[str]], separator: str) -> frozenset[int]:
    """Columns whose points are read as decimal signs, and may stand between thousands.

    Parameters
    ----------
    rows : sequence of sequence of str
        The first ones, with empty texts for missing values.
    separator : str
    """
    columns = [
        [text.strip() for text in column if text.strip() and not _may_be_missing(text.strip())]
        for column in zip_longest(*rows, fillvalue="")
    ]
    texts = {text for column in columns for text in column}
    commas = any(map(_COMMA.fullmatch, texts))
    decimals = any("." in text and NUMBER.fullmatch(text) and not _GROUPED.fullmatch(text) for text in texts)
    untold = separator in _OF_SHEETS and not decimals and not any(map(_LARGE.fullmatch, texts))
    return frozenset(k for k, column in enumerate(columns) if _is_doubtful(column, commas=commas, untold=untold))


def _may_be_missing(text: str) -> bool:
    """Whether a text is a number of four digits or more that may stand for a missing value, such as -9999."""
    return _LARGE.fullmatch(text) is not None and bool(are_usual(np.array(float(text))))


def _is_doubtful(column: Sequence[str], *, commas: bool, untold: bool) -> bool:
    """Whether a column has points before three digits alone, and the file shows that they group, or shows nothing."""
    pointed = [abs(float(text)) for text in column if _GROUPED.fullmatch(text)]
    whole = [abs(float(text)) for text in column if _SMALL.fullmatch(text)]
    if len(pointed) < _FEWEST or len(pointed) + len(whole) < len(column):
        return False
    return commas or max(whole, default=0.0) > _JUMP * min(pointed) or (untold and not whole)


def still_may_be(values: np.ndarray) -> bool:
    """Whether all numbers of a column can be groups of three digits, as the first ones can, or be none of it."""
    return everywhere(_may_be, values)  # most columns show within a few numbers that they are none


def _may_be(values: np.ndarray) -> np.ndarray:
    sizes = np.abs(values)
    large = sizes >= 1000
    fits: np.ndarray = (~large & ((sizes >= 1) | (sizes == 0))) | ~np.isfinite(sizes)
    if large.any():
        fits[large] |= are_usual(sizes[large])
    return fits


def first_doubt(values: np.ndarray, text_of: Callable[[int], str]) -> tuple[int, str, str] | None:
    """Where a column of whole numbers goes on with numbers of three decimals that may be thousands, or ends them.

    They are some hundred times less than the whole number beside, or end with a zero where whole ones have no point:
    who writes three decimals writes them of all. Numbers that stand for a missing value are left out: see
    :func:`hgorun.data.faults.sentinels.sentinels`.

    Parameters
    ----------
    values : ndarray of float, shape (n,)
        Of the whole column, NaN where missing.
    text_of : callable
        The cell of a place, as the file writes it: a last zero is not in its number.

    Returns
    -------
    tuple of (int, str, str) or None
        The place of the first one beside such a whole number, how it is written, and the whole one; None
        where the column is not so.
    """
    if not still_may_be(values):
        return None
    for number, _, _ in sentinels(values):
        values = np.where(values == number, np.nan, values)
    least, largest = extremes(values)
    if not max(largest, -least) < 1000 or everywhere(_is_whole, values):
        return None
    places = np.flatnonzero(np.isfinite(values))
    sizes = np.abs(values[places])
    whole = sizes == np.floor(sizes)
    pointed = sizes[~whole]
    written = np.round(pointed, 3) == pointed
    if pointed.size < _FEWEST or not written.all():
        return None
    large, small = whole & (sizes >= _FALL), sizes >= 1  # 1.000 is a whole one, too
    falls = large[:-1] & small[1:] & (sizes[:-1] >= _FALL * sizes[1:])
    rises = large[1:] & small[:-1] & (sizes[1:] >= _FALL * sizes[:-1])
    if not (found := np.flatnonzero(falls | rises)).size:
        return _with_zero(values, places, text_of)
    first = int(found[0])
    point, other = (first + 1, first) if falls[first] else (first, first + 1)
    if np.all(np.round(pointed, 2) == pointed) and not _GROUPED.fullmatch(text_of(int(places[point]))):
        return None
    return int(places[point]), f"{values[places[point]]:.3f}", f"{values[places[other]]:.0f}"


def _is_whole(values: np.ndarray) -> np.ndarray:
    whole: np.ndarray = (values == np.floor(values)) | ~np.isfinite(values)
    return whole


def _with_zero(values: np.ndarray, places: np.ndarray, text_of: Callable[[int], str]) -> tuple[int, str, str] | None:
    """The same of a number whose third decimal is a zero, beside whole ones without a point; places of all that are."""
    there = values[places]
    whole = places[(there == np.floor(there)) & (np.abs(there) > 1)]
    in_tens = places[(there != np.floor(there)) & (np.round(there, 2) == there)]
    if whole.size < _FEWEST or not in_tens.size:
        return None
    first = int(in_tens[0])
    above = int(whole[max(np.searchsorted(whole, first) - 1, 0)])
    sample, beside = text_of(first), text_of(above)
    return (first, sample, beside) if _GROUPED.fullmatch(sample) and _SMALL.fullmatch(beside) else None


def told(column: str, sample: str, beside: str = "") -> str:
    """What is told of such a column, of one of its numbers, and of a whole one beside it."""
    near = f" beside {beside}" if beside else ""
    return (
        f"column {column!r}: the point in {sample}{near} is read as a decimal point, and nothing tells whether it "
        'stands between thousands: csv: {thousands: "."} says that it does, {decimal: "."} that it does not'
    )
