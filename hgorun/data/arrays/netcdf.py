"""The values that stored ones stand for in netCDF, by the attributes of the CF conventions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import compress
from typing import TypeAlias

import numpy as np

from hgorun.config.types import describe

Attributes: TypeAlias = Mapping[str, object]

_ABSENT = ("_FillValue", "missing_value")
_NEVER_WRITTEN = {"i2": -32767, "u2": 65535, "i4": -2147483647, "u4": 4294967295, "i8": -9223372036854775806,
                  "u8": 18446744073709551614, "f4": 9.969209968386869e36, "f8": 9.969209968386869e36}  # fmt: skip


def unpacked(stored: np.ndarray, attributes: Attributes, fill: object = None) -> np.ndarray:
    """The values that stored numbers stand for: NaN where one is missing or not valid, else scaled.

    Parameters
    ----------
    stored : ndarray
    attributes : mapping of str to object
        Of the data set: ``_FillValue``, ``missing_value``, ``valid_min``, ``valid_max``, ``valid_range``,
        ``scale_factor``, ``add_offset`` and ``_Unsigned``.
    fill : number, optional
        What stands where nothing was written; it means a missing value if it is that of the netCDF library.

    Raises
    ------
    ValueError
        With the attribute that is not what the conventions say.
    """
    stored = _signed(stored, attributes)
    scale, offset = _one(attributes, "scale_factor"), _one(attributes, "add_offset")
    if scale == 0:
        raise ValueError("the attribute scale_factor is 0")
    packed = scale is not None or offset is not None
    limits = list(_limits(attributes))
    # numbers with decimals beside whole ones that are scaled are limits of what these stand for
    scaled = [packed and stored.dtype.kind != "f" and limit.dtype.kind == "f" for _, limit in limits]
    gone = _absent(stored, attributes, fill) | _outside(stored, compress(limits, [not one for one in scaled]))
    values = stored
    if packed:
        values = stored.astype(float) * (1.0 if scale is None else scale) + (0.0 if offset is None else offset)
        gone |= _outside(values, compress(limits, scaled))
    if gone.any():
        values = values.astype(values.dtype if values.dtype.kind == "f" else float)
        values[gone] = np.nan
    return values


def absent_texts(attributes: Attributes) -> frozenset[str]:
    """Texts that stand for a missing value in a data set of texts."""
    values = (value for name in _ABSENT for value in _decoded(attributes.get(name)))
    return frozenset(value for value in values if isinstance(value, str))


def text(attributes: Attributes, name: str) -> str:
    """An attribute that is one text; empty where there is none."""
    values = _decoded(attributes.get(name))
    return values[0] if len(values) == 1 and isinstance(values[0], str) else ""


def _signed(stored: np.ndarray, attributes: Attributes) -> np.ndarray:
    """Whole numbers whose sign is told apart from their type, which netCDF-3 had no unsigned ones of."""
    told = text(attributes, "_Unsigned").lower()
    if stored.dtype.kind in "iu" and told in ("true", "false"):
        return stored.view(stored.dtype.str.replace("i" if told == "true" else "u", "u" if told == "true" else "i"))
    return stored


def _absent(stored: np.ndarray, attributes: Attributes, fill: object) -> np.ndarray:
    """Where a value is missing."""
    gone = np.zeros(stored.shape, dtype=bool)
    for name in _ABSENT:
        for number in _numbers(attributes, name):
            gone |= stored == _stored(number, stored, name, attributes)
    usual = _NEVER_WRITTEN.get(stored.dtype.str[1:])
    if usual is not None and isinstance(fill, np.generic) and fill == stored.dtype.type(usual):
        gone |= stored == fill
    return gone


def _stored(number: np.generic, stored: np.ndarray, name: str, attributes: Attributes) -> np.ndarray:
    """A number of an attribute as the data set stores it."""
    if stored.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return np.asarray(number).astype(stored.dtype)
    value, limits = number.item(), np.iinfo(stored.dtype)
    if text(attributes, "_Unsigned") and isinstance(value, int):
        value %= 2 ** (8 * stored.dtype.itemsize)  # the attribute has the type of the file
        value -= 2 ** (8 * stored.dtype.itemsize) * (value > limits.max)
    if math.isfinite(value) and (value != int(value) or not limits.min <= value <= limits.max):
        raise ValueError(f"the attribute {name} is {value:g}, which no number of {stored.dtype.name} is")
    return np.asarray(value)


def _limits(attributes: Attributes) -> Iterator[tuple[bool, np.generic]]:
    """Those of valid values: whether it is the lower one, and the number."""
    for name, lower in (("valid_min", True), ("valid_max", False)):
        found = _numbers(attributes, name)
        if found.size > 1:
            raise ValueError(f"the attribute {name} has {found.size} numbers: expected one")
        yield from ((lower, found[0]) for _ in found)
    both = _numbers(attributes, "valid_range")
    if both.size and (both.size != 2 or not both[0] <= both[1]):
        raise ValueError(f"the attribute valid_range is {describe(both.tolist())}: expected [low, high]")
    yield from zip((True, False), both, strict=False)


def _outside(values: np.ndarray, limits: Iterable[tuple[bool, np.generic]]) -> np.ndarray:
    """Which values are beyond limits."""
    gone = np.zeros(values.shape, dtype=bool)
    for lower, limit in limits:
        limit = limit.astype(values.dtype) if values.dtype.kind == "f" else limit  # in the precision of the data
        gone |= values < limit if lower else values > limit
    return gone


def _one(attributes: Attributes, name: str) -> float | None:
    """An attribute that is one finite number; None where there is none."""
    found = _numbers(attributes, name)
    if found.size > 1 or not np.isfinite(found).all():
        raise ValueError(f"the attribute {name} is {describe(found.tolist())}: expected one finite number")
    return float(found[0]) if found.size else None


def _numbers(attributes: Attributes, name: str) -> np.ndarray:
    """An attribute that is a number, several, or text that is one; of no size where there is none.

    Raises
    ------
    ValueError
        When it is something else.
    """
    value = attributes.get(name)
    if value is None:
        return np.empty(0)
    given = np.asarray(value)
    if given.dtype.kind in "fiu":
        return given.ravel()
    texts = _decoded(value)
    try:
        if texts and all(isinstance(one, str) for one in texts):
            return np.array(texts, dtype=float)
    except ValueError:
        pass
    raise ValueError(f"the attribute {name} is {describe(texts[0] if len(texts) == 1 else texts)}: expected a number")


def _decoded(value: object) -> list[object]:
    """What an attribute holds, texts of any kind as texts."""
    given = [] if value is None else np.asarray(value).ravel().tolist()
    return [one.decode("utf-8", "replace") if isinstance(one, bytes) else one for one in given]
