"""What stands for a missing value in the files of a log: texts, and numbers such as -9999."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hgorun.config.data import MISSING, Csv
from hgorun.data.cells import Numbers
from hgorun.data.recording import Note


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


def told_once(notes: Sequence[Note]) -> Iterator[Note]:
    """Some notes, with those of missing values in one for each file: columns of several rates leave cells empty."""
    of_files: dict[str, list[Note]] = {}
    for note in dict.fromkeys(notes):
        if note.kind == "missing":
            of_files.setdefault(note.file, []).append(note)
    for note in dict.fromkeys(notes):
        if note.kind != "missing" or len(several := of_files.pop(note.file, [])) == 1:
            yield note
        elif several:
            counts = ", ".join(f"{one.count:,} of {one.signal}" for one in several)
            message = f"samples left out: the value is missing ({counts})"
            first, total = min(one.line for one in several), sum(one.count for one in several)
            yield Note(kind="missing", signal="", file=note.file, line=first, count=total, message=message)
