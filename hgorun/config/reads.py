"""Which keys of a block its own methods read.

What is compiled from a block holds for every block that has the same values there; the others are numbers of a
run, or are not used.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from types import FunctionType, MethodType
from typing import Any, cast

from hgorun.config.types import Block


class Reads:
    """A block watched while its methods are called.

    Attributes
    ----------
    keys : set of str
        The keys read so far.
    """

    def __init__(self, block: Block) -> None:
        self._block = block
        self.keys: set[str] = set()
        self.watched: Any = cast(Any, _Watched)(block, self.keys)

    def hold_for(self, block: Block) -> bool:
        """Whether another block has the same values at all keys read."""
        mine = self._block
        return type(block) is type(mine) and (
            block is mine or all(getattr(block, key) == getattr(mine, key) for key in self.keys)
        )


def frozen(value: Any) -> Hashable:
    """Values of a configuration as a key."""
    if isinstance(value, dict):
        return tuple((key, frozen(part)) for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(frozen(part) for part in value)
    return cast(Hashable, value)


class _Watched:
    """Looks like the block, down to ``isinstance`` and ``super()``, and notes which keys are asked for."""

    def __init__(self, block: Block, keys: set[str]) -> None:
        object.__setattr__(self, "_watched", (block, keys))

    @property  # type: ignore[misc]  # super() and isinstance look here
    def __class__(self) -> type:
        return type(self._watched[0])

    def __getattr__(self, name: str) -> Any:
        block, keys = self._watched
        cls = type(block)
        if name in cls.model_fields:
            keys.add(name)
            return getattr(block, name)
        found = next((vars(base)[name] for base in cls.__mro__ if name in vars(base)), None)
        if isinstance(found, FunctionType):
            return MethodType(found, self)
        if isinstance(found, property):
            return cast(Callable[[Any], Any], found.fget)(self)
        if found is None or (hasattr(found, "__get__") and not isinstance(found, (staticmethod, classmethod, type))):
            keys.update(cls.model_fields)  # something else than methods and properties: it may read anything
        return getattr(block, name)
