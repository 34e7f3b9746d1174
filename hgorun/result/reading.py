"""Read a result file, which may come from anybody."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from hgorun.errors import ConfigError, printable
from hgorun.result import digests
from hgorun.result.data import MAPS, Coordinates, DesignNumbers, Integration, Measurements, ObserverResult
from hgorun.result.guarded import Failed, guarded
from hgorun.result.result import Result
from hgorun.result.status import OK, STATUSES, Verdict
from hgorun.result.writing import FORMAT

T = TypeVar("T")

_LARGEST = 2**30  # bytes that the numbers may take; compressed or sparse data sets could claim any size
_SECONDS = 60.0  # that reading may take: a GiB takes two
_LONGEST = 1e100  # a window
_NAMED = 1_000  # characters of a label
_DIVERGED_AT = "diverged at t="  # as files of older versions say it


def read(path: str | Path, *, max_memory: float = _LARGEST) -> Result:
    """Read a result file.

    It is read in a process of its own, where there are any, so that a file made to harm does not.

    Parameters
    ----------
    path : path
    max_memory : float
        Bytes that its numbers may take; 1 GiB by default.

    Raises
    ------
    ConfigError
        When the file is missing, no result of hgorun, damaged, or larger than allowed.
    """
    path = Path(path)
    if not os.path.isfile(path):
        raise ConfigError("not a regular file" if os.path.exists(path) else "no such file", file=str(path))
    if path.suffix.lower() in {".yaml", ".yml"}:
        raise ConfigError("this is a configuration, not a result file; hgorun simulate makes one of it", file=str(path))
    budget = int(max_memory)
    return _opened(path, budget, lambda file: _Reader(file, path, budget).result())


def stored_digests(path: Path) -> dict[str, str]:
    """The digest of every data set as it stands in a file that :func:`read` takes; those without are left out."""
    return _opened(path, _LARGEST, digests.of_file)


def _opened(path: Path, budget: int, work: Callable[[h5py.File], T]) -> T:
    """What a function finds in a file, in a process of its own."""
    try:
        return guarded(lambda: _found(path, budget, work), seconds=_SECONDS, memory=4 * budget + 2**28)
    except Failed as error:
        raise ConfigError(f"not an intact result file of hgorun: {error}", file=str(path)) from None


def _found(path: Path, budget: int, work: Callable[[h5py.File], T]) -> T:
    try:
        with h5py.File(path, "r") as file:
            return work(file)
    except BlockingIOError:
        raise ConfigError("another program has it open for writing", file=str(path)) from None
    except MemoryError:
        raise ConfigError(f"reading it takes more than {budget / 2**30:.3g} GiB", file=str(path)) from None
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"not a result file of hgorun: {reason}", file=str(path)) from error


class _Reader:
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
        return np.asarray(values, dtype=float)

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
        if any(v != printable(v) or len(v) > _NAMED for v in found):
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

    def remarks(self) -> tuple[str, ...]:
        """Texts in a JSON list; none where the attribute is missing."""
        if "remarks" not in self.file.attrs:
            return ()
        try:
            found = json.loads(self.text("remarks"))
        except (ValueError, RecursionError) as error:
            raise self.error("attribute remarks is not JSON") from error
        if not isinstance(found, list) or not all(isinstance(text, str) for text in found):
            raise self.error("attribute remarks must be a JSON list of texts")
        return tuple(found)

    def result(self) -> Result:
        form = self.file.attrs.get("format")
        if not isinstance(form, str) or form != FORMAT:
            raise self.error(f"not a result file of hgorun: attribute format is {form!r}, expected {FORMAT!r}")
        states, outputs = self.labels("plant/x"), self.labels("plant/y")
        plant = self.group("plant")
        inputs = self.labels("plant/u") if "u" in plant else ()
        time, y_times = self.times("time"), self.times("measurement/time")
        nt, nk, n, q = time.size, y_times.size, len(states), len(outputs)
        if nt == 0:
            raise self.error("time is empty")
        found = Result(
            name=printable(self.text("name")),
            title=printable(self.text("title")),
            time=time,
            x=self.numbers("plant/x", nt, n),
            u=self.numbers("plant/u", nt, len(inputs)) if inputs else np.zeros((nt, 0)),
            y=self.numbers("plant/y", nt, q),
            states=states,
            inputs=inputs,
            outputs=outputs,
            units=self.entries("units", lambda _, value: isinstance(value, str), "text"),
            measurements=Measurements(
                time=y_times,
                taken=self.numbers("measurement/taken", nk, q),
                y=self.numbers("measurement/y", nk, q),
            ),
            observers={label: self.observer(label, nt, n) for label in self.group("observers")},
            config=self.text("config"),
            resolved=self.text("config_resolved"),
            seed=self.integer("seed"),
            windows=self.entries(
                "windows", _is_window, "two finite numbers (steady, transient) or one (average, settling)"
            ),
            integration=self.integration(),
            measures=self.measures(states, outputs),
            remarks=self.remarks(),
            verdict=self.verdict("plant", plant) if "status" in plant.attrs else OK,
            design=self.design(),
        )
        self.check_attributes()
        return found

    def integration(self) -> Integration | None:
        """How it was integrated, as far as the file says."""
        if "integration_error" not in self.file.attrs:
            return None
        error = self.entries("integration_error", lambda _, value: _is_number(value), "a number")
        told = self.entries("integration", _is_told, "a name or a number") if "integration" in self.file.attrs else {}
        return Integration(error=error, **{name: told.get(name) for name in ("method", "step", "rtol", "evaluations")})

    def design(self) -> DesignNumbers | None:
        """The numbers that it was made with; files of older versions do not say."""
        if "design" not in self.file:
            return None
        step = self.group("design").attrs.get("step")
        if not _is_finite(step) or step <= 0:
            raise self.error(f"design: attribute step must be a positive number, found {step!r:.50}")
        return DesignNumbers(self.numbers("design/parameters", None), self.numbers("design/start", None), float(step))

    def check_attributes(self) -> None:
        """What is said of the run must be what was written."""
        stored = self.file.attrs.get(digests.ATTRIBUTE)
        if stored is not None and stored != digests.of_attributes(self.file):
            raise self.error("the attributes are damaged: they do not have the digest that was stored with them")

    def measures(self, states: tuple[str, ...], outputs: tuple[str, ...]) -> dict[str, str] | None:
        """Which outputs are which states; files of older versions do not say."""
        found = self.data("plant/y").attrs.get("measures")
        if found is None:
            return None
        names = list(found) if isinstance(found, np.ndarray) and found.shape == (len(outputs),) else []
        if not names or not all(isinstance(name, str) and name in ("", *states) for name in names):
            raise self.error("plant/y: attribute measures must name a state, or nothing, for every output")
        return {output: str(name) for output, name in zip(outputs, names, strict=True) if name}

    def observer(self, label: str, nt: int, n: int) -> ObserverResult:
        if label != printable(label) or len(label) > _NAMED:
            raise self.error(f"observers: {label!r:.50} is a label that cannot be shown")
        group = self.group(f"observers/{label}")
        states = (f"observers/{label}/state", self.group(f"observers/{label}/state"))
        metrics = (f"metrics/{label}", self.group(f"metrics/{label}"))
        return ObserverResult(
            type=self.text("type", group),
            xhat=self.numbers(f"observers/{label}/xhat", nt, n),
            internal={name: self.internal(f"{states[0]}/{name}", nt) for name in states[1]},
            gains=self.mapping("gains", group),
            dimension=self.integer("dimension", group),
            verdict=self.verdict(f"observers/{label}", group),
            metrics={name: self.numbers(f"{metrics[0]}/{name}", n) for name in metrics[1]},
            coordinates=self.coordinates(label, group),
        )

    def verdict(self, name: str, group: h5py.Group) -> Verdict:
        """What is said of the plant or an observer; older files say ``ok`` or ``diverged at t=...``."""
        word = self.text("status", group)
        at, lost = (self.moment(name, attribute, group) for attribute in ("status_at", "diverged_at"))
        if word.startswith(_DIVERGED_AT):
            word, at = "diverged", lost
        status = next((known for known in STATUSES if known == word), None)
        if status is None:
            raise self.error(f"{name}: attribute status must be one of {', '.join(STATUSES)}, found {word!r:.50}")
        return Verdict(status, at, printable(self.text("reason", group)) if "reason" in group.attrs else None)

    def moment(self, name: str, attribute: str, group: h5py.Group) -> float | None:
        """A time, where there is one."""
        found = group.attrs.get(attribute)
        if found is not None and not _is_finite(found):
            raise self.error(f"{name}: attribute {attribute} must be a number, found {found!r}")
        return None if found is None else float(found)

    def coordinates(self, label: str, group: h5py.Group) -> Coordinates | None:
        """Which were taken; files of older versions do not say."""
        if "map" not in group.attrs:
            return None
        chains = self.mapping("chains", group)
        if not all(isinstance(length, int) for length in chains.values()):
            raise self.error(f"observers/{label}: attribute chains must give a length for every output")
        name = self.text("map", group)
        taken = next((known for known in MAPS if known == name), None)
        if taken is None:
            raise self.error(f"observers/{label}: attribute map must be {' or '.join(MAPS)}, found {name!r}")
        return Coordinates(taken, chains)

    def internal(self, name: str, nt: int) -> np.ndarray:
        """A state of any shape, along time."""
        return self.numbers(name, nt, *[None] * (len(self.data(name).shape or ()) - 1))


def _is_number(value: Any) -> bool:
    """Of JSON or of an attribute; an integer that no float can hold is none."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) < 2**1023
    return isinstance(value, (float, np.integer, np.floating))


def _is_told(key: str, value: Any) -> bool:
    """Of how it was integrated."""
    if key == "method":
        return isinstance(value, str) and value == printable(value) and len(value) <= _NAMED
    return value is None or _is_finite(value)


def _is_finite(value: Any) -> bool:
    return _is_number(value) and math.isfinite(value)


def _is_window(key: str, value: Any) -> bool:
    if key in ("steady", "transient"):
        return isinstance(value, list) and len(value) == 2 and all(_is_finite(v) and abs(v) <= _LONGEST for v in value)
    return key in ("average", "settling") and _is_finite(value) and 0 <= value <= _LONGEST
