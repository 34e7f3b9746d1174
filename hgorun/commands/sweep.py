"""``sweep`` and ``merge``: ensembles, carried out and collected."""

from __future__ import annotations

import json as json_text
import sys
from collections.abc import Callable
from pathlib import Path

from hgorun.commands.options import Merge, Printing, Sweep
from hgorun.commands.outputs import NOT_OK, RESULT_SUFFIXES, RESULTS, refuse_other_kinds
from hgorun.commands.run import require_file
from hgorun.ensemble.collecting import collect
from hgorun.ensemble.executors import EXECUTORS, Executor, processes, threads
from hgorun.ensemble.outcome import Outcome, outcome_of
from hgorun.ensemble.store import Store
from hgorun.ensemble.sweep import SUFFIX, Count, Part, Place, carry_out, finished
from hgorun.errors import ConfigError
from hgorun.process import processors
from hgorun.progress import shown
from hgorun.study.sweep_file import load_sweep


def sweep(options: Sweep) -> int:
    """Carry out what is missing of an ensemble, and collect its file when nothing is missing."""
    refuse_other_kinds(options.output, RESULT_SUFFIXES)
    require_file(options.file)
    part = None if options.part is None else Part.read(options.part)
    executor, jobs = _executor(options)
    ensemble = load_sweep(options.file)
    place = _place(options, ensemble.name)
    if options.collect:
        if part is not None or options.fresh:
            raise ConfigError("--collect carries nothing out: it goes with neither --part nor --fresh")
        Store.existing(place.folder)  # is refused where nothing is there
    elif options.fresh:
        place.file.unlink(missing_ok=True)
    store = Store.opened(place.folder, ensemble, fresh=options.fresh)
    if options.collect:
        collect(store, place.file)
        return _told(options, store, place)

    def missing() -> None:
        with shown(_members(store, part), ensemble.name, "members", show=options.text) as progress:

            def told(count: Count) -> None:
                progress.update(count.done, failed=count.failed)

            carry_out(store, executor, part=part, workers=jobs, told=told)

    missing()
    if not finished(store, place.file, missing):
        return _unfinished(options, store, part)
    return _told(options, store, place)


def merge(options: Merge) -> int:
    """Put the blocks of several folders into one, and collect its file."""
    refuse_other_kinds(options.output, RESULT_SUFFIXES)
    stores = [Store.existing(folder) for folder in options.folders]
    ensemble = stores[0].ensemble
    place = _place(options, ensemble.name)
    for one in stores:
        one.refuse_changes(stores[0].manifest["made_of"])
    store = Store.opened(place.folder, ensemble)
    for one in stores:
        store.adopt(one)
    collect(store, place.file)
    return _told(options, store, place)


def _place(options: Printing, name: str) -> Place:
    """The file called by ``--output``, or of the sweep's name in that folder."""
    output = options.output or RESULTS
    if output.suffix.lower() in RESULT_SUFFIXES and not output.is_dir():
        return Place.of(output)
    return Place.of(output / f"{name}{SUFFIX}.h5")


def _executor(options: Sweep) -> tuple[Executor, int]:
    """Who carries members out, and how many blocks at once."""
    if options.executor not in EXECUTORS:
        raise ConfigError(f"--executor: expected one of {', '.join(EXECUTORS)}; found {options.executor!r}")
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


def _unfinished(options: Sweep, store: Store, part: Part | None) -> int:
    """A part is finished, and others are not."""
    left = sum(stop - start for start, stop in store.missing())
    if options.json:
        _print_json(store, None, None)
    elif not options.quiet:
        which = "" if part is None else f"part {part.number}/{part.of} is finished; "
        print(f"{store.folder}: {which}{store.size - left} of {store.size} members are there")
    return 0


def _told(options: Sweep | Merge, store: Store, place: Place) -> int:
    """Say what has become of the members."""
    outcome = outcome_of(place.file)
    for words in outcome.troubles():
        print(f"hgorun: {store.ensemble.name}: {words}", file=sys.stderr)
    if options.json:
        _print_json(store, place.file, outcome)
    elif not options.quiet:
        print(outcome.text())
        print(f"written: {place.file}")
    return NOT_OK if options.strict and outcome.status != "ok" else 0


def _print_json(store: Store, file: Path | None, outcome: Outcome | None) -> None:
    left = sum(stop - start for start, stop in store.missing())
    found = {
        "name": store.ensemble.name,
        "file": None if file is None else str(file),
        "folder": str(store.folder),
        "members": store.size,
        "finished": store.size - left,
        "status": None if outcome is None else outcome.status,
        "failed": None if outcome is None else outcome.failed,
        "observers": None if outcome is None else outcome.observers,
    }
    print(json_text.dumps(found, indent=2, allow_nan=False))
