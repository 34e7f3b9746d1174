"""Paths that lead nowhere: where they may be meant to lead."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from hgorun.config.belonging import belongs
from hgorun.config.models import File
from hgorun.config.nearest import listed, nearest, nearest_name
from hgorun.config.paths import at, dotted, entries, walk
from hgorun.config.shell import assigned
from hgorun.errors import ConfigError, KeyPath

ALL_OBSERVERS = "observers.*."
"""How a path begins that means every observer."""
_SOUGHT = ("tune", "gains")  # whose keys are paths
_MOST = 6  # paths in a message
# A key or an index, as in Python; behind a dot or a space a bracket belongs to a name.
_IN_BRACKETS = re.compile(r"(?<=[^.\s])\[\s*([^][]*?)\s*\]")
_QUOTED_IN_BRACKETS = re.compile(r"\[\s*(['\"])(.*?)\1\s*\]")
_QUOTED = re.compile(r"(^|\.)(['\"])(.*?)\2(?=\.|$)")


def refuse_lost(data: Any, old: KeyPath, new: Sequence[str], file: str | None = None) -> None:
    """Where a path has an index in brackets, or only the last keys of one are given, name the path.

    Parameters
    ----------
    data : plain data
    old : tuple
        The part of the path that is there.
    new : sequence of str
        What follows it.
    file : str, optional
        What messages call the place.

    Raises
    ------
    ConfigError
    """
    if not new:
        return
    names = tuple(_between_dots(at(data, old), ".".join(new)).split("."))
    line = None if file is None else 1
    if not old and names[0] not in File.model_fields:
        _refuse_part_of_a_path(data, names, ".".join(new), file, line)
    if names != tuple(new):
        right = dotted((*old, *names))
        raise ConfigError(
            f"keys and indices stand between dots, not in brackets or quotes. Did you mean `{right}`?",
            file=file,
            line=line,
            key=dotted((*old, *new)),
        )


def _between_dots(block: object, text: str) -> str:
    """A path into a block without quotes and brackets around keys and indices; names that are there keep their own."""
    plain = _QUOTED.sub(r"\1\3", _QUOTED_IN_BRACKETS.sub(r".\2", text)).removeprefix(".")
    rest = plain
    while rest:
        there = {str(key): part for key, part in entries(block) if f"{rest}.".startswith(f"{key}.")}
        if not there:
            break
        name = max(there, key=len)
        block, rest = there[name], rest[len(name) + 1 :]
    return plain[: len(plain) - len(rest)] + _IN_BRACKETS.sub(r".\1", rest)


def _refuse_part_of_a_path(data: Any, names: KeyPath, written: str, file: str | None, line: int | None) -> None:
    """Where only the last keys of a path are given, or what they begin with is inside another block, name the path."""
    known = sorted((tuple(map(str, path)) for path, _ in walk(data) if path[:2] != _SOUGHT), key=".".join)
    lower = tuple(str(name).lower() for name in names)
    for length in range(len(names), 0, -1):  # what follows a known part is to be created
        part, more = lower[:length], tuple(map(str, names[length:]))
        whole = [path for path in known if len(path) > length and tuple(map(str.lower, path[-length:])) == part]
        if whole:
            meant = _one_of([".".join((*path, *more)) for path in whole])
            of_all = sum(path[0] == "observers" and len(path) == length + 2 for path in whole) > 1
            every = f"{ALL_OBSERVERS}{'.'.join(map(str, names))} is that of all observers which have it."
            message = f"{names[0]!r} is not a key of the top of the file. Did you mean {meant}?"
            raise ConfigError(f"{message} {every}" if of_all else message, file=file, line=line, key=written)


def _one_of(paths: Sequence[str]) -> str:
    """Some paths, as they are listed in a question."""
    shown = [f"`{path}`" for path in paths[:_MOST]]
    if len(paths) > _MOST:
        return f"{', '.join(shown)} or another of {len(paths)}"
    return " or ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))


def beside(data: Any, old: KeyPath, name: str) -> str:
    """What is written in the deepest block of a path that is there, and what of it may be meant."""
    names = [str(key) for key, _ in entries(at(data, old))]
    near = nearest_name(name, names)
    meant = f" Did you mean `{dotted((*old, near))}`?" if near else belongs(old, name, recorded="data" in data)
    where = f"`{dotted(old)}`" if old else "the file"
    return f"{where} has {listed(names, name) if names else 'nothing'}{meant and '.' + meant}"


def nothing_there(data: Any, old: KeyPath, name: str) -> str:
    """What is said where there is nothing to remove."""
    beside = [str(key) for key, _ in entries(at(data, old))]
    known = f" Known here: {listed(beside, name)}" if beside else ""
    return f"there is no {name!r} to remove.{nearest(name, beside)}{known}"


_OF_COLUMNS = {
    "unit",
    "format",
    "next_day",
    "file",
    "time",
    "csv",
    "faults",
    "plausible",
    "quality",
    "available",
    "gate",
    "std",
}


def no_way(data: object, path: KeyPath, name: str, text: str) -> str:
    """Why a path does not lead on to a name below it; the text is what would be set there."""
    here, value = dotted(path) or "the file", at(data, path)
    if isinstance(value, list):
        indices = f"an index from 0 to {len(value) - 1}" if value else "nothing, as it is empty"
        inside = next((i for i, part in enumerate(value) if isinstance(part, dict) and name in part), None)
        meant = "" if inside is None else f". Did you mean `{here}.{inside}.{name}`?"
        return f"`{here}` is a list of {len(value)}: `{name}` was found where there can be {indices}{meant}"
    beside = [str(key) for key, _ in entries(at(data, path[:-1]))]
    names = f" Beside it: {listed(beside, name)}." if beside else ""
    if isinstance(value, str) and path[:1] == ("data",) and name in _OF_COLUMNS:
        column = json.dumps(value[:40], ensure_ascii=False)
        given = text if text[:1] in ("{", "[", '"', "'") else json.dumps(text[:40], ensure_ascii=False)
        more = assigned(path, f"{{column: {column}, {name}: {given}}}")
        names = f" It is the name of a column: `{more}` says more of it."
    return f"`{here}` is {str(value)[:40]!r} and has no `{name}` in it.{nearest(name, beside)}{names}"
