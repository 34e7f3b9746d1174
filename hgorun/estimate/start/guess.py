"""The state of a plant of which nothing is simulated: a guess, at which its equations have to be defined."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hgorun.config.types import number


def guessed(given: Mapping[str, Any], states: Iterable[str]) -> dict[str, Any]:
    """By state where the plant begins: its own ``initial``, then what observers begin with alike, otherwise 0.

    Parameters
    ----------
    given : mapping
        The configuration, which may be wrong in what is checked later.
    states : iterable of str
    """
    observers = given.get("observers")
    blocks = observers.values() if isinstance(observers, dict) else ()
    starts = [block.get("initial") for block in blocks if isinstance(block, dict)]
    named = [start for start in starts if isinstance(start, dict)]
    alike = {state: _one_number([start[state] for start in named if state in start]) for state in states}
    return {**alike, **(given["plant"].get("initial") or {})}


def _one_number(values: list[Any]) -> float:
    """The one number that all of some values are; 0 where there is none."""
    try:
        numbers = {number(value) for value in values}
    except ValueError:  # which is said where the observer is checked
        return 0.0
    return numbers.pop() if len(numbers) == 1 else 0.0
