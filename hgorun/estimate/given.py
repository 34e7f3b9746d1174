"""What is given to an estimator from Python: numbers, and numbers by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def as_number(name: str, value: Any) -> float:
    """A number, or a sentence that says what was expected.

    Raises
    ------
    TypeError
    """
    try:
        if not isinstance(value, str | bytes | bytearray):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"{name}: expected a number, found {value!r:.50}")


def numbers_by_name(name: str, values: Any) -> list[tuple[str, float]]:
    """Numbers with their names, of a mapping.

    Raises
    ------
    TypeError
    """
    if not isinstance(values, Mapping):
        raise TypeError(f"{name}: expected numbers by name, as {{'a': 0.5}}, found {values!r:.50}")
    return [(one, as_number(f"{name}[{one!r}]", value)) for one, value in values.items()]
