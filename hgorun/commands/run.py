"""What the commands that carry out runs share: which runs a file has, their progress, and their results as JSON."""

from __future__ import annotations

import json as json_text
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hgorun.commands.kept import tell_what_runs_keep
from hgorun.commands.options import Configured
from hgorun.config.refusals import Refusals
from hgorun.progress import shown
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.other_faults import check_parts
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import simulate_prepared
from hgorun.study.check import check_figures
from hgorun.study.loading import load, load_study

if TYPE_CHECKING:
    from hgorun.study.study import Run
    from hgorun.tables.metrics import Predicted


def experiments_of(path: Path, options: Configured) -> tuple[list[Experiment], list[Run]]:
    """The run named, or all single runs of a file, and its ensembles."""
    if options.run is not None:
        one = load(path, options.overrides, seed=options.seed, run=options.run)
        tell_what_runs_keep(path, options)
        return [one], []
    study = load_study(path, options.overrides, seed=options.seed)
    if len(study.runs) == 1 and path.stem in study.runs:  # figures beside the run are checked before it
        check_figures(study)
    several = [run for run in study.runs.values() if not run.single]
    faults, single = Refusals(), []
    for run in study.runs.values():
        with faults.of_a_part():
            single += [run.experiment] if run.single else []
    for experiment in single if faults.found else ():  # what else is wrong is said with it
        with faults.of_a_part():
            check_parts(experiment)
    faults.refuse()
    tell_what_runs_keep(path, options)
    return single, several


def run_with_progress(run: PreparedRun, *, show: bool) -> Result:
    """Run, with progress if it is to be shown."""
    with shown(1.0, run.experiment.name, show=show) as progress:
        return simulate_prepared(run, progress=progress.update if show else None)


def print_json(
    results: Sequence[Result],
    files: Sequence[str],
    predicted: Sequence[Predicted] = (),
    others: Sequence[dict[str, object]] = (),
) -> None:
    """One object for one result, a list for several; those of ensembles last."""
    theory = list(predicted) or [{} for _ in results]
    from hgorun.tables.metrics import as_json

    found = [*(as_json(*each) for each in zip(results, files, theory, strict=True)), *others]
    print(json_text.dumps(found[0] if len(found) == 1 else found, indent=2, allow_nan=False))
