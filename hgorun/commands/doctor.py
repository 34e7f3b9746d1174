"""``doctor``: whether an installation is complete, right and as fast as it should be."""

from __future__ import annotations

import importlib.metadata as metadata
import json as json_text
import math
import os
import platform
import re
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import h5py
import numpy as np

from hgorun.commands.catalogue_options import Doctor
from hgorun.commands.outputs import NOT_OK
from hgorun.errors import HgorunError
from hgorun.native.compiler import cache_folder, processor, vector_doubles, why_not_kept
from hgorun.process import processors
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.tables.layout import entry, wrapped
from hgorun.version import __version__

_LIBRARIES = ("casadi", "h5py", "llvmlite", "matplotlib", "numpy", "pint", "pydantic", "pyyaml", "scipy", "typer")
# Extras that whoever works on hgorun itself installs.
_DEVELOPERS = frozenset({"bench", "dev", "docs", "release", "test"})
_OF_EXTRA = re.compile(r"""([\w.-]+).*\bextra *== *["']([\w.-]+)["']""")
_THETA, _END, _STEP = 2.0, 200.0, 1e-3
_WRONG = 1e-9  # largest error of the self-test: RK4 leaves 1e-11
_RUNS = 3
# CPU time of a step of the self-test, and where it was measured: a run of 200,000 steps, the best of three.
STORED = 22e-9
STORED_ON = "two cores of an AMD EPYC with AVX-512, November 2026"
_CAVEAT = "of one short run: other programs, a throttled or virtual processor change it by half; make bench is careful"
_SLOW = 3.0  # times the stored one: then something is wrong


