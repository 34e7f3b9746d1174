"""What several test modules share: running a configuration that is written in the test."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

import hgorun
from hgorun import Experiment, Result


def write(folder: Path, config: str | Mapping[str, Any]) -> Path:
    """The configuration as a file."""
    path = folder / "experiment.yaml"
    path.write_text(config if isinstance(config, str) else yaml.safe_dump(config, sort_keys=False))
    return path


def load(folder: Path, config: str | Mapping[str, Any], *overrides: str) -> Experiment:
    return hgorun.load(write(folder, config), overrides)


def run(folder: Path, config: str | Mapping[str, Any], *overrides: str, **options: Any) -> Result:
    """Simulate YAML text, or the same as a mapping, with ``path=value`` assignments on top."""
    return hgorun.simulate(load(folder, config, *overrides), **options)
