"""Samples of one quantity, with the places where they stand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Samples:
    """As they stand in the files, row by row.

    Attributes
    ----------
    key : str
        Of the signal, such as ``outputs.S``.
    taken, available, values : ndarray, shape (n,)
        NaN where missing; ``available`` is ``taken`` where there is no such column.
    lines, part : ndarray of integers, shape (n,)
        Where each row stands, and in which of the sources; ``part`` is empty where there is one source.
    good : ndarray of float, optional
        Whether the quality of each value is good; None without such a column.
    sources : tuple of Path
    time_unit : str
        In which messages say times: that of the files where their times are numbers, else that of the run.
    coarse : float
        How far apart doubles are where the stamps are so large that different ones may be the same one; else 0.
    doubt : str
        What is added where values are refused: that the file may mean other numbers.
    """

    key: str
    taken: np.ndarray
    available: np.ndarray
    values: np.ndarray
    lines: np.ndarray
    part: np.ndarray
    good: np.ndarray | None
    sources: tuple[Path, ...]
    time_unit: str
    coarse: float = 0.0
    doubt: str = ""

    @property
    def late(self) -> bool:
        """Whether there is a column that says when values were known."""
        return self.available is not self.taken

    def place(self, k: int) -> tuple[str, int]:
        """File and line of a sample."""
        source = self.sources[int(self.part[k])] if self.part.size else self.sources[0]
        return str(source), int(self.lines[k])

    def at(self, kept: np.ndarray) -> Samples:
        """Some of them: a mask, or indices."""
        if kept.dtype == bool and kept.all():
            return self
        taken = self.taken[kept]
        return replace(
            self,
            taken=taken,
            available=self.available[kept] if self.late else taken,
            values=self.values[kept],
            lines=self.lines[kept],
            part=self.part[kept] if self.part.size else self.part,
            good=None if self.good is None else self.good[kept],
        )
