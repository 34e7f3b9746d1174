"""Configurations written down again: with defaults and changes, as plain values and as YAML."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hgorun.config.overrides import replaced, written_out
from hgorun.config.types import describe
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError, KeyPath
from hgorun.result.records.observer import Coordinates
from hgorun.simulation.experiment.blocks import NOT_OF_A_RUN, PARTS, Checked
from hgorun.symbolic.observability import CanonicalForms

# what is resolved by classes of its own, has been applied already, or decides no number of the run
_NOT_RESOLVED = {*PARTS, *NOT_OF_A_RUN, "extends", "title", "reference"}


def resolved(checked: Checked, coordinates: Mapping[str, Coordinates]) -> dict[str, Any]:
    """The configuration after ``extends``, ``--set`` and defaults: all that the numbers of the run follow from.

    Titles, references, figures and claims are not in it.

    Parameters
    ----------
    coordinates : mapping of str to Coordinates
        What was taken by the observers that have a choice of them.
    """
    values = checked.blocks.model_dump(mode="json", exclude=_NOT_RESOLVED, exclude_none=True)
    values["measurement"] = checked.measurement.model_dump(mode="json", exclude_none=True)
    values["plant"] = checked.plant.model_dump(mode="json", exclude_none=True)
    values["observers"] = {label: plain(o.model_dump(exclude_none=True)) for label, o in checked.observers.items()}
    for label, block in values["observers"].items():
        has_keys = isinstance(checked.observers[label].form, CanonicalForms)
        taken = coordinates.get(label) if has_keys else None
        block |= {"map": taken.map, "chains": dict(taken.chains)} if taken else {}
        if not taken:
            del block["map"], block["chains"]
    return values


def resolved_text(checked: Checked, coordinates: Mapping[str, Coordinates]) -> str:
    """What :func:`resolved` gives, as YAML."""
    return as_yaml(resolved(checked, coordinates))


def changed(source: Source, changes: Mapping[str, Any], seed: int | None = None) -> tuple[Source, set[KeyPath]]:
    """A configuration with other values at some paths, and with another seed where one is given, and those paths.

    Raises
    ------
    ConfigError
        See :func:`~hgorun.config.overrides.replaced` and :func:`~hgorun.config.overrides.written_out`; where the
        changes are no mapping.
    """
    touched = set()
    if not isinstance(changes, Mapping) or not all(isinstance(path, str) for path in changes):
        raise ConfigError(
            'changes: expected a mapping of values by their paths, such as {"observers.SHGO.theta": 2}, '
            f"found {describe(changes)}"
        )
    for path, value in (changes if seed is None else {**changes, "seed": seed}).items():
        value = plain(value)
        for one in written_out(source.data, path):
            source, place = replaced(source, one, value)
            touched.add(place)
    return source, touched


def as_yaml(values: dict[str, Any]) -> str:
    """Plain values as YAML, their keys in the order given."""
    import yaml

    return yaml.safe_dump(values, sort_keys=False, allow_unicode=True)


def plain(value: Any) -> Any:
    """Values as YAML can write them: complex numbers as text, tuples and arrays as lists, numbers as Python's."""
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, complex):
        return value.real if value.imag == 0 else str(value).strip("()")
    return value
