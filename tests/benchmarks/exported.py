"""The time of a step of exported C over that of the native engine, for every observer that is exported.

    python tests/benchmarks/exported.py [NAME ...] [--delay 0.02] [--flags "-O2"]

Each observer of the registry runs on the first common plant that it takes, alone: the native loop of its equations with
the samples of a recording, and the exported file, compiled with the flags and driven by the same samples in C. What is
compared is CPU time for all steps and samples, and the estimates at the end are shown to be the same. The bar is 1.5.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from observers import ratio

sys.path.insert(0, str(Path(__file__).parents[1]))

from exported_c import Driven, compile_c, driven, sizes

from hgorun.engine.memory import Start
from hgorun.errors import HgorunError
from hgorun.export.c_files import c_files
from hgorun.export.observer import Exported
from hgorun.export.prepared import exported
from hgorun.observers.base import OBSERVERS
from hgorun.simulation.passes.loss import UNBOUNDED
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare
from hgorun.simulation.system.structure import parameter_values, structure_of
from hgorun.simulation.system.truth import Recording
from hgorun.simulation.timeline.tables import build_plan
from hgorun.simulation.timeline.timeline import Stepping, Timeline
from hgorun.testing.cases import Subject

BAR = 1.5
STEP, PERIOD, END = 2e-3, 0.02, 200.0

DRIVER = """
void drive_{name}(hgo_{name}_observer *it, long count, const double *t, const double *taken,
    const double *y, double *xhat)
{{
    long k;
    hgo_{name}_init(it);
    for (k = 0; k < count; k++) {{
        (void)hgo_{name}_predict(it, t[k]);
        (void)hgo_{name}_update(it, taken[k], &y[k * {outputs}], {all});
    }}
    hgo_{name}_estimate(it, xhat);
}}
"""


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of all outputs at once: when they arrive, when they were taken, y (count, q)."""

    arrival: np.ndarray
    taken: np.ndarray
    y: np.ndarray


def run_of(name: str, delay: float) -> PreparedRun:
    """An observer on the first common plant that it takes."""
    case = Subject(OBSERVERS.find(name), name, {}, None).cases[0]
    noise = [{"type": "gaussian", "std": 0.02}]  # or all would die down to numbers that processors are slow with
    measurement: dict[str, Any] = {"sampling": {"period": PERIOD, "offset": PERIOD}, "noise": noise}
    if delay:
        measurement["delay"] = delay
    experiment = case.experiment({name: {"initial": case.aside}}, measurement=measurement, end=END)
    return prepare(experiment.varied({"solver.step": STEP, "time.output_step": PERIOD}))


def samples_of(run: PreparedRun, found: Driven) -> Samples:
    """Those of a simulated run."""
    q = len(run.channels)
    rows = [
        (t, some[0][1], [y for _, _, y, _ in some])
        for t, some in zip(found.events, found.samples, strict=True)
        if len(some) == q
    ]
    arrival, taken, y = zip(*rows, strict=True)
    return Samples(np.array(arrival), np.array(taken), np.array(y))


class Native:
    """The engine's loop with an observer alone, on the samples of a recording."""

    def __init__(self, run: PreparedRun, found: Driven) -> None:
        designs = list(run.experiment.designs.values())
        stretches, parameters = run.experiment.stretches, run.plant.everything
        truth = Recording(run.plant.symbolic)
        self.structure = structure_of([truth], [designs], stretches, run.schedule.variants, parameters)
        self.end = run.span
        self.p = parameter_values(parameters, stretches, designs)
        y: list[list[float]] = [[] for _ in run.channels]
        for i, _, value, _ in (one for some in found.samples for one in some):
            y[i].append(value)
        self.plan = build_plan(
            Timeline(schedule=run.schedule, channels=run.channels, grid=np.array([0.0, run.span]), reach=run.reach),
            self.structure.system,
            Stepping(longest=run.step),
            samples=[np.array(one) for one in y],
        )
        has_alpha = self.structure.system.has_alpha
        z0 = [one.initial(run.plant, has_alpha=has_alpha, recorded=run.recorded) for one in designs]
        self.start = Start(np.concatenate(z0)[:, None], self.p[:, None], bound=UNBOUNDED)
        self.program = self.structure.program("rk4")

    def __call__(self) -> np.ndarray:
        """The state at the ends."""
        return self.program.run(self.plan, self.start).rows[:, :, 0]

    def last(self) -> np.ndarray:
        """The estimate at the end."""
        return np.asarray(self.structure.estimates_along(np.array([0.0, self.end]), self.p, self()).of(0))[-1]


