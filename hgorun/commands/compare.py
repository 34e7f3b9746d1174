"""``compare``: metrics side by side, and a figure of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from hgorun.commands.drawn import tell_drawn
from hgorun.commands.ensemble_options import FORMATS, Compare
from hgorun.commands.inputs import configuration, is_result, may_be_ensemble
from hgorun.commands.options import Configured
from hgorun.commands.outputs import (
    DRAWING_SUFFIXES,
    NOT_OK,
    RESULTS,
    formats,
    refuse_other_kinds,
    there,
)
from hgorun.commands.remarks import warn
from hgorun.commands.run import experiments_of, print_json, run_with_progress
from hgorun.config.nearest import no_file, refuse_other
from hgorun.errors import ConfigError
from hgorun.files import refuse_original, remove_leftovers
from hgorun.originals import note_originals
from hgorun.process import say
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

if TYPE_CHECKING:
    from hgorun.figures.page import Page
    from hgorun.tables.metrics import Predicted

Style: TypeAlias = "Callable[[Sequence[Result], Sequence[Predicted]], str]"


def compare(options: Compare) -> int:
    """Show metrics of configurations and result files side by side, and draw plots of them."""
    from hgorun.figures.page import Page

    page = Page.named(options.width, options.style)
    note_originals(options.sources)
    for path in options.sources:
        _refuse_what_is_not_there(path, options)
    if any(map(may_be_ensemble, options.sources)):
        from hgorun.commands.ensembles import compare_ensembles, of_one_kind

        options, ensembles = of_one_kind(options)
        if ensembles:
            return compare_ensembles(options)
    if options.of_ensembles:
        raise ConfigError("--metric, --by and --at are for ensembles (NAME.sweep.h5); these are single runs")
    refuse_other_kinds(options.output, DRAWING_SUFFIXES, default=RESULTS if options.plots else None)
    from hgorun.result.reading import read  # not for simulate, which has to be quick

    style = _style(options)
    loaded: list[Result | PreparedRun] = []
    files: list[str] = []
    for path in options.sources:
        if is_result(path):
            loaded.append(read(path))
        else:
            loaded += [prepare(experiment) for experiment in _single(configuration(path, "compare"), options)]
        files += [str(path)] * (len(loaded) - len(files))
    if options.output is not None:
        refuse_original(options.output, "--output")
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
        print_json(results, files, predicted)
    elif not options.quiet:
        print(style(results, predicted))
    if options.plots:
        before = there([] if options.output is None else [options.output])
        drawn = _draw(results, options, page)
        tell_drawn(drawn, before, options)
    return NOT_OK if options.strict and any(r.status != "ok" for r in results) else 0


def _refuse_what_is_not_there(path: Path, options: Compare) -> None:
    """Before anything is said of what the sources are: a file that is not there is neither a run nor an ensemble."""
    if os.path.isdir(path):
        from hgorun.ensemble.collected.reading import is_sweep

        if not is_sweep(path):
            raise ConfigError("this folder is not that of an ensemble: name the files in it", file=str(path))
    elif not os.path.exists(path) and (is_result(path) or options.of_ensembles):
        found = configuration(path, "compare")
        if not os.path.exists(found):
            raise ConfigError(no_file(path), file=str(path))


def _style(options: Compare) -> Style:
    """The table asked for, once it is sure that the options fit each other."""
    from hgorun.tables import metrics as tables
    from hgorun.tables.latex import latex

    styles: dict[str, Style] = {
        "text": tables.text,
        "csv": tables.csv,
        "latex": lambda results, _: latex(results),
    }
    refuse_other("--format", options.format, FORMATS)
    if options.analyze and options.format == "latex":
        raise ConfigError("--analyze adds columns to text, csv and JSON; the LaTeX table has metrics only")
    if (options.overrides or options.seed is not None) and all(map(is_result, options.sources)):
        raise ConfigError("--set and --seed apply to configurations, not to result files")
    return styles[options.format]


def _single(path: Path, options: Configured) -> list[Experiment]:
    """The single runs of a file, of which there has to be one."""
    single, several = experiments_of(path, options)
    names = ", ".join(run.name for run in several)
    if single and several:
        say(f"hgorun: {path}: compared are its single runs; ensembles are left out: {names}: hgorun simulate first")
    if not single:
        raise ConfigError(
            f"all runs are ensembles: {names}; hgorun simulate carries them out, --run NAME compares the first member",
            file=str(path),
        )
    return single


def _predicted(sources: Sequence[PreparedRun | Result], results: Sequence[Result]) -> list[Predicted]:
    """What theory says of configurations; nothing of result files, which hold no equations."""
    from hgorun.analysis.report import analysis_of

    return [
        {} if isinstance(source, Result) else analysis_of(source, result).predicted()
        for source, result in zip(sources, results, strict=True)
    ]


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
