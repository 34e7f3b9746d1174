"""Paths into plain data: dictionaries, lists and scalars inside each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from hgorun.errors import KeyPath


def entries(value: object) -> Iterable[tuple[str | int, object]]:
    """The keys and values of a mapping, the indices and values of a list, nothing of a scalar."""
    if isinstance(value, dict):
        return value.items()
    return enumerate(value) if isinstance(value, list) else ()


def walk(data: object) -> Iterator[tuple[KeyPath, object]]:
    """Yield every value in ``data`` with its path, the whole first."""
    todo: list[tuple[KeyPath, object]] = [((), data)]
    while todo:
        path, value = todo.pop()
        yield path, value
        todo += [((*path, key), part) for key, part in entries(value)]


def at(data: Any, path: KeyPath) -> Any:
    """The value at ``path``, which must exist."""
    for key in path:
        data = data[key]
    return data


def copy(data: Any) -> Any:  # no deeper than yaml_builder.MAX_DEPTH
    """Copy dictionaries and lists; scalars are shared."""
    if isinstance(data, dict):
        return {key: copy(part) for key, part in data.items()}
    return [copy(part) for part in data] if isinstance(data, list) else data


def dotted(path: KeyPath) -> str | None:
    """The path as messages show it; None for the whole."""
    return ".".join(str(key)[:100] for key in path) or None


_BLOCKS = {"observer": "observers", "plant": "plant", "noise": "measurement"}


def naming(data: object, kind: str, name: str) -> KeyPath | None:
    """The first block that names an observer, a plant or a noise as its type; None where there is none."""
    paths = (
        path
        for path, value in walk(data)
        if path[:1] == (_BLOCKS.get(kind),) and isinstance(value, dict) and value.get("type") == name
    )
    return min(paths, key=str, default=None)
