"""What is given to an estimator: numbers, numbers by name, observers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from hgorun.config.nearest import listed, nearest
from hgorun.config.types import describe
from hgorun.errors import ConfigError


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
    if not isinstance(values, dict | Mapping):
        raise TypeError(_not_by_name(name, values))
    return [
        (one, value if type(value) is float else as_number(f"{name}[{one!r}]", value)) for one, value in values.items()
    ]


def _not_by_name(name: str, values: Any) -> str:
    return f"{name}: expected numbers by name, as {{'a': 0.5}}, found {values!r:.50}"


def require_names(name: str, values: Any) -> None:
    """Refuse what has no names.

    Raises
    ------
    ConfigError
    """
    if not isinstance(values, Mapping):
        raise ConfigError(_not_by_name(name, values))


def require_outputs(name: str, values: Mapping[str, float], outputs: Iterable[str]) -> None:
    """Refuse numbers of what is no output.

    Raises
    ------
    ConfigError
    """
    known = tuple(outputs)
    for one in values:
        if one not in known:
            near = nearest(str(one), known)
            raise ConfigError(f"{name}: no output is called {one!r:.50}.{near} Known: {listed(known, str(one))}")


def names_in(name: str, values: object) -> tuple[str, ...]:
    """Names in a list; neither a text, which is a sequence of letters, nor a mapping, whose values would be lost.

    Raises
    ------
    ConfigError
    """
    if isinstance(values, str | Mapping) or not isinstance(values, Iterable):
        names = [values] if isinstance(values, str) else list(values)[:1] if isinstance(values, Mapping) else ["u"]
        raise ConfigError(f"{name}: expected a list of names, such as {names}, found {describe(values)}")
    found = tuple(values)
    for one in found:
        if not isinstance(one, str):
            raise ConfigError(f"{name}: expected a list of names, found {describe(one)} in it")
    return found


def positive_by_name(name: str, values: Any) -> dict[str, float]:
    """Numbers greater than 0 by their names.

    Raises
    ------
    ConfigError
    """
    require_names(name, values)
    try:
        found = dict(numbers_by_name(name, values))
    except TypeError as error:
        raise ConfigError(str(error)) from None
    for one, number in found.items():
        if not 0 < number < math.inf:
            raise ConfigError(f"{name}[{one!r}]: expected a number greater than 0, found {number:g}")
    return found
