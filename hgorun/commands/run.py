"""``simulate`` and ``compare``."""

from __future__ import annotations

import json as json_text
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from hgorun.commands.ensemble_options import Compare
from hgorun.commands.inputs import configuration, is_result, may_be_ensemble
from hgorun.commands.options import Configured, Simulate
from hgorun.commands.outputs import (
    DRAWING_SUFFIXES,
    NOT_OK,
    RESULT_SUFFIXES,
    RESULTS,
    formats,
    refuse_no_csv,
    refuse_other_kinds,
    there,
    written,
)
from hgorun.commands.remarks import warn
from hgorun.errors import ConfigError
from hgorun.files import remove_leftovers, write_text
from hgorun.process import say
from hgorun.progress import shown
from hgorun.result.result import Result
from hgorun.result.run_names import numbered
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.grid import LONG
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_into, simulate_prepared
from hgorun.study.check import check_figures
from hgorun.study.loading import load, load_study

if TYPE_CHECKING:
    from hgorun.figures.page import Page
    from hgorun.study.study import Run
    from hgorun.tables.metrics import Predicted

# What else somebody may have meant by --output of simulate.
_INSTEAD = {
    ".csv": "--export-csv FILE writes the states over time, hgorun compare --format csv prints the metrics",
    ".txt": "--export-csv FILE writes the states over time, hgorun compare prints the metrics",
    ".png": "hgorun compare CONFIG -o FILE.png draws",
    ".pdf": "hgorun compare CONFIG -o FILE.pdf draws",
}

Style: TypeAlias = "Callable[[Sequence[Result], Sequence[Predicted]], str]"


def simulate(options: Simulate) -> int:
    """Run configurations and write their results; everything is checked before anything runs.

    Runs with seeds or vary are carried out as ensembles, and statistics of them are shown.
    """
    refuse_other_kinds(options.output, RESULT_SUFFIXES, _INSTEAD)
    refuse_no_csv("--export-csv", options.export_csv)
    runs, targets, ensembles = _prepared(options)
    _check_export(options, runs, targets, ensembles)
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
        _print_json(results, files, others=of_ensembles)
    return NOT_OK if options.strict and not fine else 0


def compare(options: Compare) -> int:
    """Show metrics of configurations and result files side by side, and draw plots of them."""
    from hgorun.figures.page import Page

    page = Page.named(options.width, options.style)
    if any(map(may_be_ensemble, options.sources)):
        from hgorun.commands.ensembles import all_ensembles, compare_ensembles

        if all_ensembles(options.sources):
            return compare_ensembles(options)
    if options.of_ensembles:
        raise ConfigError("--metric, --by and --at are for ensembles (NAME.sweep.h5); these are single runs")
    refuse_other_kinds(options.output, DRAWING_SUFFIXES)
    from hgorun.result.reading import read  # not for simulate, which has to be quick

    style = _style(options)
    loaded: list[Result | PreparedRun] = []
    files: list[str] = []
    for path in options.sources:
        if is_result(path):
            loaded.append(read(path))
        else:
            loaded += [prepare(experiment) for experiment in _single(configuration(path), options)]
        files += [str(path)] * (len(loaded) - len(files))
    results = [s if isinstance(s, Result) else run_with_progress(s, show=options.text) for s in loaded]
    predicted = _predicted(loaded, results) if options.analyze else []
    units = {result.units.get("time", "") for result in results}
    if len(units) > 1:
        raise ConfigError(f"the sources use different units of time: {', '.join(sorted(units))}")
    for result in results:
        warn(result)
    if options.plots:
        remove_leftovers(_folder_of_plots(options))
    if options.json:
        _print_json(results, files, predicted)
    elif not options.quiet:
        print(style(results, predicted))
    if options.plots:
        before = there([] if options.output is None else [options.output])
        drawn = _draw(results, options, page)
        if options.text and options.format == "text":
            print(written(drawn, before))
    return NOT_OK if options.strict and any(r.status != "ok" for r in results) else 0


