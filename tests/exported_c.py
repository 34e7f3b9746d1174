"""Exported observers as compiled C, driven through the events of a run as a program on the plant floor would."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hgorun.export.c_files import c_files
from hgorun.export.observer import Exported
from hgorun.measurement.schedule import nearest_event
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.simulation.passes.passes import as_given, carry_out, plan_of
from hgorun.simulation.prepared import PreparedRun

COMPILERS = tuple(name for name in ("gcc", "clang") if shutil.which(name))
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion")
NATIVE = ("-O2", "-march=native")


def compile_c(folder: Path, files: Mapping[str, str], *options: str, compiler: str = "gcc") -> Path:
    """A shared library of some sources, compiled with all warnings as errors."""
    for name, text in files.items():
        (folder / name).write_text(text)
    sources = [name for name in files if name.endswith(".c")]
    library = folder / "observers.so"
    command = [compiler, *STRICT, *options, "-shared", "-fPIC", *sources, "-lm", "-o", library.name]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return library


def sizes(names: Sequence[str]) -> str:
    """A source that tells how large the observers' structures are."""
    includes = "".join(f'#include "{name}.h"\n' for name in names)
    body = "".join(f"const unsigned long size_{name} = sizeof(hgo_{name}_observer);\n" for name in names)
    return includes + body


@dataclass
class Compiled:
    """An observer in a library, with memory of its own."""

    library: ctypes.CDLL
    observer: Exported
    single: bool = False

    def __post_init__(self) -> None:
        size = ctypes.c_ulong.in_dll(self.library, f"size_{self.observer.name}").value
        self.memory = ctypes.create_string_buffer(size)
        self.real = ctypes.c_float if self.single else ctypes.c_double
        self._call("init")

    def _call(self, name: str, *arguments: object) -> int:
        function = getattr(self.library, f"hgo_{self.observer.name}_{name}")
        function.restype = ctypes.c_uint32
        return int(function(self.memory, *arguments))

    def _numbers(self, values: Sequence[float]) -> ctypes.Array:  # type: ignore[type-arg]  # of either type
        return (self.real * max(len(values), 1))(*values)

    def predict(self, t: float) -> int:
        return self._call("predict", ctypes.c_double(t))

    def update(self, taken: float, y: Sequence[float], which: int) -> int:
        return self._call("update", ctypes.c_double(taken), self._numbers(y), ctypes.c_uint32(which))

    def measure(self, t: float, y: Sequence[float], which: int) -> int:
        return self._call("measure", ctypes.c_double(t), self._numbers(y), ctypes.c_uint32(which))

    def input(self, t: float, u: Sequence[float]) -> int:
        return self._call("input", ctypes.c_double(t), self._numbers(u))

    def silence(self, which: int) -> None:
        function = getattr(self.library, f"hgo_{self.observer.name}_silence")
        function.restype = None
        function(self.memory, ctypes.c_uint32(which))

    @property
    def estimate(self) -> np.ndarray:
        """xhat now."""
        out = self._numbers([0.0] * len(self.observer.states))
        self._call("estimate", out)
        return np.array(out[:])


def load_all(folder: Path, observers: Sequence[Exported], *options: str, single: bool = False) -> dict[str, Compiled]:
    """Observers compiled into one library, by name."""
    files = {name: text for observer in observers for name, text in c_files(observer, single=single).items()}
    files["sizes.c"] = sizes([observer.name for observer in observers])
    library = ctypes.CDLL(str(compile_c(folder, files, *(options or NATIVE))))
    return {observer.name: Compiled(library, observer, single) for observer in observers}


@dataclass(frozen=True, eq=False)
class Driven:
    """What the engine makes of a run with samples, event by event."""

    events: np.ndarray
    estimates: dict[str, np.ndarray]  # label -> (events, n)
    samples: list[list[tuple[int, float, float, bool]]]  # event -> output, taken, y, whether it is used


def driven(run: PreparedRun) -> Driven:
    """A run carried out by the engine, looked at at its events."""
    how = replace(as_given(run), bounded=False)  # large numbers of an observer are no divergence
    plan, start = plan_of(run, how)
    events = run.schedule.events
    raw = carry_out(run, how, replace(plan, grid=events), start)
    estimates = run.structure.estimates_along(events, run.numbers.p, raw.rows[:, :, 0])
    samples: list[list[tuple[int, float, float, bool]]] = [[] for _ in events]
    base = 0
    for i, channel in enumerate(run.channels):
        s = channel.samples
        at = nearest_event(events, s.arrival)
        taken = events[nearest_event(events, s.taken)]
        for k in range(s.arrival.size):
            samples[at[k]].append((i, float(taken[k]), float(raw.measured[base + k, 0]), bool(s.used[k])))
        base += s.arrival.size
    labels = [block.label for block in run.observers]
    return Driven(events, {label: np.asarray(estimates.of(j)) for j, label in enumerate(labels)}, samples)


def follow(run: PreparedRun, found: Driven, observer: Compiled) -> Iterator[np.ndarray]:
    """The estimates of a compiled observer that is told the same, after each event."""
    q = len(observer.observer.outputs)
    jumps = isinstance(observer.observer.design.observer, (SampledObserver, CorrectedObserver))
    for t, samples in zip(found.events, found.samples, strict=True):
        status = observer.predict(float(t))
        assert status == 0, status
        if jumps and samples:
            last = {i: y for i, _, y, used in samples if used}
            assert observer.update(float(t), [last.get(i, 0.0) for i in range(q)], sum(1 << i for i in last)) == 0
        for i, taken, y, used in [] if jumps else samples:
            status = observer.update(taken, [y] * q, 1 << i)
            assert status == (0 if used else 1), (status, t, taken)
        yield observer.estimate
