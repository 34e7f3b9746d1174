"""``rodas5p`` beside LSODA with a compiled right-hand side: ``python tests/benchmarks/stiff.py ARCHIVE``.

LSODA is the C++ one in the source archive of numbalsoda, compiled here with -O3. Its right-hand sides are hgorun's own,
written in C by CasADi; from sample to sample it is driven by C, too. Both are run with many tolerances, LSODA with
several absolute ones; what is compared is the least CPU time that reaches an accuracy. The error is the largest
difference at the output points to scipy's Radau, or to its DOP853 where there are observers, whose error has the
rounding of a difference; each state counts relative to its largest value.
"""

from __future__ import annotations

import argparse
import ctypes
import itertools
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from hgorun.engine.memory import Tolerance
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun

BAR = 1.5
ACCURACIES = (1e-3, 1e-5, 1e-7)
REPEATS = 20
Solve = Callable[[], np.ndarray]


def plant(dynamics: dict[str, str], initial: list[float], end: float, **more: Any) -> dict[str, Any]:
    states = list(dynamics)
    return {
        "time": {"end": end, "output_step": end / 40},
        "plant": {
            "states": states,
            "dynamics": dynamics,
            "output": states[0],
            "initial": dict(zip(states, initial, strict=True)),
        },
        "observers": {},
    } | more


ROBERTSON = {"a": "-0.04*a + 1e4*b*c", "b": "0.04*a - 1e4*b*c - 3e7*b**2", "c": "3e7*b**2"}
OREGONATOR = {
    "a": "77.27*(b + a*(1 - 8.375e-6*a - b))",
    "b": "(c - (1 + a)*b)/77.27",
    "c": "0.161*(a - c)",
}
HIRES = {
    "y1": "-1.71*y1 + 0.43*y2 + 8.32*y3 + 0.0007",
    "y2": "1.71*y1 - 8.75*y2",
    "y3": "-10.03*y3 + 0.43*y4 + 0.035*y5",
    "y4": "8.32*y2 + 1.71*y3 - 1.12*y4",
    "y5": "-1.745*y5 + 0.43*y6 + 0.43*y7",
    "y6": "-280*y6*y8 + 0.69*y4 + 1.71*y5 - 0.43*y6 + 0.69*y7",
    "y7": "280*y6*y8 - 1.81*y7",
    "y8": "-280*y6*y8 + 1.81*y7",
}
SERVO = {"x1": "x2", "x2": "x3 - x2 - sin(x1)", "x3": "1000*(sin(t) - x1 - x2 - x3)"}


def van_der_pol(mu: float) -> dict[str, Any]:
    return plant({"x": "v", "v": f"{mu!r}*(1 - x**2)*v - x"}, [2, 0], 2 * mu)


def high_gain(theta: float, end: float = 10.0, **more: Any) -> dict[str, Any]:
    """A calm, driven oscillator with a standard high-gain observer; an explicit method must reach the end, too."""
    dynamics = {"x1": "x2", "x2": "(1 - x1**2)*x2 - x1 + 0.3*sin(2*t)"}
    return plant(
        dynamics,
        [1, 0.5],
        end,
        observers={"S": {"type": "shgo", "theta": theta, "initial": {"x1": 0, "x2": 0}}},
        **more,
    )


PROBLEMS: dict[str, dict[str, Any]] = {
    "Robertson to 4e4": plant(ROBERTSON, [1, 0, 0], 4e4),
    "Robertson to 4e11": plant(ROBERTSON, [1, 0, 0], 4e11),
    "van der Pol, mu = 1e3": van_der_pol(1e3),
    "van der Pol, mu = 1e5": van_der_pol(1e5),
    "Oregonator": plant(OREGONATOR, [1, 2, 3], 360.0),
    "HIRES": plant(HIRES, [1, 0, 0, 0, 0, 0, 0, 0.0057], 321.8122),
    "theta = 1e5": high_gain(1e5, 0.05),
    "theta = 10, sampled": high_gain(10.0, measurement={"sampling": {"period": 0.25}}),
    "stiff plant, four observers": plant(
        SERVO, [1, 0, 0], 20.0, observers={f"S{i}": {"type": "shgo", "theta": 2.0 + i} for i in range(4)}
    ),
}


