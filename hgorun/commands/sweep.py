"""``sweep`` and ``merge``: ensembles, carried out and collected."""

from __future__ import annotations

import json as json_text
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from hgorun.commands.continued import counted
from hgorun.commands.ensemble_options import Merge, Sweep
from hgorun.commands.inputs import configuration
from hgorun.commands.options import Printing
from hgorun.commands.outputs import NOT_OK, RESULTS, refuse_other_kinds, refuse_unwritable
from hgorun.commands.remarks import coarse_members
from hgorun.config.nearest import refuse_other
from hgorun.ensemble.collected.outcome import Outcome, outcome_of
from hgorun.ensemble.collecting import collect
from hgorun.ensemble.executors import EXECUTORS, Executor, processes, threads
from hgorun.ensemble.folder.manifest import Manifest
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.refused import refuse_base, told_where
from hgorun.ensemble.sweep import SUFFIX, Part, Place, carry_out, finished
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import RESULT_SUFFIXES, remove_file
from hgorun.process import processors
from hgorun.progress import shown
from hgorun.study.sweep_file import load_sweeps
from hgorun.tables.layout import reflowed, wrapped


def sweep(options: Sweep) -> int:
    """Carry out what is missing of ensembles, and collect the file of each when nothing is missing."""
    refuse_other_kinds(options.output, RESULT_SUFFIXES)
    options = replace(options, file=configuration(options.file, "sweep"))
    part = None if options.part is None else Part.read(options.part)
    executor, jobs = _executor(options)
    if options.collect and (part is not None or options.fresh):
        raise ConfigError("--collect carries nothing out: it goes with neither --part nor --fresh")
    ensembles = load_sweeps(options.file, options.run)
    if len(ensembles) > 1 and options.output is not None and _is_file(options.output):
        raise ConfigError(f"--output: {options.output} is one file, but there are {len(ensembles)} ensembles")
    places = [_place(options, name) for name in ensembles]
    for place in places:
        refuse_unwritable(place.file, kind="file")
    told = [_one(options, *one, executor, jobs, part) for one in zip(ensembles.values(), places, strict=True)]
    return _said(options, told)


def _one(options: Sweep, ensemble: Ensemble, place: Place, executor: Executor, jobs: int, part: Part | None) -> Told:
    """Carry an ensemble out, or collect what is there of it."""
    if options.collect:
        Store.existing(place.folder)  # is refused where nothing is there
    else:
        refuse_base(ensemble)
    if options.fresh:
        remove_file(place.file)
    store = Store.opened(place.folder, ensemble, fresh=options.fresh)
    if options.collect:
        collect(store, place.file)
        return Told(store, place.file, part, ensemble)

    same = "the same command without --fresh" if options.fresh else "the same command"

    def missing() -> None:
        with (
            shown(_members(store, part), ensemble.name, "members", show=options.text) as progress,
            counted(store.size, ensemble.name, progress, same) as told,
        ):
            carry_out(store, executor, part=part, workers=jobs, told=told)

    missing()
    return Told(store, place.file if finished(store, place.file, missing) else None, part, ensemble)


def merge(options: Merge) -> int:
    """Put the blocks of several folders into one, and collect its file."""
    refuse_other_kinds(options.output, RESULT_SUFFIXES)
    stores = [Store.existing(folder) for folder in options.folders]
    ensemble = stores[0].ensemble
    place = _place(options, ensemble.name)
    refuse_unwritable(place.file, kind="file")
    manifest = Manifest.of(ensemble)
    for one in stores:
        one.refuse_changes(manifest)
    store = Store.opened(place.folder, ensemble, advice="choose another --output")
    for one in stores:
        store.adopt(one)
    collect(store, place.file)
    return _said(options, [Told(store, place.file)])


def _place(options: Printing, name: str) -> Place:
    """The file called by ``--output``, or of the sweep's name in that folder."""
    output = options.output or RESULTS
    if _is_file(output):
        return Place.of(output)
    return Place.of(output / f"{name}{SUFFIX}.h5")


def _is_file(output: Path) -> bool:
    """Whether ``--output`` names the collected file, not a folder."""
    return output.suffix.lower() in RESULT_SUFFIXES and not os.path.isdir(output)


def _executor(options: Sweep) -> tuple[Executor, int]:
    """Who carries members out, and how many blocks at once."""
    refuse_other("--executor", options.executor, EXECUTORS)
    if options.scheduler is not None and options.executor != "dask":
        raise ConfigError("--scheduler goes with --executor dask")
    jobs = options.jobs or processors()
    if options.executor == "dask":
        if options.scheduler is not None and options.jobs is not None:
            raise ConfigError("--jobs does not go with --scheduler, whose workers are there already")
        from hgorun.ensemble.cluster import dask

        return dask(options.scheduler, options.jobs), jobs
    made: dict[str, Callable[[int], Executor]] = {"threads": threads, "processes": processes}
    return made[options.executor](jobs), 1 if options.executor == "threads" else jobs


def _members(store: Store, part: Part | None) -> int:
    start, stop = (0, store.size) if part is None else part.range(store.size)
    return stop - start


@dataclass(frozen=True)
class Told:
    """What there is of an ensemble: its file, once nothing is missing, and which part was carried out.

    The ensemble as it was read, if it was, knows where in the file everything stands.
    """

    store: Store
    file: Path | None
    part: Part | None = None
    ensemble: Ensemble | None = None

    @cached_property
    def outcome(self) -> Outcome | None:
        """What has become of the members."""
        return None if self.file is None else outcome_of(self.file)

    def as_json(self) -> dict[str, object]:
        """For ``--json``."""
        outcome = self.outcome
        return {
            "name": self.store.ensemble.name,
            "file": None if self.file is None else str(self.file),
            "folder": str(self.store.folder),
            "members": self.store.size,
            "finished": self.store.size - self._left,
            "status": None if outcome is None else outcome.status,
            "failed": None if outcome is None else outcome.failed,
            "observers": None if outcome is None else outcome.observers,
        }

    def text(self) -> str:
        """For a person."""
        if self.outcome is not None:
            kept = f"kept: {self.store.folder} (the members, which the same call finds again; it may be deleted)"
            return "\n".join([*reflowed(self.outcome.text()), *wrapped(kept), f"written: {self.file}"])
        which = "" if self.part is None else f"part {self.part.number}/{self.part.of} is finished; "
        return f"{self.store.folder}: {which}{self.store.size - self._left} of {self.store.size} members are there"

    @property
    def _left(self) -> int:
        return sum(stop - start for start, stop in self.store.missing())


def _said(options: Sweep | Merge, found: Sequence[Told]) -> int:
    """Say what has become of the members."""
    for one in found:
        if one.outcome is None:
            continue
        where = partial(told_where, one.ensemble or one.store.ensemble)
        for words in (*one.outcome.troubles(where), *coarse_members(one.outcome.largest_error)):
            print(f"hgorun: {one.store.ensemble.name}: {words}", file=sys.stderr)
    if options.json:
        records = [one.as_json() for one in found]
        print(json_text.dumps(records[0] if len(records) == 1 else records, indent=2, allow_nan=False))
    elif not options.quiet:
        print("\n".join(one.text() for one in found))
    if any(one.outcome is not None and one.outcome.nothing for one in found):
        return HgorunError.exit_code
    worst = any(one.outcome is not None and one.outcome.status != "ok" for one in found)
    return NOT_OK if options.strict and worst else 0
