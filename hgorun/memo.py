"""A bounded memory of what takes long to make."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import RLock
from types import MethodType
from typing import Generic, TypeVar

_T = TypeVar("_T")


class Memo(Generic[_T]):
    """The most recently used values, by keys that say all that they depend on.

    Keys may hold objects that are equal only to themselves: they are kept alive as long as their values.

    Parameters
    ----------
    size : int
        How many values are kept.
    fits : callable, optional
        Whether a value is small enough to be kept.
    """

    def __init__(self, size: int, fits: Callable[[_T], bool] = lambda _: True) -> None:
        self._size, self._fits = size, fits
        self._values: OrderedDict[Hashable, _T] = OrderedDict()
        self._lock = RLock()

    def get(self, key: Hashable, make: Callable[[], _T]) -> _T:
        """The value of a key, made where it is not known; what raises is not kept."""
        with self._lock:
            try:
                self._values.move_to_end(key)
            except KeyError:
                pass
            else:
                return self._values[key]
            value = make()
            self.put(key, value)
            return value

    def put(self, key: Hashable, value: _T) -> None:
        """Keep a value, in place of the one that is known, if any."""
        with self._lock:
            if self._fits(value):
                self._values[key] = value
            while len(self._values) > self._size:
                self._values.popitem(last=False)

    def __contains__(self, key: Hashable) -> bool:
        with self._lock:
            return key in self._values

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._values.clear()


def same(thing: object) -> Hashable:
    """A thing as part of a key: equal to itself only, whatever its own class says.

    A bound method is hashed and compared by the identity of its object, without a call of Python's.
    """
    return MethodType(_nothing, thing)


def _nothing(thing: object) -> None:
    """What is bound; never called."""