class Case:
    """A problem as hgorun, LSODA and Radau solve it."""

    def __init__(self, config: dict[str, Any], folder: Path, lsoda: Path) -> None:
        self.run = prepare(Experiment(config | {"solver": {"method": "rodas5p", "rtol": 1e-6}}))
        system = self.run.structure.system
        self.program = self.run.structure.program("rodas5p", adaptive=True)
        self.plan, self.start = plan_of(self.run, as_given(self.run))
        self.p, self.z0 = self.run.numbers.p, self.run.numbers.z0
        self.flow, self.sample = system.regimes[-1].flow, sampling(self.run)
        self.held = system.held.size
        samples = self.run.channels[0].samples.arrival
        self.times = np.unique(np.concatenate([self.run.grid, samples]))
        self.sampled = np.isin(self.times, samples)
        self.shown = np.isin(self.times, self.run.grid)
        self.native = compiled(self.flow, self.sample, folder, lsoda)
        self.truth = self.reference()
        self.scale = np.maximum(np.abs(self.truth).max(axis=0), 1e-300)
        self.watched = self.watched_states()

    def watched_states(self) -> np.ndarray:
        """All but what is counted anew at every sample."""
        counted = {i for row in self.run.structure.system.alpha for i in row}
        return np.array([i for i in range(self.z0.size) if i not in counted])

    def error(self, rows: np.ndarray) -> float:
        gap = (np.abs(rows - self.truth) / self.scale)[:, self.watched]
        return float(gap.max()) if np.all(np.isfinite(gap)) else np.inf

    def rodas(self, rtol: float) -> np.ndarray:
        span = self.run.time.end - self.run.time.start
        tolerance = Tolerance(rtol, None, span, 1e-4 * span)
        return self.program.run(self.plan, self.start, tolerance).rows[:, :, 0]

    def lsoda(self, rtol: float, part: float) -> np.ndarray:
        rows = np.full(self.truth.shape, np.nan)
        self.native(
            self.z0.size, self.held, self.p, self.z0.copy(), self.times.size, self.times,
            self.sampled, self.shown, rows, rtol, part * rtol,
        )  # fmt: skip
        return rows

    def reference(self) -> np.ndarray:
        slope = ca.Function(
            "slope", self.flow.sx_in(), [ca.densify(ca.jacobian(self.flow(*self.flow.sx_in()), self.flow.sx_in()[2]))]
        )
        z, w, rows = self.z0.copy(), np.zeros(self.held), []
        atol = 1e-12 if self.run.observers else 1e-16  # an observer's error is a difference, and has its rounding
        for i, t in enumerate(self.times):
            if i:

                def rate(t: float, z: np.ndarray, w: np.ndarray = w) -> np.ndarray:
                    return np.array(self.flow(t, self.p, z, w)).ravel()

                def jacobian(t: float, z: np.ndarray, w: np.ndarray = w) -> np.ndarray:
                    return np.array(slope(t, self.p, z, w))

                if self.run.observers:
                    z = solve_ivp(rate, self.times[i - 1 : i + 1], z, "DOP853", rtol=1e-11, atol=atol).y[:, -1]
                else:
                    options = {"jac": jacobian, "rtol": 1e-10, "atol": atol}
                    z = solve_ivp(rate, self.times[i - 1 : i + 1], z, "Radau", **options).y[:, -1]
            if self.sampled[i]:
                z, w = (np.array(one).ravel() for one in self.sample(t, self.p, z, w))
            if self.shown[i]:
                rows.append(z)
        return np.array(rows)


def sampling(run: PreparedRun) -> ca.Function:
    """What becomes of z and w at a sample without delay and noise: alpha is counted from zero again."""
    system = run.structure.system
    t, p, z, w = system.regimes[-1].flow.sx_in()
    channels = system.channels(t, p, z, w)
    z_new, w_new = ca.SX(z), ca.SX(w)
    for output in range(system.outputs):
        w_new[system.held.output(output)] = channels[output * system.width]
        for observer in range(system.observers):
            alpha = system.alpha[output][observer] if system.has_alpha else None
            back = z[alpha] if alpha is not None else 0
            w_new[system.held.s(output, observer)] = channels[output * system.width + 1 + observer] + back
            if alpha is not None:
                z_new[alpha] = 0
    return ca.Function("sample", [t, p, z, w], [ca.densify(z_new), ca.densify(w_new)])


