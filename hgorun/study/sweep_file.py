"""From a sweep file to an ensemble."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from hgorun.config.expressions import nearest
from hgorun.config.kinds import refuse_file_of_another_command
from hgorun.config.nearest import meant
from hgorun.config.reading import extended, read_source
from hgorun.config.refusals import within_run
from hgorun.config.sweeps import SweepFile
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.errors import ConfigError
from hgorun.result.hdf5.not_yet import steps_to_an_ensemble
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.study.ensembles import ensemble_of
from hgorun.study.loading import load
from hgorun.study.study import Run, study_of

_OF_A_CONFIGURATION = ("extends", "plant", "observers", "time")


def load_sweeps(path: str | Path, run: str | None = None) -> dict[str, Ensemble]:
    """The ensembles of a file: that of a sweep file, or those of the runs of a configuration with seeds or vary.

    Parameters
    ----------
    path : path
    run : str, optional
        Only that of this run.

    Returns
    -------
    dict of str to Ensemble
        By what their files are called: the name of the file, or that of the run in a folder named after the file.

    Raises
    ------
    ConfigError
        For anything wrong in them: file, line, key, what was found and what would be right.
    """
    path = Path(path)
    text, source = read_source(path)
    refuse_file_of_another_command(source.data, path, "sweep")
    keys = source.data if isinstance(source.data, dict) else {}
    if "axes" in keys or not any(key in keys for key in _OF_A_CONFIGURATION):
        if run is not None:
            raise ConfigError("--run goes with a configuration; a sweep file has the key run", file=str(path))
        return {path.stem: load_sweep(path)}
    runs = study_of(source, path.stem, text).runs
    found = {name: ensemble_of(one) for name, one in runs.items() if not one.single and run in (None, name)}
    if not found:
        known = [name for name, one in runs.items() if not one.single]
        what = f"no run with seeds or vary is called {run!r}. Known: {', '.join(known)}{meant(run or '', known)}"
        steps, _ = steps_to_an_ensemble(path, next(iter(runs)) if "runs" in keys else None)
        nothing = f"none of its runs has seeds or vary; a sweep file has base, axes and keep, such as for {steps}"
        raise ConfigError(what if known else nothing, file=str(path))
    return {f"{path.stem}/{name}": ensemble for name, ensemble in found.items()}


def load_sweep(path: str | Path) -> Ensemble:
    """Read and check a sweep file with its base.

    Raises
    ------
    ConfigError
        For anything wrong in them: file, line, key, what was found and what would be right.
    """
    path = Path(path)
    text, source = read_source(path)
    blocks = validate(SweepFile, source.data, source, ())
    base = _base(blocks, source, path)
    with source.located():
        ensemble = Ensemble(name=path.stem, base=base, blocks=blocks, title=blocks.title, text=text)
        ensemble.check()
    return ensemble


def _base(blocks: SweepFile, source: Source, path: Path) -> Experiment:
    """What members vary."""
    file, line = source.where(("base",))
    if isinstance(blocks.base, str):
        target = path.parent / blocks.base
        try:
            text, inner = read_source(target)
            if isinstance(inner.data, dict) and "runs" in inner.data:
                return _run(study_of(inner, target.stem, text).runs, blocks.run, source)
            return load(target, run=blocks.run)
        except ConfigError as error:
            if error.line is None:
                raise ConfigError(f"{target}: {error.message}", file=file, line=line, key="base") from error
            error.others = tuple(one for one in error.others if not _is_varied(within_run(one.key or ""), blocks.axes))
            raise
    try:
        return _written_here(blocks, source, path)
    except ConfigError as error:
        if error.key is None or error.file != file or error.key == "run":
            raise
        told = _of_the_base(error)
        told.add_others(_of_the_base(one) if one.file == file else one for one in error.others)
        raise told from error


def _of_the_base(error: ConfigError) -> ConfigError:
    """A fault of a base that is part of the sweep file, with its key there."""
    key = error.key and f"base.{error.key}"
    return ConfigError(error.message, file=error.file, line=error.line, key=key)


def _is_varied(key: str, axes: Iterable[str]) -> bool:
    """Whether an axis puts another value in the place of a key."""
    names = key.split(".")
    paths = (axis.split(".") for axis in axes)
    return any(len(path) == len(names) and all(map(_fits, path, names)) for path in paths)


def _fits(part: str, name: str) -> bool:
    return part in ("*", name)


def _written_here(blocks: SweepFile, source: Source, path: Path) -> Experiment:
    """The base, where it is part of the sweep file."""
    inner = extended(source.below(("base",)), path)
    if "runs" not in inner.data:
        if blocks.run is not None:
            raise _wrong(source, "the base has no runs")
        return Experiment(inner, name=path.stem)
    return _run(study_of(inner, path.stem, "").runs, blocks.run, source)


def _run(runs: Mapping[str, Run], name: str | None, source: Source) -> Experiment:
    """The run of a base that the key ``run`` names."""
    known = [one for one, run in runs.items() if run.single]
    if name is not None and name in known:
        return runs[name].base
    if not known:
        raise _wrong(source, "all runs of the base are ensembles themselves; members vary a single run")
    asked = f"expected one of {', '.join(known)}."
    if name is not None and name in runs:
        kind = runs[name].ensemble.kind
        raise _wrong(source, f"the run {name!r} is an ensemble itself, by {kind}; members vary a single run: {asked}")
    raise _wrong(source, f"{asked}{nearest(name or '', known)}")


def _wrong(source: Source, message: str) -> ConfigError:
    file, line = source.where(("run",))
    return ConfigError(message, file=file, line=line, key="run")
