"""``simulate`` and ``compare``."""

from __future__ import annotations

import json as json_text
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hgorun import tables
from hgorun.errors import ConfigError
from hgorun.loading import load
from hgorun.result import Result
from hgorun.run import Run
from hgorun.simulation import perform, prepare
from hgorun.store import read

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
) -> int:
    """Run configurations and write their results; everything is checked before anything runs."""
    targets = _targets(configs, output)
    runs = [prepare(load(path, overrides, seed=seed)) for path in configs]
    results, files = [], []
    for run, target in zip(runs, targets, strict=True):
        result = execute(run, quiet or json, check_step=check_step)
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
    loaded = [
        read(path) if path.suffix.lower() in _RESULT_SUFFIXES else prepare(load(path, overrides, seed=seed))
        for path in sources
    ]
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


def _targets(configs: Sequence[Path], output: Path | None) -> list[Path]:
    """Where each result goes."""
    refuse_twins(configs)
    if output is not None and output.suffix.lower() in _RESULT_SUFFIXES:
        if len(configs) > 1:
            raise ConfigError(
                f"--output: {output} is one file, but there are {len(configs)} configurations; name a folder"
            )
        return [output]
    return [(output or RESULTS) / f"{path.stem}.h5" for path in configs]


def refuse_twins(paths: Sequence[Path]) -> None:
    """Refuse files of the same name, whose results would overwrite each other."""
    seen: dict[str, Path] = {}
    for path in paths:
        if path.stem in seen:
            raise ConfigError(f"{seen[path.stem]} and {path} have the same name; results are called by it")
        seen[path.stem] = path


def execute(run: Run, quiet: bool, *, check_step: bool) -> Result:
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


def _predicted(sources: Sequence[Run | Result], results: Sequence[Result]) -> list[tables.Predicted]:
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
