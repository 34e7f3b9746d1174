"""Numbers of an observer's block with which its gains overflow, or what follows from its initial estimate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.errors import Problem
from hgorun.observers.base import AnyObserver

_FAR = 15.0  # orders of magnitude: powers of such a number may overflow
_STARTS = {"initial", "internal"}  # keys of what the observer starts with
_MODERATE = 1e10  # whose powers up to 30 do not


def overflow(label: str, observer: AnyObserver, *, gains: bool = False) -> Problem | None:
    """What is said where a number is not finite; None if no number of the block is large or small enough.

    Parameters
    ----------
    gains : bool
        Whether it is a gain, on which the initial estimate has no influence.
    """
    keys = observer.model_fields_set - (_STARTS if gains else set())
    given = [(key, number) for key in keys for number in _numbers(getattr(observer, key))]
    far = [(abs(float(np.log10(abs(number)))), key, number) for key, number in given if number]
    size, key, number = max(far, default=(0.0, "", 0.0))
    if size < _FAR:
        return None
    kind = "large" if abs(number) > 1 else "small"
    path = ("observers", label, key)
    if key in _STARTS:
        return Problem(path, f"{number:g} is too {kind}: the equations overflow there")
    return Problem(path, f"{number:g} is too {kind}: gains that follow from it overflow")


def moderate(parameters: np.ndarray) -> np.ndarray:
    """Parameters whose powers do not overflow: what is singular with them is not so because of their size."""
    size = np.clip(np.abs(np.nan_to_num(parameters, nan=_MODERATE, posinf=_MODERATE)), 1 / _MODERATE, _MODERATE)
    return np.asarray(np.where(parameters == 0, 0.0, np.copysign(size, parameters)))


def _numbers(value: object) -> Iterator[float]:
    """Those in a key's value."""
    if isinstance(value, dict):
        value = tuple(value.values())
    if isinstance(value, (tuple, list)):
        for part in value:
            yield from _numbers(part)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield float(value)