class InC:
    """Exported files in a library, driven in C."""

    def __init__(self, library: ctypes.CDLL, observer: Exported, samples: Samples) -> None:
        size = ctypes.c_ulong.in_dll(library, f"size_{observer.name}").value
        self.memory, self.xhat = ctypes.create_string_buffer(size), np.zeros(len(observer.states))
        self.arrays = [np.ascontiguousarray(one) for one in (samples.arrival, samples.taken, samples.y)]
        self.drive = getattr(library, f"drive_{observer.name}")
        self.drive.restype = None

    def __call__(self) -> np.ndarray:
        """The estimate at the end."""
        places = [ctypes.c_void_p(one.ctypes.data) for one in (*self.arrays, self.xhat)]
        self.drive(self.memory, ctypes.c_long(self.arrays[0].size), *places)
        return self.xhat


def library_of(folder: Path, observers: Sequence[Exported], flags: Sequence[str]) -> ctypes.CDLL:
    """All observers, compiled with what drives them."""
    files = {name: text for one in observers for name, text in c_files(one).items()}
    names = [one.name for one in observers]
    drivers = [DRIVER.format(name=o.name, outputs=len(o.outputs), all=f"HGO_{o.name.upper()}_ALL") for o in observers]
    files["drive.c"] = "\n".join([f'#include "{name}.h"' for name in names] + drivers)
    files["sizes.c"] = sizes(names)
    return ctypes.CDLL(str(compile_c(folder, files, *flags, "-Wno-missing-prototypes")))


def main() -> int:
    parser = argparse.ArgumentParser(description="time per step of exported C over that of the native engine")
    parser.add_argument("labels", nargs="*", metavar="NAME", help="of observers; default: all that are exported")
    parser.add_argument("--delay", type=float, default=0.0, help="how late samples are known (default 0)")
    parser.add_argument("--flags", default="-O2 -march=native", help="of the compiler (default -O2 -march=native)")
    parser.add_argument("--count", type=int, default=7, help="measurements of each (default 7)")
    options = parser.parse_args()
    runs: dict[str, tuple[PreparedRun, Exported]] = {}
    registered = [name for name in OBSERVERS.names() if OBSERVERS.find(name).__module__.startswith("hgorun.")]
    for name in options.labels or registered:  # without those of other benchmarks
        try:
            run = run_of(name, options.delay)
            runs[name] = run, exported(run)[0]
        except HgorunError as error:
            print(f"{name}: {str(error).splitlines()[0]:.110}")
    print(f"{'':<20}{'ns native':>10}{'ns C':>8}{'ratio':>7}  difference\n{'-' * 60}")
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        library = library_of(Path(folder), [one for _, one in runs.values()], options.flags.split())
        for name, (run, observer) in runs.items():
            found = driven(run)
            native, own = Native(run, found), InC(library, observer, samples_of(run, found))
            last = native.last()
            apart = np.max(np.abs(own() - last)) / np.max(np.abs(last))
            over, seconds = ratio(own, native, options.count)
            steps = native.plan.steps
            missed += over > BAR
            verdict = ("met" if over <= BAR else "MISSED") + ("" if apart < 1e-9 else ", BUT THE ESTIMATES DIFFER")
            times = f"{seconds / over / steps * 1e9:10.1f}{seconds / steps * 1e9:8.1f}"
            print(f"{name:<20}{times}{over:7.2f}  {apart:.0e}  {verdict}", flush=True)
    print(f"\n{missed} above the bar of {BAR:g}")
    return 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        os.environ.setdefault("HGORUN_CACHE_DIR", name)
        sys.exit(main())
