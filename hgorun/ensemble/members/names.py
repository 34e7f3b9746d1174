"""Axes that give a value to a name the base has none for: only a prepared run tells whether there is such a name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hgorun.errors import ConfigError, HgorunError
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import prepare

_TO_A_BLOCK = 2  # keys of a path to a block: what is longer leads into it, as to a state in plant.initial


def new_names(base: Experiment, paths: Sequence[str]) -> list[str]:
    """Those of some paths into blocks that lead to nothing in the base."""
    return [path for path in paths if path.count(".") >= _TO_A_BLOCK and not _is_there(base.source.data, path)]


def why_not_there(experiment: Experiment, paths: Sequence[str]) -> ConfigError | None:
    """Why an experiment cannot be run because of what stands at some paths; None where that is not why, or it can."""
    try:
        prepare(experiment)
    except HgorunError as error:
        if isinstance(error, ConfigError) and any(_is_told(error, path) for path in paths):
            return error
    return None


def _is_told(error: ConfigError, path: str) -> bool:
    """Whether an error is about a path, or about the name at its end in the block around it."""
    block, _, name = path.rpartition(".")
    return error.key == path or (error.key == block and repr(name) in error.message)


def _is_there(data: Any, path: str) -> bool:
    """Whether a path leads to a key, or to an entry of a list."""
    for key in path.split("."):
        if isinstance(data, dict):
            if key not in data:
                return False
            data = data[key]
    return True
