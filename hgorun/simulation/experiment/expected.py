"""What a program of Python has to give where an experiment is meant."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hgorun.config.types import describe
from hgorun.errors import ConfigError
from hgorun.simulation.experiment.experiment import Experiment


def require_experiment(given: object) -> None:
    """Refuse what is none, as a notebook without type checks may give.

    Raises
    ------
    ConfigError
    """
    if not isinstance(given, Experiment):
        what = "; hgorun.load reads one from a file or a mapping" if isinstance(given, str | Path | Mapping) else ""
        raise ConfigError(f"experiment: expected an Experiment, found {describe(given)}{what}")
