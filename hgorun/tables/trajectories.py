"""Trajectories of a result as text, for spreadsheets and other programs."""

from __future__ import annotations

import csv as csv_module
import io
import math
from collections.abc import Iterator

import numpy as np

from hgorun.result.records.data import PLANT, ResultData
from hgorun.tables.typeset import printable

_ROUNDING = 64 * float(np.finfo(float).eps)  # of sums that times are made by, relative to the longest time


def csv(result: ResultData) -> str:
    """The states over time, a line for every time and source: the plant where it was simulated, and every observer.

    Estimates of recorded data have their bands besides. Numbers have all their digits; what is undefined is empty.
    Where the plant states units of its states, they stand in the header: ``t [h],observer,x1 [g/L]``.
    """
    buffer = io.StringIO()
    writer = csv_module.writer(buffer, lineterminator="\n")
    recorded = result.recorded is not None
    bands = [(state, f"{state}_{end}") for state in result.states for end in ("lower", "upper")] if recorded else []
    columns = [(state, state) for state in result.states] + bands
    known = any(result.units.get(state) for state in result.states)
    t = _headed("t", result.units.get("time", "")) if known else "t"
    writer.writerow([t, "observer", *(_headed(name, result.units.get(state, "")) for state, name in columns)])
    times = _on_grid(result.time).tolist()
    for label, values in _sources(result):
        for t, row in zip(times, values.tolist(), strict=True):
            writer.writerow([repr(t), label, *(repr(v) if v == v else "" for v in row)])
    return buffer.getvalue()


def _on_grid(time: np.ndarray) -> np.ndarray:
    """The times of an even grid with as few digits as tell them: 24.7 for 24.69999999999991.

    Nothing is left out but the rounding of sums: a time of another grid, such as k/3, keeps all its digits.
    """
    if time.size < 2:
        return time
    step = float(time[-1] - time[0]) / (time.size - 1)
    digits = 9 - math.floor(math.log10(step)) if step > 0 else 0
    short = np.array([round(t, digits) for t in time.tolist()])
    close = np.abs(short - time) <= _ROUNDING * np.max(np.abs(time))
    return np.where(close, short, time)


def _headed(name: str, unit: str) -> str:
    """The name of a column, with its unit where that is known."""
    return f"{name} [{printable(unit)}]" if unit else name


def _sources(result: ResultData) -> Iterator[tuple[str, np.ndarray]]:
    """Labels, and their columns of numbers, shape (Nt, n) or (Nt, 3 n)."""
    if result.recorded is None:
        yield PLANT, result.x
    for label, one in result.observers.items():
        if one.assessed is None:
            yield label, one.xhat
        else:
            ends = np.stack([one.assessed.lower, one.assessed.upper], axis=2)
            yield label, np.column_stack([one.xhat, ends.reshape(len(one.xhat), -1)])