@dataclass(frozen=True)
class SelfTest:
    """A linear plant and its observer, compared with their solutions in closed form.

    Attributes
    ----------
    error : float
        The largest difference of states and estimates.
    seconds : float
        CPU time of a step.
    """

    error: float
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the numbers are those of the solution."""
        return self.error <= _WRONG


def doctor(options: Doctor) -> int:
    """Say what there is, and test it: 3 with ``strict`` where something is amiss that leaves the numbers right.

    Raises
    ------
    HgorunError
        When the numbers of the self-test are wrong, or the cache cannot be emptied.
    """
    freed = _pruned() if options.prune else None
    test = self_test()
    count, size = _cached()
    lacking = _lacking()
    amiss = list(_amiss(test))
    if options.json:
        found: dict[str, object] = {
            "version": __version__,
            "python": platform.python_version(),
            "platform": platform.platform(),
            "libraries": {name: metadata.version(name) for name in _LIBRARIES},
            "extras": lacking,
            "cache": {"folder": str(cache_folder()), "entries": count, "bytes": size, "freed": freed},
            "processor": {"name": processor()[0], "doubles": vector_doubles(), "count": processors()},
            "self_test": asdict(test) | {"right": test.right, "stored_seconds": STORED, "stored_on": STORED_ON},
            "amiss": amiss,
        }
        print(json_text.dumps(found, indent=2))
    else:
        print("\n".join(_text(test, lacking, count, size, freed)))
        for words in amiss:
            print("\n".join(wrapped(f"! {words}")))
    if not test.right:
        raise HgorunError(f"the self-test is off by {test.error:.1e}, more than {_WRONG:g}: do not trust the numbers")
    return NOT_OK if options.strict and amiss else 0


def self_test() -> SelfTest:
    """Simulate an oscillator with a high-gain observer, and compare both with what is known of them.

    x1' = x2, x2' = -x1 from (1, 0) is (cos t, -sin t). The error of the observer with poles -theta obeys e' = M e with
    M = [[-2 theta, 1], [-1 - theta^2, 0]].
    """
    run = prepare(
        Experiment(
            {
                "time": {"end": _END, "output_step": 0.1},
                "plant": {
                    "states": ["x1", "x2"],
                    "dynamics": {"x1": "x2", "x2": "-x1"},
                    "output": "x1",
                    "initial": {"x1": 1, "x2": 0},
                },
                "observers": {"SHGO": {"type": "shgo", "theta": _THETA}},
                "solver": {"method": "rk4", "step": _STEP},
            },
            name="self-test",
        )
    )
    seconds = math.inf
    for _ in range(_RUNS):
        began = time.process_time()
        result = simulate_prepared(run)
        seconds = min(seconds, time.process_time() - began)
    x = np.stack([np.cos(result.time), -np.sin(result.time)], axis=1)
    rates, shapes = np.linalg.eig(np.array([[-2 * _THETA, 1], [-1 - _THETA**2, 0]]))
    start = np.linalg.solve(shapes, np.array([-1.0, 0.0]))
    e = np.real(np.exp(np.outer(result.time, rates)) * start @ shapes.T)
    found = np.concatenate([result.x - x, result.observers["SHGO"].xhat - x - e])
    return SelfTest(float(np.abs(found).max()), seconds * _STEP / _END)


def _amiss(test: SelfTest) -> Iterator[str]:
    """What works, and could be better."""
    if test.seconds > _SLOW * STORED:
        yield f"a step takes {test.seconds / STORED:.1f} times the stored time: {_CAVEAT}"
    if why := why_not_kept():
        yield f"compiled code is not kept in {cache_folder()}: {why}; what is not there yet is compiled by each run"


def _text(test: SelfTest, lacking: Mapping[str, str | None], count: int, size: int, freed: int | None) -> list[str]:
    name, _ = processor()
    lines = [f"hgorun {__version__}, Python {platform.python_version()}, {platform.platform()}", "", "libraries:"]
    versions = {library: metadata.version(library) for library in _LIBRARIES}
    versions["h5py"] += f" with HDF5 {h5py.version.hdf5_version}"
    lines += wrapped(", ".join(f"{library} {version}" for library, version in versions.items()), "  ")
    lines += ["", "extras:"]
    for extra, package in lacking.items():
        lines += entry(extra, "there" if package is None else f"not there: pip install {package}", 8)
    chosen = ", chosen by HGORUN_CPU" if os.environ.get("HGORUN_CPU") else ""
    lines += ["", "processor:"]
    lines += wrapped(f"compiled for {name}{chosen}: {vector_doubles()} members of an ensemble side by side", "  ")
    lines += wrapped(f"{processors()} processors for threads and workers", "  ")
    lines += ["", "cache of compiled code:"]
    emptied = "; --prune empties it" if count else ""
    lines += wrapped(f"{cache_folder()}: {count} programs, {size / 2**20:.1f} MiB{emptied}", "  ")
    if freed is not None:
        lines += wrapped(f"{freed / 2**20:.1f} MiB were freed", "  ")
    right = "right" if test.right else "wrong"
    lines += ["", "self-test: an oscillator and its observer beside their solutions in closed form:"]
    lines += wrapped(f"{right}: largest difference {test.error:.1e}, at most {_WRONG:g} is allowed", "  ")
    ratio = test.seconds / STORED
    speed = f"{test.seconds * 1e9:.0f} ns a step, {ratio:.2f} of the time on {STORED_ON}: {_CAVEAT}"
    return [*lines, *wrapped(speed, "  ")]


def extras() -> dict[str, list[str]]:
    """What each optional feature needs, as the package's metadata say it: names of packages."""
    try:
        requirements = metadata.requires("hgorun") or []
    except metadata.PackageNotFoundError:  # an unpacked archive that was not installed
        return {}
    needed: dict[str, list[str]] = {}
    for requirement in requirements:
        if (found := _OF_EXTRA.match(requirement)) and found[2] not in _DEVELOPERS:
            needed.setdefault(found[2], []).append(found[1])
    return needed


def _lacking() -> dict[str, str | None]:
    """Optional features, and what each lacks: a library that is not there, or None."""
    return {
        extra: next((name for name in needed if not _installed(name)), None)
        for extra, needed in sorted(extras().items())
    }


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _entries() -> list[Path]:
    """The programs in the cache."""
    folder = cache_folder()
    return [path for path in folder.glob("*.o") if path.is_file()] if folder.is_dir() else []


def _cached() -> tuple[int, int]:
    """How many programs there are, and their bytes."""
    sizes = [path.stat().st_size for path in _entries()]
    return len(sizes), sum(sizes)


def _pruned() -> int:
    """Remove all programs; the bytes that they took.

    Raises
    ------
    HgorunError
        When one cannot be removed.
    """
    _, size = _cached()
    for path in _entries():
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise HgorunError(f"--prune: {path.parent} cannot be emptied: {error.strerror}") from None
    return size
