"""``simulate`` and ``compare``."""

from __future__ import annotations

import json as json_text
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hgorun.errors import ConfigError
from hgorun.result.reading import read
from hgorun.result.result import Result
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import perform, prepare
from hgorun.study.loading import load, load_study, refuse_twins
from hgorun.tables import metrics as tables

RESULTS = Path("results")
DIVERGED = 3
_RESULT_SUFFIXES = {".h5", ".hdf5", ".nc"}


def simulate(
    configs: Sequence[Path],
    output: Path | None,
    overrides: Sequence[str],
    seed: int | None,
    *,
    quiet: bool,
    json: bool,
    strict: bool,
    check_step: bool,
    run: str | None = None,
) -> int:
    """Run configurations and write their results; everything is checked before anything runs."""
    runs, targets = _prepared(configs, output, overrides, seed, run)
    results, files = [], []
    for prepared, target in zip(runs, targets, strict=True):
        result = execute(prepared, quiet or json, check_step=check_step)
        files.append(str(result.save(target)))
        results.append(result)
        warn(result)
        if not quiet and not json:
            print(tables.text([result]))
            print(f"written: {target}")
    if json:
        _print_json(results, files)
    return DIVERGED if strict and any(r.status != "ok" for r in results) else 0


def compare(
    sources: Sequence[Path],
    output: Path | None,
    overrides: Sequence[str],
    seed: int | None,
    *,
    quiet: bool,
    json: bool,
    style: str,
    plots: bool,
    strict: bool,
    run: str | None = None,
    analyze: bool = False,
) -> int:
    """Metrics of configurations and result files side by side, and plots of them."""
    styles: dict[str, Callable[[Sequence[Result], Sequence[tables.Predicted]], str]] = {
        "text": tables.text,
        "csv": tables.csv,
        "latex": lambda results, _: tables.latex(results),
    }
    if style not in styles:
        raise ConfigError(f"--format: expected one of {', '.join(styles)}, found {style!r}")
    if analyze and style == "latex":
        raise ConfigError("--analyze adds columns to text, csv and JSON; the LaTeX table has metrics only")
    if (overrides or seed is not None) and all(path.suffix.lower() in _RESULT_SUFFIXES for path in sources):
        raise ConfigError("--set and --seed change configurations; a result file stays as it is")
    loaded: list[Result | PreparedRun] = []
    for path in sources:
        if path.suffix.lower() in _RESULT_SUFFIXES:
            loaded.append(read(path))
        else:
            loaded += [prepare(experiment) for experiment in _experiments(path, overrides, seed, run)]
    results = [s if isinstance(s, Result) else execute(s, quiet or json, check_step=False) for s in loaded]
    predicted = _predicted(loaded, results) if analyze else []
    units = {result.units.get("time", "") for result in results}
    if len(units) > 1:
        raise ConfigError(f"the sources count time in different units: {', '.join(sorted(units))}")
    for result in results:
        warn(result)
    if json:
        _print_json(results, [str(p) for p in sources], predicted)
    elif not quiet:
        print(styles[style](results, predicted))
    if plots:
        from hgorun.figures import comparison, save

        name = f"{sources[0].stem}-comparison" if len(sources) == 1 else "comparison"
        target = (output or RESULTS) / name
        if output is not None and output.suffix.lower() in {".png", ".pdf"}:
            target = output.with_suffix("")
        written = save(comparison(results), target)
        if not quiet and not json and style == "text":
            print("written: " + ", ".join(map(str, written)))
    return DIVERGED if strict and any(r.status != "ok" for r in results) else 0


def _prepared(
    configs: Sequence[Path], output: Path | None, overrides: Sequence[str], seed: int | None, run: str | None
) -> tuple[list[PreparedRun], list[Path]]:
    """All runs of the files, and where each result goes."""
    refuse_twins(configs)
    runs, targets = [], []
    for path in configs:
        for experiment in _experiments(path, overrides, seed, run):
            runs.append(prepare(experiment))
            folder = output or RESULTS
            inside = folder / path.stem if experiment.name != path.stem else folder
            targets.append(inside / f"{experiment.name}.h5")
    if output is not None and output.suffix.lower() in _RESULT_SUFFIXES:
        if len(runs) > 1:
            what = f"{len(configs)} configurations" if len(configs) > 1 else f"{len(runs)} runs in {configs[0]}"
            raise ConfigError(f"--output: {output} is one file, but there are {what}; name a folder")
        return runs, [output]
    return runs, targets


def _experiments(path: Path, overrides: Sequence[str], seed: int | None, run: str | None) -> list[Experiment]:
    """The run named, or all single runs of a file; ensembles belong to claims and figures."""
    if run is not None:
        return [load(path, overrides, seed=seed, run=run)]
    study = load_study(path, overrides, seed=seed)
    single = [r.experiment for r in study.runs.values() if r.single]
    if not single:
        raise ConfigError(
            f"all runs are ensembles: {', '.join(study.runs)}; --run takes a first member", file=str(path)
        )
    return single


def execute(run: PreparedRun, quiet: bool, *, check_step: bool) -> Result:
    """Run, with progress for a person at a terminal."""
    show = not quiet and sys.stderr.isatty()

    def progress(part: float) -> None:
        print(f"\r{run.experiment.name}: {100 * part:3.0f} %", end="", file=sys.stderr, flush=True)

    try:
        return perform(run, check_step=check_step, progress=progress if show else None)
    finally:
        if show:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def warn(result: Result) -> None:
    """A diverged observer is a result, and said on stderr."""
    for label, observer in result.observers.items():
        if observer.diverged_at is not None:
            print(f"hgorun: {result.name}: observer {label} {observer.status}", file=sys.stderr)


def _predicted(sources: Sequence[PreparedRun | Result], results: Sequence[Result]) -> list[tables.Predicted]:
    """What theory says of configurations; nothing of result files, which hold no equations."""
    from hgorun.analysis.report import analysis_of

    return [
        {} if isinstance(source, Result) else analysis_of(source, result).predicted()
        for source, result in zip(sources, results, strict=True)
    ]


def _print_json(results: Sequence[Result], files: Sequence[str], predicted: Sequence[tables.Predicted] = ()) -> None:
    """One object for one result, a list for several."""
    theory = list(predicted) or [{} for _ in results]
    found = [tables.as_json(*each) for each in zip(results, files, theory, strict=True)]
    print(json_text.dumps(found[0] if len(found) == 1 else found, indent=2, allow_nan=False))
