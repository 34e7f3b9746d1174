"""A configuration with other numbers in it: the file's own text where they stand in it, comments and all."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from hgorun.config.overrides import replaced
from hgorun.config.reading import read_source
from hgorun.config.yaml_source import Source
from hgorun.errors import KeyPath

_COLUMNS = ("outputs", "inputs", "reference")


def with_numbers(path: Path, numbers: Mapping[str, float], target: Path, *, run: str | None = None) -> str:
    """The text of a configuration with numbers in place of its own.

    Where all of them stand in the file, its text is kept but for them, and for the names of the files that it extends
    and that hold its data, which are written as seen from the target. Otherwise the text is a file that extends it.

    Parameters
    ----------
    path : Path
        The configuration.
    numbers : mapping of str to float
        By path, as after ``--set``.
    target : Path
        Where the text will stand.
    run : str, optional
        Whose numbers they are, where the file has several runs.
    """
    text, source = read_source(path)
    beside = Path(os.path.relpath(path.parent.resolve(), target.parent.resolve()))
    scalars = _scalars(yaml.compose(text, Loader=yaml.SafeLoader))
    edits: list[tuple[yaml.ScalarNode, str]] = []
    moved = {place: str(beside / name) for place, name in _files(source)} if beside != Path() else {}
    if any(place not in scalars for place in moved):
        return _on_top(beside / path.name, numbers, source, run, moved)
    for name, value in numbers.items():
        node = next((scalars[place] for place in _places(source, name, value, run) if place in scalars), None)
        if node is None:
            return _on_top(beside / path.name, numbers, source, run, moved)
        edits.append((node, f"{value:.6g}"))
    extended = scalars.get(("extends",))
    if extended is not None:
        edits.append((extended, _quoted(str(beside / str(extended.value)))))
    edits += [(scalars[place], _quoted(name)) for place, name in moved.items()]
    for node, new in sorted(edits, key=lambda edit: -edit[0].start_mark.index):
        text = text[: node.start_mark.index] + new + text[node.end_mark.index :]
    return text


def _places(source: Source, name: str, value: float, run: str | None) -> list[KeyPath]:
    """Where a number may stand: in the run, else in what all runs share."""
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
    base: Path, numbers: Mapping[str, float], source: Source, run: str | None, files: Mapping[KeyPath, str]
) -> str:
    """A file that extends another one and has the numbers, and the names of files, of its own."""
    data: dict[str, Any] = {"extends": str(base)}
    for name, value in numbers.items():
        place = replaced(source, name, value)[1]
        holder = data
        for key in (("runs", run, *place) if run is not None else place)[:-1]:
            holder = holder.setdefault(str(key), {})
        holder[str(place[-1])] = float(f"{value:.6g}")
    for place, file in files.items():
        *above, last = map(str, place if not isinstance(place[-1], int) else place[:-1])
        holder = data
        for key in above:
            holder = holder.setdefault(key, {})
        if isinstance(place[-1], int):  # a list is replaced as a whole
            holder.setdefault(last, []).append(file)
        else:
            holder[last] = file
    return str(yaml.safe_dump(data, sort_keys=False, allow_unicode=True))


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


def _quoted(name: str) -> str:
    return "'" + name.replace("'", "''") + "'"
