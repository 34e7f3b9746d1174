"""What differs between two configurations, and where."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hgorun.errors import KeyPath


def different(before: Any, after: Any, place: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """What has another value, is new or is gone, and where: as deep as it can be said.

    A mapping with another ``type`` is whole, since it replaces the one before where it is laid on top of it, see
    :func:`hgorun.config.overrides.merge`.

    Parameters
    ----------
    before, after : plain data
    place : tuple of str and int, optional
        Where they stand.

    Yields
    ------
    (place, value)
        None of what is gone, as in a file that extends another one.
    """
    if before == after and type(before) is type(after):
        return
    if isinstance(before, dict) and isinstance(after, dict) and _are_merged(before, after):
        for key in before:
            if key not in after:
                yield (*place, key), None
        for key, part in after.items():
            if key in before:
                yield from different(before[key], part, (*place, key))
            else:
                yield (*place, key), part
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for i, (one, other) in enumerate(zip(before, after, strict=True)):
            yield from different(one, other, (*place, i))
    else:
        yield place, after


def _are_merged(before: dict[str, Any], after: dict[str, Any]) -> bool:
    return "type" not in before or after.get("type", before["type"]) == before["type"]
