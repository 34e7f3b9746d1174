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
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.recipe import written
from hgorun.files import json_value
from hgorun.measurement.blocks import noise_blocks
from hgorun.result.metrics.base import all_metrics
from hgorun.version import __version__

Ingredients: TypeAlias = dict[str, Any]
_SHOWN = 3  # differences that a message names
_LONG = 100  # characters of a value that a message shows
_MISSING = "nothing"


@cache
def own_code() -> Mapping[str, str]:
    """By room the hash of what computes members, comments included: a short sweep has no time for more."""
    return {room: digest[:16] for room, digest in code([*RUN, *ENSEMBLE], exact=True).items()}


def ingredients(ensemble: Ensemble) -> Ingredients:
    """All that the numbers follow from, as JSON holds it."""
    base = ensemble.base
    noise = chain.from_iterable(items for _, items in noise_blocks(base.measurement))
    metrics = all_metrics(closed=True)
    theirs = code_of(metrics[name].measure for name in ensemble.metrics)
    theirs |= code_of(map(type, (base.plant_block, *base.observers.values(), *noise)))
    return {
        "version": __version__,
        "code": dict(sorted((dict(own_code()) | theirs).items())),
        "configuration": json_value(base.resolved()),
        "sweep": json_value(written(ensemble.blocks)),
    }


def fingerprint(made_of: Ingredients) -> str:
    """The hash of ingredients, and of their order: that of axes numbers the members, that of observers the columns."""
    return hashlib.sha256(json.dumps(made_of).encode()).hexdigest()


def difference(before: Ingredients, now: Ingredients) -> str:
    """In one phrase what has changed, of ingredients with different fingerprints.

    The version is named before the code, and the code before the configuration: each may be why the next differs.
    """
    if before["version"] != now["version"]:
        return f"hgorun {before['version']} -> {now['version']}"
    rooms = sorted(_differences(before["code"], now["code"]))
    if rooms:
        return "; ".join(
            f"the code of {' and '.join(names)} {what}"
            for what in ("changed", "was not there", "is gone")
            if (names := [name for name, old, new in rooms if _what(old, new) == what])
        )
    parts = [(before[part], now[part]) for part in ("configuration", "sweep")]
    changes = [f"{path}: {old} -> {new}" for old, new in parts for path, old, new in _differences(old, new)]
    changes = changes or [words for old, new in parts for words in _orders(old, new)]
    more = f" and {len(changes) - _SHOWN} more" if len(changes) > _SHOWN else ""
    return "; ".join(changes[:_SHOWN]) + more


def _what(old: str, new: str) -> str:
    return "was not there" if old == _MISSING else "is gone" if new == _MISSING else "changed"


def _differences(before: object, now: object) -> Iterator[tuple[str, str, str]]:
    """(path, old, new) of the scalars and lists of scalars that differ; long ones from shortly before they do."""
    old, new = _leaves(before), _leaves(now)
    for path in dict.fromkeys([*old, *new]):
        one, other = old.get(path, _MISSING), new.get(path, _MISSING)
        if one != other:
            equal = next((i for i, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), 0)
            yield path, _around(one, equal), _around(other, equal)


def _around(text: str, place: int) -> str:
    """A text, or where it is long what stands around a place in it."""
    if len(text) <= _LONG:
        return text
    start = max(place - _LONG // 2, 0)
    return "..." * (start > 0) + text[start : start + _LONG] + "..." * (start + _LONG < len(text))


def _leaves(data: object) -> dict[str, str]:
    """{path: value as text} of everything that holds nothing else."""
    return {
        ".".join(map(str, path)): json.dumps(value)
        for path, value in walk(data)
        if not isinstance(value, (dict, list)) or not value
    }


def _orders(before: object, now: object) -> Iterator[str]:
    """What stands in another order, where nothing else differs."""
    new = dict(walk(now))
    for path, value in walk(before):
        other = new.get(path)
        if isinstance(value, dict) and isinstance(other, dict) and list(value) != list(other):
            yield f"{'.'.join(map(str, path))}: the order {', '.join(value)} -> {', '.join(other)}"
