"""From a configuration file to an experiment, or to the study of all its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from hgorun.config.expressions import nearest
from hgorun.config.kinds import refuse_file_of_another_command
from hgorun.config.reading import overridden, read_source, require_list
from hgorun.config.types import describe
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError
from hgorun.simulation.experiment.configured import written
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.study.check import check_figures_of
from hgorun.study.study import Run, Study, study_of


def load(
    path: str | Path | Mapping[str, Any],
    overrides: Sequence[str] = (),
    *,
    seed: int | None = None,
    run: str | None = None,
) -> Experiment:
    """Read and check a configuration.

    Parameters
    ----------
    path : path or mapping
        A YAML file, or the blocks of an experiment as they stand in one.
    overrides : sequence of str
        ``path=value`` each, as on the command line after ``--set``. Of a file with ``runs`` they change what all runs
        share: a key that a run has itself is ``runs.NAME.`` and the key.
    seed : int, optional
        Overrides the seed in the file, but for runs that have one of their own.
    run : str, optional
        Which, of a file with several ``runs``; of an ensemble the first member.

    Returns
    -------
    Experiment

    Raises
    ------
    ConfigError
        For anything wrong in it: file, line, key, what was found and what would be right.

    Examples
    --------
    >>> hgorun.load("config.yaml", ["observers.SHGO.theta=4"], seed=7).observers["SHGO"].theta
    4.0
    """
    if isinstance(path, Mapping):
        return _of_mapping(path, overrides, seed, run)
    if not isinstance(path, (str, PathLike)):
        raise ConfigError(f"load: expected a file or a mapping, found {describe(path)}")
    return experiment_of(*read_source(path, overrides, seed=seed), path, run)


def _of_mapping(blocks: Mapping[str, Any], overrides: Sequence[str], seed: int | None, run: str | None) -> Experiment:
    if run is not None:
        raise ConfigError("run names one of the runs of a file")
    if "runs" in blocks:
        raise ConfigError("a mapping holds one run; with several `runs` it has to be a file", key="runs")
    require_list(overrides)
    text, source = written(blocks, "experiment")
    experiment = Experiment(overridden(source, overrides, seed), text=text)
    check_figures_of(experiment)
    return experiment


def experiment_of(text: str, source: Source, path: str | Path, run: str | None = None) -> Experiment:
    """The same of a file that has been read.

    Parameters
    ----------
    text : str
        The file as it was written.
    source : Source
    path, run
        As for :func:`load`.

    Raises
    ------
    ConfigError
    """
    refuse_file_of_another_command(source.data, Path(path))
    if not isinstance(source.data, dict) or "runs" not in source.data:
        if run is not None:
            raise ConfigError(f"the file has no runs, so none is called {run!r}", file=str(path))
        experiment = Experiment(source, name=Path(path).stem, text=text)
        check_figures_of(experiment)  # what is wrong is said before anything runs
        return experiment
    return _one_of(study_of(source, Path(path).stem, text).runs, run, source)


def _one_of(runs: Mapping[str, Run], run: str | None, source: Source) -> Experiment:
    if run is not None and run in runs:
        return runs[run].experiment
    file, line = source.where(("runs",))
    known = f"the file has the runs {', '.join(runs)}"
    message = f"no run is called {run!r}.{nearest(run, runs)} " if run is not None else ""
    raise ConfigError(f"{message}{known}: name one with --run, in Python with run=", file=file, line=line, key="runs")


def load_study(path: str | Path, overrides: Sequence[str] = (), *, seed: int | None = None) -> Study:
    """Read a configuration file with all its runs, figures and claims, and check it.

    Parameters
    ----------
    path : path
        A YAML file.
    overrides, seed
        As for :func:`load`.

    Returns
    -------
    Study
        Its ``runs`` are experiments by name; a file without ``runs`` has one, called as the file.

    Raises
    ------
    ConfigError
        For anything wrong in it: file, line, key, what was found and what would be right; where it is no file, since
        a mapping holds one run, which :func:`load` takes.

    Examples
    --------
    >>> {name: list(run.experiment.observers) for name, run in hgorun.load_study("config.yaml").runs.items()}
    {'config': ['SHGO']}
    """
    if not isinstance(path, (str, PathLike)):
        one = "; hgorun.load takes the blocks of one run" if isinstance(path, Mapping) else ""
        raise ConfigError(f"load_study: expected a file, found {describe(path)}{one}")
    text, source = _read(path, overrides, seed)
    return study_of(source, Path(path).stem, text)


def load_runs(path: str | Path, run: str | None = None) -> list[Experiment]:
    """The runs of a file, or one of them, whatever its claims say: for what measures nothing.

    Raises
    ------
    ConfigError
        As of :func:`load`.
    """
    text, source = _read(path, (), None)
    if not isinstance(source.data, dict) or "runs" not in source.data:
        return [load(path, run=run)]
    own = replace(source, data={key: part for key, part in source.data.items() if key != "claims"})
    runs = study_of(own, Path(path).stem, text).runs
    return [one.experiment for one in runs.values()] if run is None else [_one_of(runs, run, source)]


def _read(path: str | Path, overrides: Sequence[str], seed: int | None) -> tuple[str, Source]:
    text, source = read_source(path, overrides, seed=seed)
    refuse_file_of_another_command(source.data, Path(path))
    return text, source


def refuse_twins(paths: Sequence[Path], instead: Callable[[Path], str] = lambda second: "") -> None:
    """Refuse files of the same name, whose results would overwrite each other.

    Parameters
    ----------
    paths : sequence of Path
    instead : callable, optional
        What to do with the second of two, for the end of the sentence.

    Raises
    ------
    ConfigError
    """
    seen: dict[str, Path] = {}
    for path in paths:
        if path.stem in seen:
            two = f"{seen[path.stem]} and {path}"
            raise ConfigError(f"{two} have the same name, and results are named after it{instead(path)}")
        seen[path.stem] = path
