"""A configuration with other values in it: the file's own text where they stand in it, comments and all."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias, TypeGuard

import yaml

from hgorun.config.differences import different
from hgorun.config.overrides import replaced
from hgorun.config.paths import at, copy
from hgorun.config.reading import read_source
from hgorun.config.yaml_source import Source
from hgorun.errors import KeyPath
from hgorun.files import real_path

Value: TypeAlias = bool | int | float | str | list[Any]

_COLUMNS = ("outputs", "inputs", "reference")
_DIGITS = 6


def with_values(
    path: Path, values: Mapping[str, Value], target: Path, *, run: str | None = None, overrides: Sequence[str] = ()
) -> str:
    """The text of a configuration with values in place of its own; numbers have all their digits.

    Where all of them stand in the file as single values, its text is kept but for them, and for the names of the files
    that it extends and that hold its data, which are written as seen from the target. Otherwise the text is a file
    that extends it.

    Parameters
    ----------
    path : Path
        The configuration.
    values : mapping of str to value
        By path, as after ``--set``.
    target : Path
        Where the text will stand.
    run : str, optional
        Whose values they are, where the file has several runs.
    overrides : sequence of str, optional
        Assignments of ``--set`` that the text has, too.
    """
    text, before = read_source(path)
    _, source = read_source(path, overrides)
    way = Path(os.path.relpath(real_path(path.parent), real_path(target.parent)))
    if way != Path():
        source = replace(source, data=beside(source, path.parent, target.parent))
    changes = dict(different(before.data, source.data))
    scalars = _scalars(yaml.compose(text, Loader=yaml.SafeLoader))
    edits: dict[KeyPath, str] = {}
    for place, value in changes.items():
        if place not in scalars or not _is_single(value):
            return _on_top(way / path.name, values, source, run, changes)
        edits[place] = _written(value)
    for name, value in values.items():
        found = next((place for place in _places(source, name, value, run) if place in scalars), None)
        if found is None or not _is_single(value):
            return _on_top(way / path.name, values, source, run, changes)
        edits[found] = _written(value)
    extended = scalars.get(("extends",))
    if extended is not None and way != Path():
        edits[("extends",)] = _quoted(str(way / str(extended.value)))
    nodes = {place: scalars[place] for place in edits}
    for place, node in sorted(nodes.items(), key=lambda one: -one[1].start_mark.index):
        text = text[: node.start_mark.index] + edits[place] + text[node.end_mark.index :]
    return text


def beside(source: Source, folder: Path, target: Path) -> dict[str, Any]:
    """What a configuration in a folder says, with the files of its data as seen from another folder."""
    data: dict[str, Any] = copy(source.data)
    way = Path(os.path.relpath(real_path(folder), real_path(target)))
    for place, name in _files(source):
        holder: Any = at(data, place[:-1])
        holder[place[-1]] = str(way / name)
    return data


def rounded(number: float) -> float:
    """A number with as many digits as a person reads."""
    return float(f"{number:.{_DIGITS}g}")


def _written(value: bool | int | float | str) -> str:
    """A single value in YAML, a number as short as it can be."""
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.{_DIGITS}g}" if rounded(value) == value else repr(value)


def _places(source: Source, name: str, value: Value, run: str | None) -> list[KeyPath]:
    """Where a value may stand: in the run, else in what all runs share."""
    shared = replaced(source, name, value)[1]
    return [shared] if run is None else [("runs", run, *replaced(source.below(("runs", run)), name, value)[1]), shared]


def _files(source: Source) -> Iterator[tuple[KeyPath, str]]:
    """The files that the block ``data`` names, which are relative to the configuration that is read, and where."""
    data = source.data.get("data") if isinstance(source.data, dict) else None
    block = data if isinstance(data, dict) else {}
    of_all = block.get("file")
    if isinstance(of_all, str):
        yield ("data", "file"), of_all
    elif isinstance(of_all, list):
        yield from ((("data", "file", i), name) for i, name in enumerate(of_all))
    for group in _COLUMNS:
        for name, column in (block.get(group) or {}).items():
            if isinstance(column, dict) and isinstance(column.get("file"), str):
                yield ("data", group, name, "file"), column["file"]


def _on_top(
    base: Path, values: Mapping[str, Value], source: Source, run: str | None, changes: Iterable[KeyPath]
) -> str:
    """A file that extends another one and has the values of its own, and those of a source at some places.

    Where a value stands in a list, that list: one on top of another replaces it as a whole. What the source does not
    have is removed.
    """
    data: dict[str, Any] = {"extends": str(base)}
    places: list[KeyPath] = []
    for name, value in values.items():
        source, place = replaced(source, name, value)
        places.append(place)
    for place in dict.fromkeys(map(_outside_lists, places)):
        _put(data, place if run is None else ("runs", run, *place), at(source.data, place))
    for place in dict.fromkeys(map(_outside_lists, changes)):
        _put(data, place, at(source.data, place[:-1]).get(place[-1]))
    return str(yaml.safe_dump(copy(data), sort_keys=False, allow_unicode=True))


def _outside_lists(place: KeyPath) -> KeyPath:
    """A place, or that of the outermost list around it."""
    index = next((i for i, key in enumerate(place) if isinstance(key, int)), len(place))
    return place[:index]


def _put(data: dict[str, Any], place: KeyPath, value: object) -> None:
    _holder(data, place[:-1])[str(place[-1])] = value


def _holder(data: dict[str, Any], above: Iterable[str | int]) -> dict[str, Any]:
    """The mapping at a place, made where there is none."""
    for key in above:
        data = data.setdefault(str(key), {})
    return data


def _scalars(root: yaml.Node | None) -> dict[KeyPath, yaml.ScalarNode]:
    """The scalars of a document by their paths, without those that stand for several values by an alias."""
    found: dict[KeyPath, yaml.ScalarNode] = {}
    seen: Counter[int] = Counter()
    todo: list[tuple[KeyPath, yaml.Node]] = [((), root)] if root is not None else []
    while todo:
        path, node = todo.pop()
        if isinstance(node, yaml.ScalarNode):
            found[path] = node
            seen[node.start_mark.index] += 1
        elif isinstance(node, yaml.MappingNode):
            todo += [((*path, str(key.value)), value) for key, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            todo += [((*path, i), value) for i, value in enumerate(node.value)]
    return {path: node for path, node in found.items() if seen[node.start_mark.index] == 1}


def _is_single(value: object) -> TypeGuard[bool | int | float | str]:
    return isinstance(value, bool | int | float | str)


def _quoted(name: str) -> str:
    return "'" + name.replace("'", "''") + "'"
