"""One configuration on top of another: the assignments of ``--set``, and a file on the one it extends."""

from __future__ import annotations

import re
from typing import Any

from hgorun.config.expressions import nearest
from hgorun.config.misdirected import ALL_OBSERVERS, beside, no_way, nothing_there, refuse_lost
from hgorun.config.nearest import listed
from hgorun.config.paths import at, entries, walk
from hgorun.config.shell import assigned, assigned_text
from hgorun.config.yaml_builder import MAX_DEPTH
from hgorun.config.yaml_source import Source, parse
from hgorun.errors import ConfigError, KeyPath

_KEY_END = re.compile("[.=[]")


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
    file = f"--set {assignment}"
    for one in written_out(source.data, assignment, file):
        source = _with_assignment(source, one, file)
    return source


def written_out(data: object, assignment: str, file: str | None = None) -> list[str]:
    """The assignments, or paths, that one stands for: several where it begins with ``observers.*``.

    Parameters
    ----------
    data : plain data
        Of a configuration.
    assignment : str
        A path, with or without what follows its end.
    file : str, optional
        What messages call the place; None where it is a path alone, which they then name.

    Raises
    ------
    ConfigError
        It begins so, and no observer's block has the key that follows.
    """
    blocks = data.get("observers") if isinstance(data, dict) else None
    if not assignment.startswith(ALL_OBSERVERS) or not isinstance(blocks, dict) or "*" in blocks:
        return [assignment]
    rest = assignment.removeprefix(ALL_OBSERVERS)
    key = _KEY_END.split(rest, maxsplit=1)[0]
    having = [label for label, block in blocks.items() if isinstance(block, dict) and key in block]
    if not having:
        known = dict.fromkeys(str(name) for block in blocks.values() for name, _ in entries(block))
        raise ConfigError(
            f"no observer's block has the key {key!r}.{nearest(key, known)} Known here: {listed(known, key)}",
            file=file,
            line=None if file is None else 1,
            key=assignment if file is None else None,
        )
    return [f"observers.{label}.{rest}" for label in having]


def places_set(data: object, assignment: str) -> list[tuple[KeyPath, str]]:
    """Where :func:`set_path` would write which text: several places where it begins with ``observers.*``.

    Raises
    ------
    ConfigError
        It begins so, and no observer's block has the key that follows.
    """
    parted = (_parted(data, one) for one in written_out(data, assignment, f"--set {assignment}"))
    return [((*old, *new), text) for old, new, _, text in parted]


def _parted(data: object, assignment: str) -> tuple[KeyPath, list[str], str, str]:
    """The part of a path that is there, the names that follow it, the sign of equality, and what is behind it."""
    old, end = _longest_path(data, assignment)
    names, equals, text = assignment[end:].partition("=")
    return old, names[1 if old else 0 :].split(".") if names else [], equals, text


def _with_assignment(source: Source, assignment: str, file: str) -> Source:
    old, new, equals, text = _parted(source.data, assignment)
    if not equals or not (old or new) or any(not name or name != name.strip() for name in new):
        raise ConfigError("expected path=value, without spaces around `=`", file=file, line=1)
    above = at(source.data, old)
    if new and above is not None and not isinstance(above, dict):
        raise ConfigError(no_way(source.data, old, new[0], text), file=file, line=1)
    refuse_lost(source.data, old, new, file)
    path = (*old, *new)
    if not text.strip():
        removed = "" if new else f"; `{assigned(path, 'null')}` removes it"
        raise ConfigError(f"there is no value behind `=`: write {assigned(path, 'value')}{removed}", file=file, line=1)
    value = _value(text, path, file)
    if value is None:
        if new:
            raise ConfigError(nothing_there(source.data, old, new[0]), file=file, line=1)
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
    refuse_lost(source.data, old, new)
    if value is None and new:
        return source, (*old, *new)
    file, line = source.where(old)
    if new and above is not None and not isinstance(above, dict):
        raise ConfigError(no_way(source.data, old, new[0], str(value)), file=file, line=line, key=path)
    place: KeyPath = (*old, *new)
    if index := next((i for i in range(1, len(new)) if new[i].isdigit()), None):
        lacking = ".".join(map(str, (*old, *new[:index])))
        message = f"there is no list `{lacking}`: set the whole list; {beside(source.data, old, new[0])}"
        raise ConfigError(message, file=file, line=line, key=path)
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
