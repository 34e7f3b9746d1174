"""Read a result file, which may come from anybody."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from hgorun.errors import printable
from hgorun.result.file.closed_file import read_closed
from hgorun.result.file.recorded_file import RecordedFile
from hgorun.result.hdf5 import digests
from hgorun.result.hdf5.forms import RESULT, not_this
from hgorun.result.hdf5.not_yet import refuse_what_has_not_run
from hgorun.result.hdf5.stored import LARGEST, NAMED, StoredFile, budget_of, file_at, is_finite, is_number, opened
from hgorun.result.records.data import DesignNumbers, Integration, IntegrationError, Measurements
from hgorun.result.records.observer import MAPS, Coordinates, ObserverResult
from hgorun.result.records.status import OK, STATUSES, Verdict
from hgorun.result.result import Result

_LONGEST = 1e100  # a window
_DIVERGED_AT = "diverged at t="  # as files of older versions say it


def read(path: str | Path, *, max_memory: float = LARGEST) -> Result:
    """Read a result file.

    It is read in a process of its own, where there are any, so that a file made to harm does not.

    Parameters
    ----------
    path : path
    max_memory : float
        Bytes that its numbers may take; 1 GiB by default, ``inf`` for any.

    Returns
    -------
    Result

    Raises
    ------
    ConfigError
        When the file is missing, not a result of hgorun, damaged, or larger than allowed.

    Examples
    --------
    >>> path = result.save("first.h5")
    >>> hgorun.read(path).states
    ('x1', 'x2')
    """
    path = file_at(path)
    refuse_what_has_not_run(path, RESULT)
    budget = budget_of(max_memory)
    return opened(path, budget, lambda file: _Reader(file, path, budget).result())


def stored_digests(path: Path) -> dict[str, str]:
    """The digest of every data set as it stands in a file that :func:`read` takes; those without are left out."""
    return opened(path, LARGEST, digests.of_file)


class _Reader(StoredFile):
    """A result, piece by piece."""

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
        if not isinstance(form, str) or form != RESULT:
            raise self.error(not_this(form, RESULT, self.path))
        plant = self.group("plant")
        estimate = "kind" in self.file.attrs
        if estimate:
            states, outputs = self.names_of_estimate(plant)
        else:
            states, outputs = self.labels("plant/x"), self.labels("plant/y")
        inputs = self.labels("plant/u") if "u" in plant else ()
        time = self.times("time")
        nt, n, q = time.size, len(states), len(outputs)
        if nt == 0:
            raise self.error("time is empty")
        found = Result(
            name=printable(self.text("name")),
            title=printable(self.text("title")),
            time=time,
            x=np.zeros((nt, 0)) if estimate else self.numbers("plant/x", nt, n),
            u=self.numbers("plant/u", nt, len(inputs)) if inputs else np.zeros((nt, 0)),
            y=np.zeros((nt, 0)) if estimate else self.numbers("plant/y", nt, q),
            states=states,
            inputs=inputs,
            outputs=outputs,
            units=self.entries("units", lambda _, value: isinstance(value, str), "text"),
            measurements=Measurements.nothing(q) if estimate else self.measurements(q),
            observers={label: self.observer(label, nt, n) for label in self.group("observers")},
            config=self.text("config"),
            resolved=self.text("config_resolved"),
            seed=self.integer("seed"),
            windows=self.entries(
                "windows", _is_window, "two finite numbers (steady, transient) or one (average, settling)"
            ),
            integration=self.integration(),
            measures=self.measures_of_estimate(states) if estimate else self.measures(states, outputs),
            remarks=self.remarks(),
            verdict=self.verdict("plant", plant) if "status" in plant.attrs else OK,
            design=self.design(),
            recorded=self.recorded_file(outputs).recorded() if estimate else None,
            closed_loop=read_closed(self, (nt, n, len(inputs), q), tuple(self.group("observers"))),
        )
        self.check_attributes()
        return found

    def names_of_estimate(self, plant: h5py.Group) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """States and outputs, where there is no truth."""
        if self.text("kind") != "estimate":
            raise self.error(f"attribute kind must be estimate, found {self.text('kind')!r:.50}")
        label = next(iter(self.group("observers")), None)
        outputs = plant.attrs.get("outputs")
        known = [str(name) for name in outputs] if isinstance(outputs, np.ndarray) and outputs.ndim == 1 else []
        if label is None or not known or any(name != printable(name) or len(name) > NAMED for name in known):
            raise self.error("an estimate has an observer, and its plant has names of outputs")
        return self.labels(f"observers/{label}/xhat"), tuple(known)

    def measures_of_estimate(self, states: tuple[str, ...]) -> dict[str, str] | None:
        """Which outputs are which states."""
        plant = self.group("plant")
        found = self.mapping("measures", plant) if "measures" in plant.attrs else {}
        if not all(state in states for state in found.values()):
            raise self.error("plant: attribute measures must name a state for every output in it")
        return found

    def recorded_file(self, outputs: tuple[str, ...]) -> RecordedFile:
        """What an estimate has beside the parts of a simulation."""
        return RecordedFile(self, len(self.group("observers")), outputs)

    def measurements(self, q: int) -> Measurements:
        """What the observers of a simulated plant got."""
        times = self.times("measurement/time")
        taken, y = (self.numbers(f"measurement/{name}", times.size, q) for name in ("taken", "y"))
        return Measurements(time=times, taken=taken, y=y, every=self._every(times.size))

    def _every(self, size: int) -> int:
        """Of so many measurements one is in the file, as their numbers say."""
        if size < 2 or "measurement/number" not in self.file:
            return 1
        numbers = self.integers("measurement/number", size)
        every = int(numbers[1])
        if every < 1 or not np.array_equal(numbers, every * np.arange(size)):
            raise self.error("measurement/number: expected 0, 1, 2, ..., or every so many of them")
        return every

    def integration(self) -> Integration | None:
        """How it was integrated, as far as the file says."""
        if "integration_error" not in self.file.attrs:
            return None
        error = self.entries("integration_error", lambda _, value: is_number(value), "a number")
        told = self.entries("integration", _is_told, "a name or a number") if "integration" in self.file.attrs else {}
        return Integration(
            error=IntegrationError(error, self._unresolved()),
            **{name: told.get(name) for name in ("method", "step", "rtol", "evaluations")},
        )

    def _unresolved(self) -> dict[str, dict[str, tuple[str, ...]]]:
        """Which times the integration did not resolve; files of older versions do not say."""
        if "unresolved" not in self.file.attrs:
            return {}
        found = self.entries("unresolved", _are_named, "metrics with lists of states")
        return {label: {metric: tuple(states) for metric, states in of.items()} for label, of in found.items()}

    def design(self) -> DesignNumbers | None:
        """The numbers that it was made with; files of older versions do not say."""
        if "design" not in self.file:
            return None
        step = self.group("design").attrs.get("step")
        if not is_finite(step) or step <= 0:
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
        if label != printable(label) or len(label) > NAMED:
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
            assessed=self.recorded_file(()).assessed(label, nt, n) if "no_band" in group.attrs else None,
            unestimated=tuple(self.text("unestimated", group).split()) if "unestimated" in group.attrs else (),
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
        if found is not None and not is_finite(found):
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


def _are_named(_: str, value: Any) -> bool:
    """Of times that are not resolved: metrics, each with states."""
    return isinstance(value, dict) and all(
        isinstance(states, list) and all(isinstance(state, str) for state in states) for states in value.values()
    )


def _is_told(key: str, value: Any) -> bool:
    """Of how it was integrated."""
    if key == "method":
        return isinstance(value, str) and value == printable(value) and len(value) <= NAMED
    return value is None or is_finite(value)


def _is_window(key: str, value: Any) -> bool:
    if key in ("steady", "transient"):
        return isinstance(value, list) and len(value) == 2 and all(is_finite(v) and abs(v) <= _LONGEST for v in value)
    return key in ("average", "settling") and is_finite(value) and 0 <= value <= _LONGEST