def compiled(flow: ca.Function, sample: ca.Function, folder: Path, lsoda: Path) -> Any:
    """The C++ driver with these right-hand sides."""
    here = Path(tempfile.mkdtemp(dir=folder))
    names = []
    for function, name in ((flow, "flow"), (sample, "sample")):
        code = ca.CodeGenerator(f"{name}.c", {"prefix": f"{name}_"})
        code.add(ca.Function(name, function.sx_in(), function.call(function.sx_in())))
        code.generate(f"{here}{os.sep}")
        names.append(str(here / f"{name}.c"))
    objects = []
    for source in names:
        objects.append(f"{source}.o")
        subprocess.run(
            [os.environ.get("CC", "gcc"), "-O3", "-march=native", "-fPIC", "-c", source, "-o", objects[-1]], check=True
        )
    library = here / "drive.so"
    driver = Path(__file__).with_suffix(".cpp")
    common = [
        os.environ.get("CXX", "g++"),
        "-O3",
        "-march=native",
        "-std=c++17",
        "-w",
        "-fPIC",
        "-shared",
        f"-I{lsoda}",
    ]
    subprocess.run([*common, str(driver), str(lsoda / "LSODA.cpp"), *objects, "-o", str(library)], check=True)
    array = np.ctypeslib.ndpointer(dtype=float, flags="C")
    flags = np.ctypeslib.ndpointer(dtype=bool, flags="C")
    drive = ctypes.CDLL(str(library)).drive
    drive.argtypes = [
        ctypes.c_int, ctypes.c_int, array, array, ctypes.c_int, array, flags, flags, array, ctypes.c_double,
        ctypes.c_double,
    ]  # fmt: skip
    return drive


def seconds(solve: Solve) -> float:
    """The least CPU time of several."""
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        solve()
        found.append(time.process_time() - start)
    return min(found)


def cheapest(settings: Iterator[Solve], case: Case) -> dict[float, float]:
    """For each accuracy the least time that reaches it."""
    best = dict.fromkeys(ACCURACIES, np.inf)
    for solve in settings:
        error = case.error(solve())
        if error <= max(ACCURACIES):
            took = seconds(solve)
            for accuracy in ACCURACIES:
                if error <= accuracy:
                    best[accuracy] = min(best[accuracy], took)
    return best


def table(folder: Path, lsoda: Path, names: list[str]) -> None:
    print(f"CPU time of rodas5p over LSODA's at equal accuracy, bar {BAR:g}; in brackets ms of both")
    print(f"{'':30}" + "".join(f"{accuracy:>26.0e}" for accuracy in ACCURACIES))
    for name in names:
        case = Case(PROBLEMS[name], folder, lsoda)
        tolerances = [10.0 ** (-k / 2) for k in range(4, 23)]
        ours = cheapest((partial(case.rodas, r) for r in tolerances), case)
        parts = itertools.product(tolerances, (1e-2, 1e-4, 1e-7))
        theirs = cheapest((partial(case.lsoda, r, part) for r, part in parts), case)
        cells = [
            f"{ours[a] / theirs[a]:.2f} ({ours[a] * 1e3:.3f}, {theirs[a] * 1e3:.3f})"
            if np.isfinite(theirs[a])
            else f"LSODA: not reached ({ours[a] * 1e3:.3f})"
            for a in ACCURACIES
        ]
        print(f"{name:30}" + "".join(f"{cell:>26}" for cell in cells), flush=True)


def sources(given: Path, folder: Path) -> Path:
    """The folder of LSODA.cpp, out of numbalsoda's archive where that is given."""
    if given.is_dir():
        return next(given.rglob("LSODA.cpp")).parent
    with tarfile.open(given) as archive:
        archive.extractall(folder, filter="data")
    return next(folder.rglob("LSODA.cpp")).parent


def main() -> int:
    parser = argparse.ArgumentParser(description="rodas5p beside LSODA")
    parser.add_argument("lsoda", type=Path, help="numbalsoda's source: its archive, or a folder")
    parser.add_argument("--only", nargs="+", choices=list(PROBLEMS), default=list(PROBLEMS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        table(folder, sources(options.lsoda, folder), options.only)
    return 0


if __name__ == "__main__":
    sys.exit(main())
