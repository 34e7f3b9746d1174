"""What was found in a log, once: signals that share a clock share its faults."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeAlias

from hgorun.data.recording import Note

_NAMED = 6  # signals that are named, of those with one fault

_Fault: TypeAlias = tuple[str, ...]


def told_once(notes: Sequence[Note]) -> Iterator[Note]:
    """Some notes, each fault in one that names its signals, at the place of the first.

    Those of missing values are one for each file: columns of several rates leave cells empty.
    """
    faults: dict[_Fault, list[Note]] = {}
    for note in dict.fromkeys(notes):
        faults.setdefault(_fault(note), []).append(note)
    for (kind, *_), several in faults.items():
        if len(several) == 1:
            yield several[0]
        else:
            yield _missing(several) if kind == "missing" else _of_all(several)


def _fault(note: Note) -> _Fault:
    if note.kind == "missing":
        return note.kind, note.file
    return note.kind, note.file, str(note.line), str(note.count), note.message


def _missing(notes: Sequence[Note]) -> Note:
    counts = ", ".join(f"{one.count:,} of {one.signal}" for one in notes)
    message = f"samples left out: the value is missing ({counts})"
    first, total = min(one.line for one in notes), sum(one.count for one in notes)
    return Note(kind="missing", signal="", file=notes[0].file, line=first, count=total, message=message)


def _of_all(notes: Sequence[Note]) -> Note:
    """A fault of several signals, with what follows from it for some of them."""
    signals = [one.signal for one in notes]
    if len(signals) > _NAMED:
        signals[_NAMED - 1 :] = [f"and {len(signals) - _NAMED + 1} more"]
    consequence = next((one.consequence for one in notes if one.consequence), "")
    return replace(notes[0], signal=", ".join(signals), consequence=consequence)
