"""The units of columns: what the files and the configuration say of them, and numbers in the units of a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from hgorun.data.parts import but_silent, require_one_unit, silent_parts
from hgorun.data.recording import Note
from hgorun.data.sources import LogFile, Wanted
from hgorun.data.units.denominators import per_unit_of
from hgorun.data.units.loose_units import remark_on_name
from hgorun.data.units.named_units import AnotherUnit, note_of, said_in_name, unit_in_name
from hgorun.data.units.units import alike, converted


@dataclass(frozen=True, eq=False, repr=False)
class ModelUnits:
    """The units in which a model takes the numbers of signals.

    Attributes
    ----------
    of : mapping of str to str
        By output, state and input.
    time : str
        The unit of the run's time.
    reference : str
        As of :func:`hgorun.data.reading.read`.
    """

    of: Mapping[str, str]
    time: str
    reference: str

    def said(self, signal: Wanted) -> str:
        """The unit of the numbers of a signal once they are converted; empty where nobody says it."""
        return self._wanted(signal) or signal.block.unit or signal.parts[0].file.table.unit(signal.block.column)

    def beside_another(self, signal: Wanted) -> str:
        """The unit in which limits of a signal are, in words, where its column has another one; else empty."""
        said, wanted = signal.block.unit, self._wanted(signal)
        return f" {wanted}, the model's unit" if said and wanted and not alike(said, wanted) else ""

    def converted(self, signal: Wanted, values: np.ndarray) -> np.ndarray:
        """Values of a signal in the unit of the model.

        Raises
        ------
        Problem
            When a unit is not known or when the two are of different kinds.
        """
        said, wanted = signal.block.unit, self._wanted(signal)
        return values if said is None or not wanted else converted(values, said, wanted, (*signal.path, "unit"))

    def told(self, signal: Wanted) -> Iterator[Note]:
        """What is told of the units that files say of a signal.

        Raises
        ------
        Problem
            When files say different ones, or the configuration does not say which of two is right.
        """
        said, wanted = signal.block.unit, self._wanted(signal)
        yield from self._silent(signal)
        for file in dict.fromkeys(part.file for part in signal.parts):
            yield from self._another(signal, file)
            if said is None and not wanted:
                yield from self._per_time(signal, file)
        if said is not None and not wanted:
            yield _note(
                signal, signal.parts[0].file, f"the model has no unit for {signal.name}: taken in {said} as they are"
            )

    def _wanted(self, signal: Wanted) -> str:
        return self.of.get(signal.name, "")

    def _silent(self, signal: Wanted) -> Iterator[Note]:
        """Of files of a log that say no unit, where others do.

        Raises
        ------
        Problem
            When they say different ones.
        """
        column, taken = signal.block.column, signal.block.unit
        said = _said_by_files(signal)
        require_one_unit(column, said, alike, signal.path)
        silent = list(silent_parts(column, said, taken or "", signal.key))
        if silent and taken is not None and not alike(taken, self._wanted(signal)):
            yield from silent  # compared last: that may take the library of units

    def _another(self, signal: Wanted, file: LogFile) -> Iterator[Note]:
        """Of a file that has another unit than the one that is taken.

        Raises
        ------
        Problem
            When the configuration does not say which of the two is right.
        """
        column, said = signal.block.column, signal.block.unit
        taken = said or self._wanted(signal)
        found, source = file.table.unit(column), "the file"
        if not found and taken:
            found, source = said_in_name(column, taken, said is not None), "its name"
        if taken and not found and said is None and (message := remark_on_name(column, taken)):
            yield _note(signal, file, message)
        if not (found and taken) or alike(found, taken):
            return
        another = AnotherUnit(
            column=column,
            file=str(file.path),
            source=source,
            found=found,
            wanted=taken,
            said=said,
            who="the model has",
            beside=(f"{self.reference}, ", "}}") if self.reference else None,
        )
        yield note_of(another, "units", signal.key, signal.path, but_silent(_said_by_files(signal)))

    def _per_time(self, signal: Wanted, file: LogFile) -> Iterator[Note]:
        """Of numbers that are per another unit of time than the model's, which has no unit for them."""
        column, name, time = signal.block.column, signal.name, self.time
        in_file = file.table.unit(column)
        found, source = in_file or unit_in_name(column), "the file" if in_file else "its name"
        per_time = per_unit_of(found, time)
        if not per_time:
            return
        message = (
            f"column {column!r}: {source} says {found}, and the model, whose time is in {time}, has no unit for {name}:"
            f" taken as they are; plant.units: {{{name}: {found}}} says that this is right; for a model in {per_time}, "
            f"plant.units: {{{name}: {per_time}}} and {'.'.join(map(str, signal.path))}.unit: {found} convert"
        )
        yield _note(signal, file, message)


def _said_by_files(signal: Wanted) -> dict[str, str]:
    """What each file says of the unit of a column; empty where it says nothing."""
    return {str(part.file.path): part.file.table.unit(signal.block.column) for part in signal.parts}


def _note(signal: Wanted, file: LogFile, message: str) -> Note:
    return Note(kind="units", signal=signal.key, file=str(file.path), message=message)
