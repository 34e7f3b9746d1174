"""What the numbers of an ensemble follow from, and what differs between two lists of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any, TypeAlias

from hgorun.code import ENSEMBLE, RUN, code, code_of
from hgorun.config.paths import walk
from hgorun.ensemble.ensemble import Ensemble
from hgorun.ensemble.recipe import written
from hgorun.files import json_value
from hgorun.measurement.blocks import noise_blocks
from hgorun.result.metrics.base import all_metrics
from hgorun.version import __version__

Ingredients: TypeAlias = dict[str, Any]
_SHOWN = 3  # differences that a message names
_MISSING = "nothing"


@cache
def own_code() -> Mapping[str, str]:
    """By room the hash of what computes members, comments included: a short sweep has no time for more."""
    return {room: digest[:16] for room, digest in code([*RUN, *ENSEMBLE], exact=True).items()}


def ingredients(ensemble: Ensemble) -> Ingredients:
    """All that the numbers follow from, as JSON holds it."""
    base = ensemble.base
    noise = chain.from_iterable(items for _, items in noise_blocks(base.measurement))
    metrics = all_metrics()
    theirs = code_of(metrics[name].measure for name in ensemble.metrics)
    theirs |= code_of(map(type, (base.plant_block, *base.observers.values(), *noise)))
    return {
        "version": __version__,
        "code": dict(own_code()) | theirs,
        "configuration": json_value(base.resolved()),
        "sweep": json_value(written(ensemble.blocks)),
    }


def fingerprint(made_of: Ingredients) -> str:
    """The hash of ingredients."""
    return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()


def difference(before: Ingredients, now: Ingredients) -> str | None:
    """In one phrase what has changed; None for nothing.

    The version is named before the code, and the code before the configuration: each may be why the next differs.
    """
    if before.get("version") != now["version"]:
        return f"hgorun {before.get('version', 'unknown')} -> {now['version']}"
    rooms = sorted(_differences(before.get("code", {}), now["code"]))
    if rooms:
        return "; ".join(
            f"the code of {' and '.join(names)} {what}"
            for what in ("changed", "was not there", "is gone")
            if (names := [name for name, old, new in rooms if _what(old, new) == what])
        )
    changes = [
        f"{prefix}{path}: {old} -> {new}"
        for part, prefix in (("configuration", ""), ("sweep", ""))
        for path, old, new in _differences(before.get(part, {}), now[part])
    ]
    if not changes:
        return None
    more = f" and {len(changes) - _SHOWN} more" if len(changes) > _SHOWN else ""
    return "; ".join(changes[:_SHOWN]) + more


def _what(old: str, new: str) -> str:
    return "was not there" if old == _MISSING else "is gone" if new == _MISSING else "changed"


def _differences(before: Any, now: Any) -> Iterator[tuple[str, str, str]]:
    """(path, old, new) of the scalars and lists of scalars that differ."""
    old, new = _leaves(before), _leaves(now)
    for path in dict.fromkeys([*old, *new]):
        if old.get(path, _MISSING) != new.get(path, _MISSING):
            yield path, old.get(path, _MISSING), new.get(path, _MISSING)


def _leaves(data: Any) -> dict[str, str]:
    """{path: value as text} of everything that holds nothing else."""
    return {
        ".".join(map(str, path)): json.dumps(value)[:100]
        for path, value in walk(data)
        if not isinstance(value, (dict, list)) or not value
    }