def _style(options: Compare) -> Style:
    """The table asked for, once it is sure that the options fit each other."""
    from hgorun.tables import metrics as tables
    from hgorun.tables.latex import latex

    styles: dict[str, Style] = {
        "text": tables.text,
        "csv": tables.csv,
        "latex": lambda results, _: latex(results),
    }
    if options.format not in styles:
        raise ConfigError(f"--format: expected one of {', '.join(styles)}, found {options.format!r}")
    if options.analyze and options.format == "latex":
        raise ConfigError("--analyze adds columns to text, csv and JSON; the LaTeX table has metrics only")
    if (options.overrides or options.seed is not None) and all(map(is_result, options.sources)):
        raise ConfigError("--set and --seed apply to configurations, not to result files")
    return styles[options.format]


def _folder_of_plots(options: Compare) -> Path:
    output = options.output or RESULTS
    return output.parent if output.suffix.lower() in DRAWING_SUFFIXES else output


def _draw(results: Sequence[Result], options: Compare, page: Page) -> list[Path]:
    from hgorun.figures.drawing import comparison
    from hgorun.figures.files import save

    if options.output is not None and options.output.suffix.lower() in DRAWING_SUFFIXES:
        return save(comparison(results, page), options.output.with_suffix(""), formats(options.output))
    several = len(options.sources) > 1
    name = "comparison" if several else f"{options.sources[0].stem}-comparison"
    return save(comparison(results, page), (options.output or RESULTS) / name)


def _prepared(options: Simulate) -> tuple[list[PreparedRun], list[Path], list[tuple[Run, Path]]]:
    """All single runs of the files and where each result goes, and all ensembles with their files."""
    runs: list[PreparedRun] = []
    targets: list[Path] = []
    ensembles: list[tuple[Run, Path]] = []
    paths = [configuration(path) for path in options.configs]
    for path, name in zip(paths, numbered([path.stem for path in paths]), strict=True):
        single, several = _experiments(path, options)
        folder = options.output or RESULTS
        for experiment in single:
            alone = experiment.name == path.stem
            runs.append(prepare(experiment.varied({}, name=name) if alone and name != path.stem else experiment))
            targets.append(folder / f"{name}.h5" if alone else folder / name / f"{experiment.name}.h5")
        ensembles += [(run, folder / name / f"{run.name}.sweep.h5") for run in several]
    if options.output is not None and is_result(options.output):
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
    if file.resolve() in {path.resolve() for path in (*options.configs, *targets)}:
        raise ConfigError(f"--export-csv: {file} is read or written otherwise: name another file")


def _exported(options: Simulate, result: Result) -> list[Path]:
    """The trajectories as text, where that is asked for."""
    if options.export_csv is None:
        return []
    from hgorun.tables.trajectories import csv

    write_text(options.export_csv, csv(result))
    return [options.export_csv]


def _experiments(path: Path, options: Configured) -> tuple[list[Experiment], list[Run]]:
    """The run named, or all single runs of a file, and its ensembles."""
    if options.run is not None:
        return [load(path, options.overrides, seed=options.seed, run=options.run)], []
    study = load_study(path, options.overrides, seed=options.seed)
    if len(study.runs) == 1 and path.stem in study.runs:  # figures beside the run are checked before it
        check_figures(study)
    several = [run for run in study.runs.values() if not run.single]
    return [run.experiment for run in study.runs.values() if run.single], several


def _single(path: Path, options: Configured) -> list[Experiment]:
    """The single runs of a file, of which there has to be one."""
    single, several = _experiments(path, options)
    names = ", ".join(run.name for run in several)
    if single and several:
        say(f"hgorun: {path}: compared are its single runs; ensembles are left out: {names}: hgorun simulate first")
    if not single:
        raise ConfigError(
            f"all runs are ensembles: {names}; hgorun simulate carries them out, --run NAME compares the first member",
            file=str(path),
        )
    return single


def run_with_progress(run: PreparedRun, *, show: bool) -> Result:
    """Run, with progress if it is to be shown."""
    with shown(1.0, run.experiment.name, show=show) as progress:
        return simulate_prepared(run, progress=progress.update if show else None)


def _predicted(sources: Sequence[PreparedRun | Result], results: Sequence[Result]) -> list[Predicted]:
    """What theory says of configurations; nothing of result files, which hold no equations."""
    from hgorun.analysis.report import analysis_of

    return [
        {} if isinstance(source, Result) else analysis_of(source, result).predicted()
        for source, result in zip(sources, results, strict=True)
    ]


def _print_json(
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
