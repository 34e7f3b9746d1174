"""A log in several files: columns that some of them lack, and units that are not the same in all of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from hgorun.data.clocks import ClockColumn
from hgorun.data.column_meant import column_meant
from hgorun.data.recording import Note
from hgorun.data.sources import LogFile, Wanted
from hgorun.data.units.factored_units import has_factor
from hgorun.data.units.named_units import of_one_kind, without_unit
from hgorun.data.units.units import alike_times, foreign, is_time, is_unit
from hgorun.data.units.written_units import reference_of, without_reference
from hgorun.errors import KeyPath, Problem

_BEHIND_NAMES = re.compile(r"[ _/,](?:\s*in )?")  # a unit stands


def lacking_columns(signals: Sequence[Wanted], files: Sequence[LogFile], path: KeyPath) -> Iterator[Note]:
    """What is told of files that lack a column which others have.

    Parameters
    ----------
    signals : sequence of Wanted
    files : sequence of LogFile
        Those of all signals that name no file of their own.
    path : KeyPath
        The key that names them.

    Raises
    ------
    Problem
        Where a file has the column by another spelling, or none that is read: its rows would be lost.
    """
    shared = [signal for signal in signals if signal.block.file is None]
    stands = {signal: [part.file.path for part in signal.parts] for signal in shared}
    for file in files if shared else ():
        here = [signal for signal in shared if file.path in stands[signal]]
        read = {cells.column for other in files if other.path == file.path for cells in other.wanted}
        unread = [name for name in file.table.names if name not in read]
        lacking = [signal for signal in shared if signal not in here]
        for signal in lacking:
            _require_no_other_spelling(signal, file, unread)
        if not here:
            columns = ", ".join(dict.fromkeys(repr(signal.block.column) for signal in shared))
            meant = column_meant(shared[0].block.column, unread)
            raise Problem(path, f"{file.path} has none of the columns that are read: {columns}.{meant}")
        beside = {place for signal in here for place in stands[signal] if place != file.path}
        for signal in lacking:
            if beside.intersection(stands[signal]):
                told = f"no column {signal.block.column!r}: read from other files alone"
                yield Note(kind="format", signal=signal.key, file=str(file.path), message=told)


def _require_no_other_spelling(signal: Wanted, file: LogFile, unread: Sequence[str]) -> None:
    column = signal.block.column
    alike = next((name for name in unread if _bare(name) == _bare(column) or _are_one(name, column)), None)
    if alike is not None:
        others = ", ".join(str(part.file.path) for part in signal.parts)
        message = (
            f"{file.path} has {alike!r} where {others} has {column!r}: a log in parts has one name for it in all of "
            f"them; if it is something else, file: below {signal.key} names the file to read"
        )
        raise Problem((*signal.path, "column"), message)


def _bare(name: str) -> str:
    """A name without what may be written in another way."""
    return " ".join(without_unit(name).replace("_", " ").split()).casefold()


def _are_one(name: str, column: str) -> bool:
    """Whether two names are one, with a unit behind one of them or different ones behind both: m and mm."""
    if _with_unit(name, column) or _with_unit(column, name):
        return True
    ends = [place.end() for place in _BEHIND_NAMES.finditer(name, 1)]
    units = [(name[end:], column[end:]) for end in ends if name[:end].casefold() == column[:end].casefold()]
    return any(
        of_one_kind(*map(_plain, two)) for two in units if not any(is_time(one) or has_factor(one) for one in two)
    )


def _with_unit(name: str, column: str) -> bool:
    """Whether a name is another one with a unit behind it: ``level_mm``, ``level in mm``."""
    end = name[len(column) :]
    unit = end.strip(" _/,").removeprefix("in ")
    begins = name.casefold().startswith(column.casefold()) and end[:1] in (" ", "_", "/", ",")
    return begins and len(unit) > 1 and not (unit.isdigit() or has_factor(unit)) and is_unit(unit)


def require_one_unit(
    column: str, said: Mapping[str, str], alike: Callable[[str, str], bool], path: KeyPath, otherwise: str = ""
) -> None:
    """Refuse units that differ from file to file: one key says that of all.

    Parameters
    ----------
    column : str
    said : mapping of str to str
        What each file says; empty where it says nothing.
    alike : callable
        Whether two texts mean one unit.
    path : KeyPath
        What has the key.
    otherwise : str
        What else would be right.

    Raises
    ------
    Problem
    """
    for (first, one), (second, other) in combinations([item for item in said.items() if item[1]], 2):
        if not alike(one, other) and _are_two(one, other, alike):
            message = (
                f"column {column!r}: {first} says {one} and {second} {other}, and a unit is that of all files: "
                f"write the numbers in one unit, and say so in each{otherwise}"
            )
            raise Problem(path, message)


def _are_two(unit: str, other: str, alike: Callable[[str, str], bool]) -> bool:
    """Whether texts that are not alike say two units, also of two zeros of a pressure or two conditions of a volume."""
    plain, of = _plain(unit), _plain(other)
    if (plain, of) != (unit, other) and alike(plain, of):
        return reference_of(unit) != reference_of(other)
    return (is_unit(plain) and is_unit(of)) or foreign(unit, other)


def _plain(unit: str) -> str:
    """A unit without what is told of a zero of pressure or of conditions."""
    return without_reference(unit) or unit


def require_one_time_unit(clocks: Iterable[tuple[LogFile, ClockColumn]]) -> None:
    """Refuse files that say different units of the stamps that one key names.

    Raises
    ------
    Problem
    """
    said: dict[tuple[KeyPath, str], dict[str, str]] = {}
    for file, clock in clocks:
        column = clock.cells.column
        said.setdefault((clock.path, column), {})[str(file.path)] = file.table.unit(column).partition(" since ")[0]
    for (path, column), units in said.items():
        require_one_unit(column, units, alike_times, path, "; a signal with a file of its own takes a time of its own")


def but_silent(said: Mapping[str, str]) -> str:
    """What advice on the unit of a log does not know: files that say none."""
    silent = [file for file, unit in said.items() if not unit]
    return f"; unit is that of all files, and {', '.join(silent)} says none" if 0 < len(silent) < len(said) else ""


def silent_parts(column: str, said: Mapping[str, str], taken: str, key: str) -> Iterator[Note]:
    """What is told of files that say no unit, where others do and the numbers of all are taken in it."""
    saying = next((file for file, unit in said.items() if unit), "")
    for file, unit in said.items():
        if saying and not unit:
            told = f"column {column!r}: no unit is said here, and {saying} says {said[saying]}: taken in {taken}, too"
            yield Note(kind="units", signal=key, file=file, message=told)
