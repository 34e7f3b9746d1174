"""Dates of one log that are too far apart for whole nanoseconds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.data.clocks import ClockColumn
from hgorun.data.sources import LogFile
from hgorun.data.table import Table
from hgorun.data.times.dates import NAT
from hgorun.errors import ConfigError

_MOST = 2**63 - 1  # nanoseconds


def require_near(
    stamps: Mapping[tuple[LogFile, ClockColumn], np.ndarray], tables: Mapping[LogFile, Table], origin: int | None = None
) -> None:
    """Refuse dates more than 292 years away from each other, or from an origin.

    Parameters
    ----------
    stamps : mapping of (LogFile, ClockColumn) to ndarray of int64
        Nanoseconds since 1970.
    tables : mapping of LogFile to Table
    origin : int, optional

    Raises
    ------
    ConfigError
    """
    there = [_there(found) for found in stamps.values()]
    starts = [origin] if origin is not None else [int(one) for found in there if found.size for one in _ends(found)]
    for start in starts:
        low, high = max(start - _MOST, NAT + 1), min(start + _MOST, _MOST)
        for ((file, clock), found), some in zip(stamps.items(), there, strict=True):
            if some.size and (some.min() < low or some.max() > high):
                k = int((((found < low) | (found > high)) & (found != NAT)).argmax())
                date, other = (str(np.datetime64(one, "ns"))[:10] for one in (int(found[k]), start))
                beside = f"{other} in this log" if origin is None else f"the origin, {other}"
                message = f"{date} is more than 292 years away from {beside}: times in nanoseconds reach no further"
                raise ConfigError(message, file=str(file.path), line=int(tables[file].lines[k]), key=clock.cells.column)


def _there(found: np.ndarray) -> np.ndarray:
    """Without missing stamps: itself where there are none."""
    return found[found != NAT] if np.any(found == NAT) else found


def _ends(found: np.ndarray) -> tuple[np.int64, np.int64]:
    """The first stamp, beside which another one is told, and the earliest one."""
    return found[0], found.min()
