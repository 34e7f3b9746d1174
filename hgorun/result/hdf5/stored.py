"""Files of numbers, which may come from anybody: opened in a process of its own, and nothing taken unchecked."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from io import BytesIO
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from hgorun.config.kinds import HDF5, head_of, is_recording, kind_of
from hgorun.config.nearest import no_file
from hgorun.config.types import describe
from hgorun.errors import ConfigError, printable
from hgorun.result.hdf5 import digests
from hgorun.result.hdf5.guarded import Failed, guarded

T = TypeVar("T")

LARGEST = 2**30  # bytes that the numbers may take; compressed or sparse data sets could claim any size
NAMED = 1_000  # characters of a label
_MOST = 2**60  # bytes: more than any machine has
IN_USE = "another program has it open for writing"
_SECONDS = 60.0  # that reading may take: a GiB takes two


def file_at(path: str | Path) -> Path:
    """A path behind which a file stands; a pipe or a device would be read for ever.

    Raises
    ------
    ConfigError
    """
    if not os.path.isfile(path):
        raise ConfigError(no_file(Path(path)), file=str(path))
    return Path(path)


def budget_of(max_memory: object) -> int:
    """Bytes that numbers may take, as somebody allows it: a number greater than 0, infinity for as many as there are.

    Raises
    ------
    ConfigError
    """
    allowed = float(max_memory) if isinstance(max_memory, Real) and not isinstance(max_memory, bool) else math.nan
    if not allowed > 0:
        raise ConfigError(f"max_memory: expected a number of bytes greater than 0, found {describe(max_memory)}")
    return int(min(allowed, _MOST))


def opened(path: Path, budget: int, work: Callable[[h5py.File], T]) -> T:
    """What a function finds in a file, in a process of its own."""
    try:
        return guarded(lambda: found(path, path, budget, work), seconds=_SECONDS, memory=4 * budget + 2**28)
    except Failed as error:
        raise ConfigError(f"not an intact file of hgorun: {error}", file=str(path)) from None


def found(source: Path | BytesIO, path: Path, budget: int, work: Callable[[h5py.File], T]) -> T:
    """What a function finds in a file, or in the bytes of one, whose path is for messages."""
    try:
        with h5py.File(source, "r") as file:
            return work(file)
    except BlockingIOError:
        raise ConfigError(IN_USE, file=str(path)) from None
    except MemoryError:
        raise ConfigError(f"reading it takes more than {budget / 2**30:.3g} GiB", file=str(path)) from None
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError) as error:
        if isinstance(source, Path) and (what := _other_file(source)):
            raise ConfigError(f"not a file of hgorun: {what}", file=str(path)) from None
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"not a file of hgorun: {reason}", file=str(path)) from error


def _other_file(path: Path) -> str:
    """What a file is that HDF5 cannot read, and what to do with it; nothing where it begins as one of HDF5 does."""
    head = head_of(path)
    if not head:
        return "it is empty; hgorun simulate or estimate writes results"
    kind = kind_of(head)
    if kind is HDF5:
        return ""
    if is_recording(head, path):
        return "it is a table of data; a configuration names it under data.file, for hgorun estimate"
    what = kind.what if kind is not None else "a file of another kind" if b"\0" in head else "text"
    return f"it is {what}, not HDF5; results are HDF5 files (.h5) that hgorun simulate, estimate and sweep write"


class StoredFile:
    """Takes nothing from a file that it has not checked, and nothing from outside it."""

    def __init__(self, file: h5py.File, path: Path, budget: int) -> None:
        self.file, self.path = file, path
        self.budget = self.allowed = budget

    def error(self, message: str) -> ConfigError:
        return ConfigError(message, file=str(self.path))

    def member(self, name: str) -> Any:
        """What stands at a path; soft and external links could lead to any other file."""
        place = self.file
        for part in name.split("/"):
            link = place.get(part, getlink=True) if isinstance(place, h5py.Group) else None
            if link is None:
                raise self.error(f"{name} is missing")
            if not isinstance(link, h5py.HardLink):
                raise self.error(f"{name}: {part} is a link, which is refused")
            place = place[part]
        return place

    def group(self, name: str) -> h5py.Group:
        found = self.member(name)
        if not isinstance(found, h5py.Group):
            raise self.error(f"{name} is not a group")
        return found

    def data(self, name: str) -> h5py.Dataset:
        found = self.member(name)
        if not isinstance(found, h5py.Dataset) or found.is_virtual or found.external:
            raise self.error(f"{name} is not an ordinary data set")
        return found

    def numbers(self, name: str, *shape: int | None) -> np.ndarray:
        """Numbers of a shape, in which None is any length."""
        return np.asarray(self._checked(name, shape), dtype=float)

    def integers(self, name: str, *shape: int | None) -> np.ndarray:
        """Integers of a shape, all digits of them, where a float has 53 bits only."""
        values = self._checked(name, shape)
        if values.dtype.kind not in "iu" or np.any(values > np.iinfo(np.int64).max):
            raise self.error(f"{name} holds {values.dtype}, expected integers of 64 bits with a sign")
        return values.astype(np.int64)

    def _checked(self, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """Numbers as they are stored."""
        data = self.data(name)
        if data.dtype.kind not in "fiu" or data.shape is None:
            raise self.error(f"{name} holds {data.dtype}, expected real numbers")
        self.budget -= data.size * max(8, data.dtype.itemsize)
        if self.budget < 0:
            raise self.error(f"the data sets are larger than {self.allowed / 2**30:.3g} GiB")
        wanted = [have if want is None else want for have, want in zip(data.shape, shape, strict=False)]
        if len(data.shape) != len(shape) or list(data.shape) != wanted:
            expected = ", ".join("any" if want is None else str(want) for want in shape)
            raise self.error(f"{name} has shape {data.shape}, expected ({expected})")
        try:
            values = np.asarray(data[()])
        except OSError as error:
            raise self.error(f"{name} is damaged: its checksum is wrong, or it cannot be read") from error
        stored = data.attrs.get(digests.ATTRIBUTE)
        if stored is not None and stored != digests.of_numbers(values):
            raise self.error(f"{name} is damaged: its numbers do not have the digest that was stored with them")
        return values

    def times(self, name: str) -> np.ndarray:
        values = self.numbers(name, None)
        if not np.all(np.isfinite(values)) or np.any(np.diff(values) <= 0):
            raise self.error(f"{name} must be finite and strictly increasing")
        return values

    def labels(self, name: str) -> tuple[str, ...]:
        values = self.data(name).attrs.get("labels")
        found = list(values) if isinstance(values, np.ndarray) and values.ndim == 1 else []
        if not found or not all(isinstance(v, str) for v in found):
            raise self.error(f"{name}: attribute labels must be a list of names")
        if any(v != printable(v) or len(v) > NAMED for v in found):
            raise self.error(f"{name}: attribute labels has a name that cannot be shown")
        if len(set(found)) < len(found):
            raise self.error(f"{name}: attribute labels has a duplicate name: {', '.join(found)}")
        return tuple(map(str, found))

    def text(self, name: str, place: Any = None) -> str:
        value = (self.file if place is None else place).attrs.get(name)
        if not isinstance(value, str):
            raise self.error(f"attribute {name} must be text, found {value!r}")
        return str(value)

    def integer(self, name: str, place: Any = None) -> int:
        value = (self.file if place is None else place).attrs.get(name)
        if not isinstance(value, (int, np.integer)) or value < 0:
            raise self.error(f"attribute {name} must be an integer of at least 0, found {value!r}")
        return int(value)

    def mapping(self, name: str, place: Any = None) -> dict[str, Any]:
        try:
            value = json.loads(self.text(name, place))
        except (ValueError, RecursionError) as error:
            raise self.error(f"attribute {name} is not JSON") from error
        if not isinstance(value, dict):
            raise self.error(f"attribute {name} must be a JSON object")
        return value

    def entries(self, name: str, right: Callable[[str, Any], bool], expected: str) -> Mapping[str, Any]:
        """A mapping each of whose entries is right."""
        found = self.mapping(name)
        for key, value in found.items():
            if not right(key, value):
                raise self.error(f"attribute {name}: {key} is {value!r:.50}, expected {expected}")
        return found


def is_number(value: Any) -> bool:
    """Of JSON or of an attribute; an integer that no float can hold is none."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) < 2**1023
    return isinstance(value, (float, np.integer, np.floating))


def is_finite(value: Any) -> bool:
    return is_number(value) and math.isfinite(value)
