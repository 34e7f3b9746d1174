"""The files that a block ``data`` names, as a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hgorun.config.data import Beside, Column, Data, Judged, Measured, Recorded
from hgorun.config.refusals import Refusals
from hgorun.data.cells import Flags
from hgorun.data.faults import sentinels
from hgorun.data.faults.sorting import Sorting
from hgorun.data.faults.wraps import wrapped
from hgorun.data.in_turn import in_turn
from hgorun.data.input_ends import inputs_beyond
from hgorun.data.model_units import ModelUnits
from hgorun.data.odd_clocks import rounding
from hgorun.data.one_clock import OneClock
from hgorun.data.parts import lacking_columns
from hgorun.data.recording import InputSignal, Note, Origin, Recording, Signal
from hgorun.data.samples import Samples
from hgorun.data.sources import LogFile, Part, Sources, Wanted, given_references, remarks_on
from hgorun.data.table import Table
from hgorun.data.tags import mixed
from hgorun.data.told_once import told_once
from hgorun.errors import ConfigError

_LONG = 1 << 18  # samples from which threads pay


def read(
    block: Data,
    folder: Path,
    *,
    time_unit: str = "s",
    units: Mapping[str, str] | None = None,
    periods: Mapping[str, float] | None = None,
    files: Sequence[Path] = (),
    beside: Origin | None = None,
    reference: str = "",
) -> Recording:
    """Measurements in the units of a model.

    Parameters
    ----------
    block : Data
    folder : Path
        That of the configuration: names of files in the block are relative to it.
    time_unit : str
        Of the run.
    units : mapping of str to str, optional
        Of the model's outputs, states and inputs; columns with a unit of their own are converted to these.
    periods : mapping of str to float, optional
        Of the model's outputs that are known up to whole periods, in the unit of the model.
    files : sequence of Path
        In place of those that the block names for all signals.
    beside : Origin, optional
        That of another recording, from which the times of this one are counted, too.
    reference : str
        How a key begins that is of what is read alone, where the keys of the block are those of a log.

    Raises
    ------
    ConfigError
        For the first fault in the data that is to be refused, with its file and line.
    Problem
        When a key names what is not there.
    """
    return Reader(block, folder, files, reference).recording(time_unit, units or {}, beside, periods or {})


class Reader:
    """Reads what a block names, and then puts its signals on one clock and in the units of the model.

    Arguments as of :func:`read`; a file is read when a reader is made.
    """

    def __init__(self, block: Data, folder: Path, files: Sequence[Path] = (), reference: str = "") -> None:
        self._block, self._reference, sources = block, reference, Sources(block, folder, files, reference)
        groups: dict[str, Mapping[str, Column]]
        groups = {"outputs": block.outputs, "inputs": block.inputs, "reference": block.reference}
        refusals = Refusals()
        self._wanted: dict[str, list[Wanted]] = {group: [] for group in groups}
        for group, columns in groups.items():
            for name, column in columns.items():
                with refusals.of_a_part():
                    self._wanted[group].append(sources.wanted(name, column, ("data", group, name)))
        refusals.refuse()
        every = [signal for some in self._wanted.values() for signal in some]
        self._found: list[Note] = list(lacking_columns(every, *sources.shared))
        self._tables = sources.tables()
        self._found += (note for file, table in self._tables.items() for note in remarks_on(file, table))

    def recording(
        self, unit: str, units: Mapping[str, str], beside: Origin | None, periods: Mapping[str, float]
    ) -> Recording:
        """All signals; arguments as of :func:`read`."""
        wanted, signals = self._wanted, [signal for some in self._wanted.values() for signal in some]
        clock = OneClock(self._block, signals, self._tables, unit, beside, self._reference)
        made = _Making(self._block, self._tables, clock, ModelUnits(units, unit, self._reference), periods)
        made.notes += [*self._found, *clock.notes]
        sorted_out = made.all_sorted(signals)
        outputs = {one.name: made.signal(one, sorted_out[one]) for one in wanted["outputs"]}
        inputs = {one.name: made.input(one, sorted_out[one]) for one in wanted["inputs"]}
        reference = {one.name: made.signal(one, sorted_out[one]) for one in wanted["reference"]}
        made.notes += inputs_beyond(inputs, outputs, clock.origin)
        made.notes += given_references(wanted["outputs"], wanted["reference"])
        return Recording(
            outputs=outputs,
            inputs=inputs,
            reference=reference,
            notes=tuple(told_once(made.notes)),
            origin=clock.origin,
            first_samples=self._block.first_samples,
        )


@dataclass(eq=False, repr=False)
class _Making:
    """Makes the signals of a recording of the columns that were read.

    Attributes
    ----------
    block : Data
    tables : mapping of LogFile to Table
    clock : OneClock
        Of all signals.
    units : ModelUnits
    periods : mapping of str to float
        Of the outputs that are known up to whole periods.
    notes : list of Note
        What was found so far.
    """

    block: Data
    tables: Mapping[LogFile, Table]
    clock: OneClock
    units: ModelUnits
    periods: Mapping[str, float]
    notes: list[Note] = field(default_factory=list)

    def samples(self, signal: Wanted) -> Samples:
        tables = [self.tables[part.file] for part in signal.parts]
        parts = signal.parts
        values = self._written(signal)
        taken = _joined([self.clock.times[part.file, part.time] for part in parts])
        known = [self.clock.times[part.file, part.available] for part in parts if part.available is not None]
        good = [
            table.columns[part.quality] for table, part in zip(tables, parts, strict=True) if part.quality is not None
        ]
        counts = [table.lines.size for table in tables]
        self.notes += self.units.told(signal)
        doubts = [remark for table, part in zip(tables, parts, strict=True) for remark in _doubts(table, part)]
        return Samples(
            key=signal.key,
            taken=taken,
            available=_joined(known) if known else taken,
            values=self.units.converted(signal, values),
            lines=_joined([table.lines for table in tables]),
            part=np.repeat(np.arange(len(tables), dtype=np.int16), counts)
            if len(tables) > 1
            else np.empty(0, np.int16),
            good=_joined(good) if good else None,
            sources=tuple(part.file.path for part in parts),
            time_unit=self._unit_of_times(parts),
            doubt="".join(f"; {told}" for told in doubts[:1]),
            coarse=max(rounding(part.time.cells, table)[0] for part, table in zip(parts, tables, strict=True)),
        )

    def _written(self, signal: Wanted) -> np.ndarray:
        """The values as they stand in the files."""
        return _joined([self.tables[part.file].columns[part.value] for part in signal.parts])

    def _unit_of_times(self, parts: Sequence[Part]) -> str:
        """That in which times stand in the files, where all are numbers; else that of the run."""
        dates = any(part.time.absolute for part in parts)
        return (not dates and parts[0].time.clock.unit) or self.units.time

    def all_sorted(self, signals: Sequence[Wanted]) -> Mapping[Wanted, Samples]:
        """The samples of all signals, those of long logs looked through side by side."""
        with ThreadPoolExecutor(2) as pool:
            found = {one: self.samples(one) for one in signals}
            long = any(samples.values.size > _LONG for samples in found.values())
            done = (pool.map if long else map)(self._sorted, signals, found.values())
            for signal, (samples, notes) in zip(signals, done, strict=True):
                found[signal] = samples
                self.notes += notes
        return found

    def _sorted(self, signal: Wanted, samples: Samples) -> tuple[Samples, list[Note]]:
        """The samples that are used, and what was found in them."""
        block = signal.block
        found = list(sentinels.told(samples, self._written(signal), block, signal.parts[0].file.owner))
        told = block.faults.over(self.block.faults)
        if not isinstance(block, Judged):  # inputs may be written when they change: what all are told is of outputs
            told = told.model_copy(update={"gaps": block.faults.gaps})
        measured = isinstance(block, Judged)
        period = self.periods.get(signal.name) if measured else None
        near = signal.parts[0].file.table.texts if isinstance(block, Judged) and block.quality is None else None
        sorting = Sorting(told, measured, self.clock.origin, period, near)
        plausible = block.plausible if isinstance(block, Judged) else None
        sorted_out = sorting.sorted_out(samples, plausible, self.units.beside_another(signal))
        if isinstance(block, Measured) and period is None:
            found += wrapped(samples, signal.name, self.units.of.get(signal.name, ""))
        return sorted_out, [*found, *sorting.notes, *self._of_several(signal, samples)]

    def _of_several(self, signal: Wanted, samples: Samples) -> Iterator[Note]:
        """What is told of rows that may be of several signals.

        Raises
        ------
        ConfigError
            Where they are.
        """
        block, file = signal.block, signal.parts[0].file
        measured, plausible = isinstance(block, Judged), None
        if isinstance(block, Judged):
            if block.quality is not None:
                return
            plausible = block.plausible
        read = {cells.column for cells in file.wanted if not isinstance(cells, Flags)}
        found = mixed(file.table.texts, samples, block.column, read, plausible)
        if found is None:
            if (turns := in_turn(samples.values, plausible)) is not None:
                place, line = samples.place(turns.place)
                yield Note(
                    kind="tags", signal=signal.key, file=place, line=line, message=turns.sentence(measured=measured)
                )
            return
        message = found.sentence(measured=measured)
        if found.sure:
            raise ConfigError(message, file=str(file.path), line=found.line, key=signal.key)
        yield Note(kind="tags", signal=signal.key, file=str(file.path), line=found.line, message=message)

    def signal(self, signal: Wanted, samples: Samples) -> Signal:
        block = signal.block
        assert isinstance(block, Judged)
        found = Signal(
            name=signal.name,
            unit=self.units.said(signal),
            taken=samples.taken,
            available=samples.available,
            values=samples.values,
            lines=samples.lines,
            source=samples.sources[0],
            column=block.column,
            plausible=block.plausible,
            sources=samples.sources,
            part=samples.part,
        )
        if isinstance(block, Measured):
            return replace(found, std=block.std, gate=block.gate)
        return replace(found, lag=block.lag) if isinstance(block, Beside) else found

    def input(self, signal: Wanted, samples: Samples) -> InputSignal:
        assert isinstance(signal.block, Recorded)
        return InputSignal(
            name=signal.name,
            unit=self.units.said(signal),
            times=samples.taken,
            values=samples.values,
            hold=signal.block.hold,
            lines=samples.lines,
            source=samples.sources[0],
            sources=samples.sources,
            part=samples.part,
        )


def _doubts(table: Table, part: Part) -> Iterator[str]:
    """What is told of how the numbers of a part of a signal are written."""
    if part.value in table.doubts:
        yield f"{table.doubts[part.value]}; csv goes below {part.file.owner}"


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """One after the other; of a single one the array itself, which signals then share."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
