"""One configuration on top of another: the assignments of ``--set``, and a file on the one it extends."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from hgorun.config.expressions import nearest
from hgorun.config.models import File
from hgorun.config.paths import at, dotted, entries, walk
from hgorun.config.shell import assigned, assigned_text
from hgorun.config.yaml_builder import MAX_DEPTH
from hgorun.config.yaml_source import Source, parse
from hgorun.errors import ConfigError, KeyPath

_ALL = "observers.*."  # how a path begins that means every observer
_KEY_END = re.compile("[.=]")
_MOST = 6  # paths in a message


def set_path(source: Source, assignment: str) -> Source:
    """Carry out ``assignment``, the ``path=value`` of ``--set``.

    A path is keys and list indices with dots between. The longest path that exists wins, so a label may
    contain ``=``; what follows it, up to the next ``=``, is created. ``observers.*`` means every observer whose block
    has the key that follows. The value is YAML; ``null`` removes the key.

    Raises
    ------
    ConfigError
        There is no ``=``, the value is not YAML, the path leads into a scalar or past the end of a list, or what is to
        be removed is not there.
    """
    for one in _written_out(source.data, assignment):
        source = _with_assignment(source, one, f"--set {assignment}")
    return source


def _written_out(data: object, assignment: str) -> list[str]:
    """The assignments that one stands for: several where it begins with ``observers.*``."""
    blocks = data.get("observers") if isinstance(data, dict) else None
    if not assignment.startswith(_ALL) or not isinstance(blocks, dict) or "*" in blocks:
        return [assignment]
    rest = assignment.removeprefix(_ALL)
    key = _KEY_END.split(rest, maxsplit=1)[0]
    having = [label for label, block in blocks.items() if isinstance(block, dict) and key in block]
    if not having:
        known = dict.fromkeys(str(name) for block in blocks.values() for name, _ in entries(block))
        raise ConfigError(
            f"no observer's block has the key {key!r}.{nearest(key, known)} Known here: {', '.join(known)}",
            file=f"--set {assignment}",
            line=1,
        )
    return [f"observers.{label}.{rest}" for label in having]


def _with_assignment(source: Source, assignment: str, file: str) -> Source:
    old, end = _longest_path(source.data, assignment)
    names, equals, text = assignment[end:].partition("=")
    new = names[1 if old else 0 :].split(".") if names else []
    if not equals or not (old or new) or any(not name or name != name.strip() for name in new):
        raise ConfigError("expected path=value, without spaces around `=`", file=file, line=1)
    above = at(source.data, old)
    if new and above is not None and not isinstance(above, dict):
        raise ConfigError(_no_way(source.data, old, new[0], text), file=file, line=1)
    if not old and new[0] not in File.model_fields:
        _refuse_part_of_a_path(source.data, tuple(new), file)
    path = (*old, *new)
    if not text.strip():
        removed = "" if new else f"; `{assigned(path, 'null')}` removes it"
        raise ConfigError(f"there is no value behind `=`: write {assigned(path, 'value')}{removed}", file=file, line=1)
    value = _value(text, path, file)
    if value is None:
        if new:
            raise ConfigError(_nothing_there(source.data, old, new[0]), file=file, line=1)
        return _without(source, path, file)
    data = _replaced(source.data, path, value)
    places = {p: (file, 1) if p[: len(path)] == path else source.where(p) for p, _ in walk(data)}
    created = {path[:length]: (file, 1) for length in range(len(old) + 1, len(path))}
    if max(map(len, places)) > MAX_DEPTH:
        raise ConfigError(f"lists and mappings nested more than {MAX_DEPTH} deep", file=file, line=1)
    return Source(data, places | created, source.nulls)


def _value(text: str, path: KeyPath, file: str) -> Any:
    """What the text behind ``=`` says.

    Raises
    ------
    ConfigError
        It is not YAML. As a shell takes quotes away, the whole option is told that has those which YAML needs.
    """
    text = text.strip()
    try:
        if text.startswith("#"):
            raise ConfigError("text that starts with `#` needs quotes: it is a comment", file=file, line=1)
        return parse(text, file).data
    except ConfigError as error:
        right = f"as text: `{assigned_text(path, text)}`"
        if text.startswith(("{", "[", '"', "'")):
            right = "a shell takes quotes away, so the whole stands in single ones, as in `--set 'title=\"a: b\"'`"
        raise ConfigError(f"{error.message}; {right}", file=file, line=1, key=error.key) from error


def _without(source: Source, path: KeyPath, file: str) -> Source:
    """The configuration without what is at a path."""
    data, last = _removed(source.data, path), len(path) - 1

    def before(now: KeyPath) -> KeyPath:
        """Where something was: what follows in a list has moved."""
        removed, place = path[last], now[last] if len(now) > last and now[:last] == path[:last] else None
        if isinstance(removed, int) and isinstance(place, int) and place >= removed:
            return (*now[:last], place + 1, *now[last + 1 :])
        return now

    return Source(data, {now: source.where(before(now)) for now, _ in walk(data)}, source.nulls)


def _nothing_there(data: Any, old: KeyPath, name: str) -> str:
    """What is said where there is nothing to remove."""
    beside = [str(key) for key, _ in entries(at(data, old))]
    known = f" Known here: {', '.join(beside[:20])}" if beside else ""
    return f"there is no {name!r} to remove.{nearest(name, beside)}{known}"


def _refuse_part_of_a_path(data: Any, names: tuple[str, ...], file: str) -> None:
    """Where only the last keys of a path are given, or what they begin with is inside another block, name the path.

    Raises
    ------
    ConfigError
    """
    known = sorted((tuple(map(str, path)) for path, _ in walk(data)), key=".".join)
    for length in range(len(names), 0, -1):  # what follows a known part is to be created
        part, more = names[:length], names[length:]
        whole = [path for path in known if len(path) > length and path[-length:] == part]
        if whole:
            meant = _one_of([".".join((*path, *more)) for path in whole])
            of_all = sum(path[0] == "observers" and path[2:] == part for path in whole) > 1
            several = f" {_ALL}{'.'.join(names)} is that of all observers which have it." if of_all else ""
            message = f"{names[0]!r} is not a key of the top of the file. Did you mean {meant}?{several}"
            raise ConfigError(message, file=file, line=1, key=".".join(names))


def _one_of(paths: Sequence[str]) -> str:
    """Some paths, as they are listed in a question."""
    shown = [f"`{path}`" for path in paths[:_MOST]]
    if len(paths) > _MOST:
        return f"{', '.join(shown)} or another of {len(paths)}"
    return " or ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))


def replaced(source: Source, path: str, value: Any) -> tuple[Source, KeyPath]:
    """The configuration with another value at a path, and that path.

    What is new keeps the position of what it replaces, or of the nearest thing around.

    Parameters
    ----------
    path : str
        As in ``--set``.
    value : plain data or None
        None removes the key; where there is none, nothing happens.

    Raises
    ------
    ConfigError
        The path leads into a scalar, past the end of a list, or into a list that is not there.
    """
    old, end = _longest_path(source.data, f"{path}=")
    names = path[end:]
    new = names[1 if old else 0 :].split(".") if names else []
    above = at(source.data, old)
    if any(not name for name in new) or not (old or new):
        raise ConfigError(f"expected keys separated by dots, found {path!r}", key=path)
    if value is None and new:
        return source, (*old, *new)
    file, line = source.where(old)
    if new and above is not None and not isinstance(above, dict):
        raise ConfigError(_no_way(source.data, old, new[0], str(value)), file=file, line=line, key=path)
    place: KeyPath = (*old, *new)
    if index := next((i for i in range(1, len(new)) if new[i].isdigit()), None):
        lacking = ".".join(map(str, (*old, *new[:index])))
        raise ConfigError(f"there is no list `{lacking}`: set the whole list", file=file, line=line, key=path)
    data = _removed(source.data, place) if value is None else _replaced(source.data, place, value)
    positions, has_parts = source.positions, not new and isinstance(above, (dict, list))
    if has_parts:  # which are gone
        positions = {p: where for p, where in positions.items() if p[: len(place)] != place or p == place}
    if value is not None and (new or has_parts or isinstance(value, (dict, list))):
        created = [place[:length] for length in range(len(old) + 1, len(place))]
        created += [(*place, *below) for below, _ in walk(value)]
        positions = positions | dict.fromkeys(created, (file, line))
    return Source(data, positions, source.nulls), place


def _removed(data: Any, path: KeyPath) -> Any:
    """Copy ``data`` along ``path``, without what is at its end."""
    holder = at(data, path[:-1])
    left = (
        {key: part for key, part in holder.items() if key != path[-1]}
        if isinstance(holder, dict)
        else [part for i, part in enumerate(holder) if i != path[-1]]
    )
    return _replaced(data, path[:-1], left) if len(path) > 1 else left


def _longest_path(data: object, assignment: str) -> tuple[KeyPath, int]:
    """Find the longest path in ``data`` that ``assignment`` starts with, and where it ends there."""
    best: tuple[KeyPath, int] = ((), 0)
    todo: list[tuple[KeyPath, Any, int]] = [((), data, 0)]
    while todo:
        path, value, start = todo.pop()
        for key, part in entries(value):
            end = start + len(str(key))
            follows = assignment[end : end + 1]
            if follows in (".", "=") and assignment.startswith(str(key), start):
                best = max(best, ((*path, key), end), key=lambda found: found[1])
                if follows == ".":
                    todo.append(((*path, key), part, end + 1))
    return best


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


def _no_way(data: object, path: KeyPath, name: str, text: str) -> str:
    """Why a path does not lead on to a name below it; the text is what would be set there."""
    here, value = dotted(path) or "the file", at(data, path)
    if isinstance(value, list):
        indices = f"an index from 0 to {len(value) - 1}" if value else "nothing, as it is empty"
        inside = next((i for i, part in enumerate(value) if isinstance(part, dict) and name in part), None)
        meant = "" if inside is None else f". Did you mean `{here}.{inside}.{name}`?"
        return f"`{here}` is a list of {len(value)}: `{name}` was found where there can be {indices}{meant}"
    beside = [str(key) for key, _ in entries(at(data, path[:-1]))]
    names = f" Beside it: {', '.join(beside[:20])}." if beside else ""
    if isinstance(value, str) and path[:1] == ("data",) and name in _OF_COLUMNS:
        column = json.dumps(value[:40], ensure_ascii=False)
        given = text if text[:1] in ("{", "[", '"', "'") else json.dumps(text[:40], ensure_ascii=False)
        more = assigned(path, f"{{column: {column}, {name}: {given}}}")
        names = f" It is the name of a column: `{more}` says more of it."
    return f"`{here}` is {str(value)[:40]!r} and has no `{name}` in it.{nearest(name, beside)}{names}"


def _replaced(data: Any, path: KeyPath, value: Any) -> Any:
    """Copy ``data`` along ``path``, with ``value`` at its end; mappings that are missing are created."""
    result = [data]
    holder: Any = result
    last: str | int = 0
    for key in path:
        part = holder.get(last) if isinstance(holder, dict) else holder[last]
        part = list(part) if isinstance(part, list) else dict(part or {})
        holder[last] = part
        holder, last = part, key
    holder[last] = value
    return result[0]


def merge(base: Source, over: Source) -> Source:
    """Lay ``over`` on ``base``: mappings are merged, everything else is replaced.

    A mapping whose ``type`` differs from that of the one below replaces it whole. A key of ``base`` that ``over`` says
    to be null is removed; its place is kept, for what is said where it cannot be missing.
    """
    data = _merged(base.data, over.data, over.nulls, ())
    places = base.positions | over.positions
    shown = dict.fromkeys([*(path for path, _ in walk(data)), *over.nulls])
    return Source(data, {path: places[path] for path in shown if path in places}, base.nulls | over.nulls)


def _merged(base: object, over: Any, nulls: frozenset[KeyPath], path: KeyPath) -> Any:  # no deeper than MAX_DEPTH
    if not (isinstance(base, dict) and isinstance(over, dict)):
        return over
    if "type" in base and over.get("type", base["type"]) != base["type"]:
        return over
    whole = dict(base)
    for key, part in over.items():
        here = (*path, key)
        if here in nulls and base.get(key) is not None:
            del whole[key]
        else:
            whole[key] = _merged(base[key], part, nulls, here) if key in base else part
    return whole
