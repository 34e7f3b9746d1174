"""From a sweep file to an ensemble."""

from __future__ import annotations

from pathlib import Path

from hgorun.config.expressions import nearest
from hgorun.config.reading import extended, read_source
from hgorun.config.sweeps import SweepFile
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.ensemble.ensemble import Ensemble
from hgorun.errors import ConfigError
from hgorun.simulation.experiment import Experiment
from hgorun.study.loading import load
from hgorun.study.study import study_of

_OF_A_CONFIGURATION = ("plant", "observers", "time")


def load_sweep(path: str | Path) -> Ensemble:
    """Read and check a sweep file with its base.

    Raises
    ------
    ConfigError
        For anything wrong in them: file, line, key, what was found and what would be right.
    """
    path = Path(path)
    text, source = read_source(path)
    keys = source.data if isinstance(source.data, dict) else {}
    if any(key in keys for key in _OF_A_CONFIGURATION) and "axes" not in keys:
        raise ConfigError("this is a configuration; a sweep file has base, axes and keep", file=str(path))
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
            return load(target, run=blocks.run)
        except ConfigError as error:
            if error.line is None:
                raise ConfigError(f"{target}: {error.message}", file=file, line=line, key="base") from error
            raise
    inner = extended(source.below(("base",)), path)
    if "runs" not in inner.data:
        if blocks.run is not None:
            raise _wrong(source, "the base has no runs")
        return Experiment(inner, name=path.stem)
    runs = study_of(inner, path.stem, "").runs
    if blocks.run is None or blocks.run not in runs:
        raise _wrong(source, f"expected one of {', '.join(runs)}.{nearest(blocks.run or '', runs)}")
    return runs[blocks.run].experiment


def _wrong(source: Source, message: str) -> ConfigError:
    file, line = source.where(("run",))
    return ConfigError(message, file=file, line=line, key="run")
