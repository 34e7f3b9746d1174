"""The block ``data`` of a configuration, and the files that it is read from."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hgorun.config.data import Data, Measured
from hgorun.config.models import Time
from hgorun.config.nearest import among
from hgorun.config.reading import mapping
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.data.reading import Reader, read
from hgorun.data.recording import Note, Origin, Recording, Signal
from hgorun.errors import ConfigError
from hgorun.estimate.holdout import part
from hgorun.estimate.twins import used_nevertheless, without_twins
from hgorun.files import real_path


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """The block ``data``, and how it is read."""

    block: Data
    folder: Path
    unit: str
    source: Source
    files: tuple[Path, ...]

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Of the plant's states, inputs and outputs."""
        from hgorun.estimate.completed import plant_units, with_inputs  # long to import: files are read meanwhile

        return plant_units(with_inputs(self.source, self.block.inputs))

    @cached_property
    def periods(self) -> Mapping[str, float]:
        """Of the plant's outputs that are known up to whole periods."""
        from hgorun.estimate.completed import plant_periods, with_inputs  # as above

        return plant_periods(with_inputs(self.source, self.block.inputs))

    def read(self, files: Callable[[], Reader] | None = None) -> Recording:
        """The recording; ``files`` gives what :meth:`open` has, where that was done before."""
        units = self.units  # of a plant that cannot be, before anything is said of files
        reader = self.open() if files is None else files()
        return reader.recording(self.unit, units, None, self.periods)

    def open(self) -> Reader:
        """Read the files, for which nothing of the plant is needed."""
        return Reader(self.block, self.folder, self.files)

    @property
    def all_files(self) -> tuple[Path, ...]:
        """Every file that something is read from."""
        columns = [*self.block.outputs.values(), *self.block.inputs.values(), *self.block.reference.values()]
        own = (self.folder / column.file for column in columns if column.file is not None)
        return (*self.shared_files, *own)

    @property
    def shared_files(self) -> tuple[Path, ...]:
        """Those of all signals that name no file of their own."""
        return self.files or tuple(self.folder / name for name in self.block.file)

    def _columns(self, output: str, file: Path) -> dict[str, Any]:
        """How an output is called in a file: as the block reads it from that file, or else as it does anyway."""
        blocks = [block[output] for block in (self.block.outputs, self.block.reference) if output in block]
        if not blocks:
            told = "neither data.outputs nor data.reference says"
            known = dict.fromkeys((*self.block.outputs, *self.block.reference))
            add = self._to_add(output, file) or f"; known there: {among(output, known)}"
            raise ConfigError(f"--holdout {output}={file}: {told} in which column {output} stands{add}")
        of_file = [one for one in blocks if one.file and real_path(self.folder / one.file) == real_path(file)]
        return [*of_file, *blocks][0].model_dump(exclude_none=True, exclude={"lag"})

    def _to_add(self, name: str, file: Path) -> str:
        """The line that names the column of a quantity in a file; empty where the plant has no such quantity."""
        from hgorun.simulation.experiment.blocks import plant_of  # long to import: only here

        plant = plant_of(self.source)
        if name not in (*plant.state_names, *plant.output_names):
            return ""
        stands = f"{{file: {self._written(file)}, column: COLUMN}}"
        return f": write below data, with the column's name, reference: {{{name}: {stands}}}"

    def _written(self, file: Path) -> str:
        """A file as the configuration names it."""
        near = file.absolute().is_relative_to(self.folder.absolute())
        name = str(file.absolute().relative_to(self.folder.absolute()) if near else file.absolute())
        return json.dumps(name, ensure_ascii=False)

    def held_out(self, recording: Recording, output: str, file: Path) -> tuple[Recording, Signal]:
        """A recording without what it has of an output from a file, and what is compared with estimates.

        What stands in another file than those that observers get is read from there. Samples of the log that have the
        time and the value of one that is held out are the same, wherever they stand: observers do not get them either.

        Raises
        ------
        ConfigError
            Where observers would get what they are compared with, or nothing.
        """
        signal = recording.outputs.get(output)
        out = np.zeros(0, dtype=bool) if signal is None else signal.stands_in(file)
        if signal is None or not out.any():
            self._refuse_used(output, file)
            held, notes = self._from_file(output, file, recording.origin)
            if signal is None:
                notes = [*notes, *used_nevertheless(recording, held, output, "that are held out")]
        elif out.all():
            raise ConfigError(
                f"--holdout {output}={file}: all samples of the output {output} stand there, and observers would get "
                f"none: hold out some of them, --holdout {output}=5, or leave {output} out of plant.output and "
                "data.outputs and name it in data.reference"
            )
        else:
            held, signal, notes = part(signal, out), part(signal, ~out), []
        outputs = dict(recording.outputs)
        if signal is not None:
            outputs[output], told = without_twins(signal, held, f"--holdout {output}={file}")
            notes = [*notes, *told]
        return replace(recording, outputs=outputs, notes=(*recording.notes, *notes)), held

    def _refuse_used(self, name: str, file: Path) -> None:
        """Refuse a column that observers get as an output of another name."""
        column = self._columns(name, file)["column"]
        for output, block in self.block.outputs.items():
            files = (self.folder / block.file,) if block.file is not None else self.shared_files
            if block.column == column and real_path(file) in (real_path(one) for one in files):
                raise ConfigError(
                    f"--holdout {name}={file}: observers get this column {column} as the output {output}: hold out "
                    f"some of its samples, --holdout {output}=5"
                )

    def _from_file(self, output: str, file: Path, origin: Origin) -> tuple[Signal, Sequence[Note]]:
        """An output as it stands in another file, at times that count from the origin of the log, and what was found.

        What is held out is compared at the time it was taken: when it was known is not asked for. As of samples that
        are known late, the rows may stand in any order.
        """
        columns = self._columns(output, file)
        own = columns.get("file") is not None and real_path(self.folder / columns["file"]) == real_path(file)
        if columns.pop("available", None) is not None and self.block.faults.backwards is None:
            columns["faults"] = {"backwards": "sort", **columns.get("faults", {})}
        other = Measured(**{**columns, "file": str(file.absolute())})
        found = read(
            self.block.model_copy(update={"outputs": {output: other}, "inputs": {}, "reference": {}}),
            self.folder,
            time_unit=self.unit,
            units=self.units,
            periods=self.periods,
            beside=origin,
            reference="" if own else f"data.reference: {{{output}: {{file: {self._written(file)}",
        )
        return found.outputs[output], [note for note in found.notes if note.kind in ("units", "clock", "format")]


def log_of(source: Source, config: Path, files: tuple[Path, ...] = ()) -> Log:
    """The block ``data`` of a configuration; ``files`` stand in for those that it names."""
    data = mapping(source, "data, plant and observers")
    if "data" not in data:
        message = (
            "the key data is missing: it says which columns of which files are the measurements; "
            "`hgorun init fermentation` copies an example"
        )
        raise ConfigError(message, file=str(config))
    block = validate(Data, data["data"], source, ("data",))
    time = data.get("time")
    unit = time.get("unit") if isinstance(time, dict) else None
    default = str(Time.model_fields["unit"].default)
    return Log(
        block,
        config.parent,
        unit if isinstance(unit, str) else default,
        source,
        files,
    )
