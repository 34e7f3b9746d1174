"""Which keys of a block its own methods read.

What is compiled from a block holds for every block that has the same values there; the others are numbers of a
run, or are not used.
"""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Hashable
from functools import cache
from typing import Any, Generic, TypeVar, cast

from hgorun.config.types import Block

B = TypeVar("B", bound=Block)


class Reads(Generic[B]):
    """A block watched while its methods are called.

    Attributes
    ----------
    keys : set of str
        The keys read so far.
    watched : Block
        A copy of the block, to call the methods of: an instance of the block's class like any other.
    """

    def __init__(self, block: B) -> None:
        self._block = block
        self.keys: set[str] = set()
        self.watched: B = _watched(block, self.keys)

    def hold_for(self, block: Block) -> bool:
        """Whether another block has the same values at all keys read."""
        mine = self._block
        return type(block) is type(mine) and (
            block is mine or all(getattr(block, key) == getattr(mine, key) for key in self.keys)
        )


def frozen(value: object) -> Hashable:
    """Values of a configuration as a key."""
    if isinstance(value, dict):
        return tuple((key, frozen(part)) for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(frozen(part) for part in value)
    return value  # a scalar


_FIELDS_SET = "__pydantic_fields_set__"
_WHOLE = {"__dict__", "__pydantic_private__"}  # what model_dump, repr, vars and a loop over the block look at


def _watched(block: B, keys: set[str]) -> B:
    """A copy of a block that adds to ``keys`` what is asked of it."""
    copied = cast(B, object.__new__(_watched_class(type(block))))
    values = {"_keys_read": keys, "__dict__": dict(block.__dict__)} | {
        name: getattr(block, name) for name in (_FIELDS_SET, "__pydantic_extra__", "__pydantic_private__")
    }
    for name, value in values.items():
        object.__setattr__(copied, name, value)
    return copied


@cache
def _watched_class(cls: type[Block]) -> type[Block]:
    """A subclass whose instances note which keys are read; it takes everything else from the class.

    It is made as a class of Python, not of pydantic, which would compile its validation anew.
    """
    fields = cls.model_fields.keys()

    def __getattribute__(self: Block, name: str) -> Any:
        read = object.__getattribute__
        if name == "__class__":
            return cls
        try:
            keys = read(self, "_keys_read")
        except AttributeError:  # a copy of the copy: whoever made it has read everything
            return read(self, name)
        if name in fields or name == _FIELDS_SET:
            keys.add(name)
        elif name in _WHOLE or name in read(self, "__dict__"):  # what was kept there may follow from any key
            keys.update(fields)
        return read(self, name)

    own = {
        "__slots__": ("_keys_read",),
        "__module__": cls.__module__,
        "__qualname__": cls.__qualname__,
        "__getattribute__": __getattribute__,
    }
    return ABCMeta.__new__(type(cls), cls.__name__, (cls,), own)
