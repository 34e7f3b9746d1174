"""Many dates at once, as nanoseconds since 1970: of a text, each like the first of its length, and of numbers."""

from __future__ import annotations

import numpy as np

from hgorun.data.times.intervals import ZONE_OFFSETS
from hgorun.pieces import distinct

NAT = int(np.iinfo(np.int64).min)
"""The stamp of a missing date: that of numpy."""

_LONGEST = 35  # characters: nanoseconds and a zone
_SECOND = 10**9
_RANGE = 0.99 * 2.0**63


def iso_stamps(text: np.ndarray, starts: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Dates of ISO 8601 in a text.

    Parameters
    ----------
    text : ndarray of uint8
    starts, lengths : ndarray of integers, shape (n,)
        Where each date stands; of no length where one is missing.

    Returns
    -------
    stamps : ndarray of int64, shape (n,)
        Nanoseconds since 1970, ``NAT`` for missing ones.
    known, zoned : ndarray of bool, shape (n,)
        False where a cell is no date, or none of a usual form; whether it names a zone.
    """
    stamps = np.full(starts.size, NAT, dtype=np.int64)
    known, zoned = lengths == 0, np.zeros(starts.size, dtype=bool)
    for length in distinct(lengths[(lengths > 0) & (lengths <= _LONGEST)]).tolist():
        rows = np.flatnonzero(lengths == length)
        cells = text[starts[rows, None] + np.arange(length)]
        stamps[rows], known[rows], with_zone = _of_one_length(cells)
        zoned[rows] = with_zone
    return stamps, known, zoned


def counted(values: np.ndarray, unit: int, start: int) -> tuple[np.ndarray, int | None]:
    """Dates from numbers that count from one.

    Parameters
    ----------
    values : ndarray of floats or integers
        NaN where one is missing.
    unit, start : int
        What is counted, in nanoseconds, and from where, in nanoseconds since 1970.

    Returns
    -------
    stamps : ndarray of int64
        Nanoseconds since 1970, ``NAT`` for missing ones.
    wrong : int or None
        The first that is not between 1678 and 2262, or about that.
    """
    if values.dtype.kind == "f":
        values = values.astype(float, copy=False)  # single precision has too few digits of a part
    there = ~np.isnan(values)
    first, rest = divmod(start, unit)  # small numbers, wherever they count from
    # in two parts: a date in nanoseconds has more digits than a float
    given = values if there.all() else np.where(there, values, -float(first))
    whole = given if given.dtype.kind in "iu" else np.floor(given)
    with np.errstate(over="ignore"):
        nanoseconds = (whole + float(first)) * float(unit)
    inside = (np.abs(nanoseconds) < _RANGE) & (np.abs(whole.astype(float)) < _RANGE)
    if (wrong := np.flatnonzero(~inside)).size:
        return np.full(values.shape, NAT), int(wrong[0])
    parts = np.rint((given - whole) * float(unit)).astype(np.int64)
    return np.where(there, (whole.astype(np.int64) + first) * unit + rest + parts, NAT), None


def _of_one_length(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Stamps of cells of one length, which of them are dates of the form of the first, and whether that has a zone."""
    first = bytes(cells[0])
    signs = (b"+", b"-")
    zone = 6 if first[-6:-5] in signs and first[-3:-2] == b":" else 3 if first[-3:-2] in signs else 0  # +02:00, +02
    signed = zone > 0 and len(first) > 16
    plain = len(first) - (zone if signed else 1 if first.endswith(b"Z") else 0)
    form = _form(plain)
    if not form:
        return np.zeros(len(cells), dtype=np.int64), np.zeros(len(cells), dtype=bool), False
    mask = np.frombuffer(form.encode(), dtype=np.uint8)
    digits = np.flatnonzero(mask == ord("0"))
    right = np.all((cells[:, digits] >= ord("0")) & (cells[:, digits] <= ord("9")), axis=1)
    for place, sign in enumerate(form):
        if sign != "0":
            allowed = {"T": b"T ", ".": b".,"}.get(sign, sign.encode())
            right &= np.isin(cells[:, place], np.frombuffer(allowed, dtype=np.uint8))
    stamps, possible = _stamps(cells, plain)
    behind = cells[:, plain:]
    if signed:
        offset, fits = _offset(behind)
        return stamps - offset, right & possible & fits, True
    if plain < len(first):
        right &= behind[:, 0] == ord("Z")
    return stamps, right & possible, plain < len(first)


def _form(length: int) -> str:
    """What a date of a length looks like, without its zone; empty where there is none."""
    whole = "0000-00-00T00:00:00.000000000"
    return whole[:length] if length in (10, 16, 19) or 21 <= length <= len(whole) else ""


def _number(cells: np.ndarray, start: int, stop: int) -> np.ndarray:
    """The digits of some places."""
    powers = 10 ** np.arange(stop - start - 1, -1, -1, dtype=np.int64)
    number: np.ndarray = (cells[:, start:stop].astype(np.int64) - ord("0")) @ powers
    return number


def _stamps(cells: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Nanoseconds since 1970, and which of them are in the calendar."""
    year, month, day = (_number(cells, start, stop) for start, stop in ((0, 4), (5, 7), (8, 10)))
    hour = minute = second = np.zeros(len(cells), dtype=np.int64)
    if length >= 16:
        hour, minute = _number(cells, 11, 13), _number(cells, 14, 16)
    if length >= 19:
        second = _number(cells, 17, 19)
    fraction = _number(cells, 20, length) * 10 ** (29 - length) if length > 20 else 0
    months = (np.clip(year, 1678, 2261) - 1970) * 12 + np.clip(month, 1, 12) - 1
    begin = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    end = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    possible = (year >= 1678) & (year <= 2261) & (month >= 1) & (month <= 12) & (day >= 1) & (day <= end - begin)
    midnight = (hour == 24) & (minute == 0) & (second == 0) & (fraction == 0)  # at the end of the day
    possible &= ((hour < 24) | midnight) & (minute < 60) & (second < 60)
    seconds = ((begin + day - 1) * 24 + hour) * 3600 + minute * 60 + second
    return seconds * _SECOND + fraction, possible


def _offset(behind: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nanoseconds ahead of UTC of ``+02:00`` or ``+02``, and which cells have this form."""
    whole = behind.shape[1] > 3
    sign, digits = behind[:, 0], behind[:, [1, 2, 4, 5] if whole else [1, 2]]
    fits = np.isin(sign, np.frombuffer(b"+-", dtype=np.uint8))
    fits &= np.all((digits >= ord("0")) & (digits <= ord("9")), axis=1)
    hours, minutes = _number(behind, 1, 3), np.zeros(len(behind), dtype=np.int64)
    if whole:
        fits &= behind[:, 3] == ord(":")
        minutes = _number(behind, 4, 6)
    size = hours * 3600 + minutes * 60
    ahead = np.where(sign == ord("-"), -size, size)
    some = ZONE_OFFSETS
    fits &= (minutes < 60) & (ahead >= some.start) & (ahead < some.stop) & (ahead % some.step == 0)
    return ahead * _SECOND, fits
