"""What stands for a missing value in the files of a log: texts, and numbers such as -9999."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.config.data import MISSING, Csv
from hgorun.data.cells import Numbers


def missing_texts(told: Csv) -> frozenset[str]:
    """Texts in small letters."""
    return frozenset((*MISSING, *(text.strip().lower() for text in told.missing)))


def missing_numbers(told: Csv, decimal: str) -> tuple[float, ...]:
    """What is told that is a number: as the file writes numbers, else with a decimal point, as YAML does."""
    readers = (Numbers("").reader(decimal, frozenset(), told.thousands), Numbers("").reader(".", frozenset()))
    found = []
    for text in told.missing:
        for read in readers:
            try:
                found.append(float(read(text)))
                break
            except ValueError:
                continue
    return tuple(found)


def leave_out(numbers: Sequence[float], values: np.ndarray) -> None:
    """Put NaN in the place of numbers that stand for a missing value."""
    for number in numbers:
        values[values == number] = np.nan
