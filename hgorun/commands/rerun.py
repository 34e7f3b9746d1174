"""``rerun``: a result made again from its own file."""

from __future__ import annotations

import json as json_text
from dataclasses import replace
from pathlib import Path

from hgorun.commands.inputs import refuse_name_of_another_thing
from hgorun.commands.outputs import refuse_other_kinds, refuse_unwritable
from hgorun.commands.remarks import warn
from hgorun.commands.run import run_with_progress
from hgorun.commands.run_options import Rerun
from hgorun.config.yaml_source import parse
from hgorun.errors import ConfigError
from hgorun.files import RESULT_SUFFIXES, remove_leftovers
from hgorun.originals import note_originals
from hgorun.result.file.writing import digests_of
from hgorun.result.reading import read, stored_digests
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.experiment.unused import without_places
from hgorun.simulation.simulate import prepare

DIFFERENT = 3


def rerun(options: Rerun) -> int:
    """Make a result again, and say which of its data sets are the same."""
    refuse_other_kinds(options.output, RESULT_SUFFIXES)
    refuse_name_of_another_thing(options.file)
    note_originals([options.file])
    before = read(options.file)
    if before.recorded is not None:
        raise ConfigError("an estimate of recorded data is made again by hgorun estimate", file=str(options.file))
    stored = stored_digests(options.file)
    if not stored:
        raise ConfigError(
            "its data sets have no attribute sha256: it was made by an older version", file=str(options.file)
        )
    target = None if options.check else _target(options)
    if target is not None:
        refuse_unwritable(target, kind="file")
    result = _made_again(before, options)
    warn(result)
    found = digests_of(result)
    rows = [{"path": path, "stored": stored.get(path), "found": found.get(path)} for path in {**stored, **found}]
    different = [row["path"] for row in rows if row["stored"] != row["found"]]
    if target is not None:
        remove_leftovers(target.parent)
        result.save(target)
    if options.json:
        print(json_text.dumps({"same": not different, "datasets": rows}, indent=2))
    elif options.text:
        print(f"different: {', '.join(map(str, different))}" if different else f"the same: {len(rows)} data sets")
        if target is not None:
            print(f"written: {target}")
    return DIFFERENT if options.check and different else 0


def _made_again(before: Result, options: Rerun) -> Result:
    """The run of a file's own configuration, with the numbers of its design."""
    source = without_places(parse(before.config_resolved, f"{options.file}: config_resolved"))
    experiment = Experiment(source, name=before.name, text=before.config)
    after = run_with_progress(prepare(experiment, before.design), show=options.text)
    observers = {
        label: replace(o, gains=before.observers[label].gains) if label in before.observers else o
        for label, o in after.observers.items()
    }
    return replace(after, title=before.title, observers=observers)


def _target(options: Rerun) -> Path:
    """Where the new result goes."""
    name = f"{options.file.stem}.rerun.h5"
    if options.output is None:
        return options.file.with_name(name)
    return options.output if options.output.suffix.lower() in RESULT_SUFFIXES else options.output / name
