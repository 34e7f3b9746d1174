"""Logs whose rows are of several signals, each with the name of its own: tag, time, value."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

Tags: TypeAlias = Callable[[], Mapping[str, str]]
"""Gives the columns that may name the signal of each row, with the first of their names."""
_MOST = 50  # different names
_EACH = 3.0  # rows of each of them, at the least


def are_tags(words: Sequence[str]) -> bool:
    """Whether the cells of a column are names, of which each stands in several rows."""
    texts = [word.strip() for word in words]
    different = set(texts)
    named = all(text[:1].isalpha() for text in different)
    return named and 1 < len(different) <= min(_MOST, len(texts) / _EACH)


def of_several(tags: Mapping[str, str], otherwise: str) -> str:
    """What to write where stamps stand again since rows are of several signals, if they may be; and otherwise."""
    for column, name in tags.items():
        right = f"quality: {{column: {json.dumps(column)}, good: [{json.dumps(name)}]}}"
        return f"rows may be of several signals, which {column!r} names: {right} takes those of one; {otherwise}"
    return otherwise
