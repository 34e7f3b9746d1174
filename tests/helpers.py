"""What several test modules share: running a configuration that is written in the test."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

import hgorun
from hgorun import Experiment, Result, simulate
from hgorun.analysis.finding import Finding, all_findings
from hgorun.simulation.run import Run
from hgorun.simulation.simulate import prepare


def load(folder: Path, config: str | Mapping[str, Any], *overrides: str) -> Experiment:
    """The experiment of YAML text, or of the same as a mapping, with ``path=value`` assignments on top."""
    path = folder / "experiment.yaml"
    path.write_text(config if isinstance(config, str) else yaml.safe_dump(config, sort_keys=False))
    return hgorun.load(path, overrides)


def run(folder: Path, config: str | Mapping[str, Any], *overrides: str, **options: Any) -> Result:
    """Simulate it."""
    return simulate(load(folder, config, *overrides), **options)


def prepared(folder: Path, config: str | Mapping[str, Any], *overrides: str) -> Run:
    """All that is decided before the first step: the engine's tables and numbers."""
    return prepare(load(folder, config, *overrides))


def findings(*files: str) -> list[Finding]:
    """The findings declared in some files of hgorun/analysis/findings."""
    return [one for one in all_findings() if one.of.__module__.rpartition(".")[2] in files]
