"""A benchmark: from its file to the scores of every contestant on every plant in every scenario."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from hgorun.benchmark.contestants import absent, check_types, contestant_in, contestants
from hgorun.benchmark.parabolas import Floats
from hgorun.benchmark.trial import Score, Trial, swing
from hgorun.code import ENSEMBLE, RUN, code, code_of
from hgorun.config.benchmark import BenchmarkFile, Contestant
from hgorun.config.kinds import refuse_file_of_another_command
from hgorun.config.reading import read_source
from hgorun.config.validation import validate
from hgorun.errors import ConfigError, HgorunError, Problem
from hgorun.files import json_value, write_text
from hgorun.measurement.blocks import noise_blocks
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import prepare
from hgorun.study.loading import load
from hgorun.version import __version__

_KEPT = TypeAdapter(Score | str)
_OWN = tuple(f"benchmark/{name}.py" for name in ("contestants", "parabolas", "scan", "trial"))


@dataclass(frozen=True)
class Entry:
    """What is known of a contestant on a plant in a scenario: its score, or why it has none: refused, or failed."""

    plant: str
    scenario: str
    label: str
    group: str
    score: Score | None = None
    refused: str = ""
    time_unit: str = ""


@dataclass(frozen=True, eq=False)
class Benchmark:
    """A benchmark's file, read and checked.

    Attributes
    ----------
    path : Path
    blocks : BenchmarkFile
    bases : mapping of (plant, scenario) to Experiment
    """

    path: Path
    blocks: BenchmarkFile
    bases: Mapping[tuple[str, str], Experiment]

    @property
    def name(self) -> str:
        """Results are called by it."""
        return self.path.stem

    @property
    def size(self) -> int:
        """How many entries there are."""
        return len(self.bases) * len(self.contestants)

    @cached_property
    def contestants(self) -> dict[str, Contestant]:
        """Those of the file, and the others that take part."""
        return contestants(self.blocks)

    @property
    def absent(self) -> dict[str, str]:
        """Types of observers that do not take part, and why."""
        return absent(self.blocks)

    def entries(self, folder: Path, threads: int = 1, told: Callable[[int], None] = lambda _: None) -> list[Entry]:
        """All entries; those that are in the folder are read, the others are carried out and written there.

        Parameters
        ----------
        folder : Path
            A file for each entry, written whole when it is finished: begun again, only what is missing is done.
        threads : int
            How many carry out runs side by side.
        told : callable
            Called with the number of entries that are there.

        Raises
        ------
        HgorunError
            When a file cannot be written.
        """
        found = []
        for (plant, scenario), base in self.bases.items():
            cell = _Cell(base, plant, scenario, self.blocks.plants[plant].rate, self.blocks)
            for label, contestant in self.contestants.items():
                found.append(cell.entry(label, contestant, folder, threads))
                told(len(found))
        return found


@dataclass(frozen=True, eq=False)
class _Cell:
    """A plant in a scenario."""

    base: Experiment
    plant: str
    scenario: str
    rate: float
    blocks: BenchmarkFile

    @cached_property
    def scale(self) -> Floats:
        """The swing of each state, without noise in the way."""
        return swing(self.base)

    @cached_property
    def steps(self) -> float:
        """In how many steps of the plant's file a run is; of output, where those of integration are automatic."""
        time, step = self.base.blocks.time, self.base.blocks.solver.step
        return (time.end - time.start) / (time.output_step if step == "auto" else step)

    def entry(self, label: str, one: Contestant, folder: Path, threads: int) -> Entry:
        """An entry, from its file where there is one that says how it has come about."""
        one = one.on(self.plant)
        entry = Entry(self.plant, self.scenario, label, one.group, time_unit=self.base.blocks.time.unit)
        if one.scenarios and self.scenario not in one.scenarios:
            return replace(entry, refused=f"made for {', '.join(one.scenarios)} only")
        try:
            experiment = contestant_in(self.base, label, one, self.rate)
            prepare(experiment)
        except ConfigError as error:
            return replace(entry, refused=error.message)
        made_of = self._ingredients(experiment, one)
        path = folder / f"{_digest(made_of)}.json"
        found = _read(path)
        if found is None:
            found = self._scored(label, one, experiment, threads)
            kept = found if isinstance(found, str) else asdict(found)
            write_text(path, json.dumps(json_value({"of": made_of, "found": kept}), indent=1))
        return replace(entry, refused=found) if isinstance(found, str) else replace(entry, score=found)

    def _scored(self, label: str, one: Contestant, experiment: Experiment, threads: int) -> Score | str:
        """The score, or why there is none."""
        try:
            trial = Trial(experiment, label, one, self.scale, self.rate, self.steps)
            return trial.score(self.blocks.seeds, self.blocks.tries, threads)
        except HgorunError as error:
            return f"failed: {error}"

    def _ingredients(self, experiment: Experiment, one: Contestant) -> dict[str, Any]:
        """All that the score follows from."""
        noise = [item for _, items in noise_blocks(experiment.measurement) for item in items]
        theirs = code_of(map(type, (experiment.plant_block, *experiment.observers.values(), *noise)))
        return {
            "plant": self.plant,
            "scenario": self.scenario,
            "configuration": json_value(experiment.resolved()),
            "knob": one.knob.model_dump(mode="json"),
            "rate": self.rate,
            "seeds": self.blocks.seeds.model_dump(),
            "tries": self.blocks.tries.model_dump(),
            "version": __version__,
            "code": code([*RUN, *ENSEMBLE, *_OWN]) | theirs,
        }


def _digest(made_of: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()[:32]


def _read(path: Path) -> Score | str | None:
    """The score in a file, or why there is none; None where the file cannot be read: it is made again."""
    try:
        return _KEPT.validate_python(json.loads(path.read_text(encoding="utf-8"))["found"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def load_benchmark(path: str | Path) -> Benchmark:
    """Read and check a benchmark with the files of its plants.

    Raises
    ------
    ConfigError
        For anything wrong in them: file, line, key, what was found and what would be right.
    """
    path = Path(path)
    _, source = read_source(path)
    refuse_file_of_another_command(source.data, path, "benchmark")
    if isinstance(source.data, dict) and {"plant", "time"} <= source.data.keys():
        message = "this is a configuration; the file of a benchmark names plants, scenarios and observers"
        raise ConfigError(message, file=str(path))
    blocks = validate(BenchmarkFile, source.data, source, ())
    with source.located():
        check_types(blocks)
    bases: dict[tuple[str, str], Experiment] = {}
    for name, venue in blocks.plants.items():
        for scenario in blocks.scenarios:
            experiment = load(path.parent / venue.file, run=scenario)
            if len(experiment.observers) != 1:
                what = f"{venue.file}: expected one observer, which gives the initial estimate; found"
                with source.located():
                    raise Problem(("plants", name), f"{what} {len(experiment.observers)}")
            bases[name, scenario] = experiment
    return Benchmark(path, blocks, bases)


def of_cells(entries: list[Entry]) -> Iterator[tuple[tuple[str, str], list[Entry]]]:
    """Entries by (plant, scenario), in the order of the file."""
    cells: dict[tuple[str, str], list[Entry]] = {}
    for entry in entries:
        cells.setdefault((entry.plant, entry.scenario), []).append(entry)
    yield from cells.items()
