"""What a knob sets in a file: a number, a multiple of what stands there, or one of the numbers in an expression."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

Plain = bool | int | float | str | list[Any] | None

NONE: Mapping[str, Plain] = MappingProxyType({})
_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])")


@dataclass(frozen=True)
class Target:
    """What a knob sets in the file: ``offset + value * slope``, that many times an expression, or poles.

    With a ``place`` it is one number of the expression, counted as :func:`numbers_in` does.
    """

    path: str
    slope: float = 1.0
    offset: float = 0.0
    expression: str | None = None
    poles: tuple[complex, ...] = ()
    place: int | None = None

    def value(self, value: float, written: Plain = None) -> Plain:
        """What is written at the path, where another knob has written something already or not."""
        if self.expression is not None and self.place is not None:
            return with_number(self.expression if written is None else str(written), self.place, value)
        if self.expression is not None:
            return f"{value!r}*({self.expression})"
        if self.poles:
            return [str(value * pole).strip("()") for pole in self.poles]
        return self.offset + value * self.slope


def numbers_in(text: str) -> list[str]:
    """The numbers that are written in an expression, in their order."""
    return _NUMBER.findall(text)


def with_number(text: str, place: int, value: float) -> str:
    """The expression with another number at a place among those of :func:`numbers_in`."""
    start, end = list(_NUMBER.finditer(text))[place].span()
    written = repr(value) if value >= 0 else f"({value!r})"
    return f"{text[:start]}{written}{text[end:]}"
