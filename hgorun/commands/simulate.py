"""``simulate``: runs and their results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from hgorun.commands.inputs import configuration
from hgorun.commands.outputs import (
    NOT_OK,
    RESULTS,
    refuse_no_csv,
    refuse_other_kinds,
    refuse_same,
    refuse_unwritable,
    there,
    written,
)
from hgorun.commands.remarks import warn
from hgorun.commands.run import experiments_of, print_json
from hgorun.commands.run_options import Simulate
from hgorun.config.refusals import Refusals
from hgorun.errors import ConfigError
from hgorun.files import RESULT_SUFFIXES, refuse_original, remove_leftovers, write_text
from hgorun.progress import shown
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_into
from hgorun.simulation.timeline.grid import LONG
from hgorun.study.loading import refuse_twins

if TYPE_CHECKING:
    from hgorun.study.study import Run

# What else somebody may have meant by --output of simulate.
_INSTEAD = {
    ".csv": "--export-csv FILE writes the states over time, hgorun compare --format csv prints the metrics",
    ".txt": "--export-csv FILE writes the states over time, hgorun compare prints the metrics",
    ".png": "hgorun compare CONFIG -o FILE.png draws",
    ".pdf": "hgorun compare CONFIG -o FILE.pdf draws",
}


def simulate(options: Simulate) -> int:
    """Run configurations and write their results; everything is checked before anything runs.

    Runs with seeds or vary are carried out as ensembles, and statistics of them are shown.
    """
    refuse_other_kinds(options.output, RESULT_SUFFIXES, _INSTEAD)
    refuse_no_csv("--export-csv", options.export_csv)
    runs, targets, ensembles = _prepared(options)
    _check_export(options, runs, targets, ensembles)
    for target in [*targets, *(file for _, file in ensembles)]:
        refuse_unwritable(target, kind="file")
    before = there([*targets, *([] if options.export_csv is None else [options.export_csv])])
    for folder in {target.parent for target in targets}:
        remove_leftovers(folder)
    results, files = [], []
    for prepared, target in zip(runs, targets, strict=True):
        with shown(1.0, prepared.experiment.name, show=options.text) as progress:
            heard = progress.update if options.text else None
            result = simulate_into(prepared, target, check_step=options.check_step, progress=heard)
        files.append(str(target))
        results.append(result)
        warn(result, prepared.experiment)
        if options.text:
            from hgorun.tables.metrics import text  # only where it is printed: a run has to be quick

            print(text([result]))
        made = [target, *_exported(options, result)]
        if options.text:
            print(written(made, before))
    of_ensembles: list[dict[str, object]] = []
    fine = all(result.status == "ok" for result in results)
    for run, target in ensembles:
        from hgorun.commands.ensembles import simulate_ensemble

        told, ok = simulate_ensemble(run, target, options)
        of_ensembles.append(told)
        fine = fine and ok
    if options.json:
        print_json(results, files, others=of_ensembles)
    return NOT_OK if options.strict and not fine else 0


def _prepared(options: Simulate) -> tuple[list[PreparedRun], list[Path], list[tuple[Run, Path]]]:
    """All single runs of the files and where each result goes, and all ensembles with their files."""
    runs: list[PreparedRun] = []
    targets: list[Path] = []
    ensembles: list[tuple[Run, Path]] = []
    paths = [configuration(path, "simulate") for path in options.configs]
    refuse_twins(paths, lambda second: f": give each a folder, as in `hgorun simulate {quote(str(second))} -o FOLDER`")
    folder = options.output or RESULTS
    faults = Refusals()
    for path in paths:
        single, several = experiments_of(path, options)
        for experiment in single:
            with faults.of_a_part():
                runs.append(prepare(experiment))
            alone = experiment.name == path.stem
            targets.append((folder if alone else folder / path.stem) / f"{experiment.name}.h5")
        ensembles += [(run, folder / path.stem / f"{run.name}.sweep.h5") for run in several]
    faults.refuse()
    if options.output is not None and options.output.suffix.lower() in RESULT_SUFFIXES:
        if len(runs) + len(ensembles) > 1:
            files = len(options.configs)
            count = len(runs) + len(ensembles)
            what = f"{files} configurations" if files > 1 else f"{count} runs in {options.configs[0]}"
            raise ConfigError(f"--output: {options.output} is one file, but there are {what}; name a folder")
        return runs, [options.output] * len(runs), [(run, options.output) for run, _ in ensembles]
    return runs, targets, ensembles


def _check_export(
    options: Simulate, runs: Sequence[PreparedRun], targets: Sequence[Path], ensembles: Sequence[object]
) -> None:
    """Refuse to write several runs into one text, what would not fit one, and over what is read or written."""
    file = options.export_csv
    if file is None:
        return
    if len(runs) != 1 or ensembles:
        raise ConfigError(f"--export-csv: {file} is one file, and takes one run: name it with --run")
    if runs[0].grid.size > LONG:
        raise ConfigError(f"--export-csv: more than {LONG} output points are in the result file alone")
    refuse_original(file, "--export-csv")
    refuse_same(file, targets)


def _exported(options: Simulate, result: Result) -> list[Path]:
    """The trajectories as text, where that is asked for."""
    if options.export_csv is None:
        return []
    from hgorun.tables.trajectories import csv

    write_text(options.export_csv, csv(result))
    return [options.export_csv]
