"""Ensembles beside plain C, one run after the other, and beside hand-interleaved C.

What is compared is the process's CPU time, so that other work on the machine counts less.
"""

from __future__ import annotations

import ctypes
import subprocess
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import academic
import casadi as ca
import numpy as np
import yaml

import hgorun
from hgorun import Experiment
from hgorun.engine.ensemble import Ensemble
from hgorun.engine.layout import HybridSystem
from hgorun.engine.member_numbers import MemberNumbers, Outcome
from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.members.members import Members
from hgorun.reproduce import shipped
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate

Block = dict[str, Any]
POINTER = ctypes.c_void_p

LORENZ: Block = {
    "time": {"end": 1, "output_step": 1},
    "plant": {
        "states": ["x", "y", "z"],
        "dynamics": {"x": "sigma*(y - x)", "y": "x*(rho - z) - y", "z": "x*y - beta*z"},
        "parameters": {"sigma": 10, "rho": 28, "beta": 8 / 3},
        "output": "x",
        "initial": {"x": 1, "y": 1, "z": 20},
    },
    "observers": {},
    "solver": {"method": "rk4", "step": 1e-3},
}


def academic_held() -> Experiment:
    """The academic example up to t = 4, with gaussian noise that is held."""
    config = yaml.safe_load(Path(academic.__file__).with_suffix(".yaml").read_text())
    config["time"] = {"end": 4, "output_step": 0.01}
    config["measurement"] = {"noise": [{"type": "gaussian", "std": 0.25, "hold": 0.01}]}
    return Experiment(config, name="academic")


def contois() -> Experiment:
    """The Contois bioreactor with four observers and a draw of gaussian noise a sample."""
    found = shipped.experiments()["robles2023/chapter3/contois_te025"]
    return hgorun.load(found).varied({"measurement.noise": [{"type": "gaussian", "std": 0.5}]})


def jittered() -> Experiment:
    """The same with samples that come at other times for every seed."""
    return contois().varied({"measurement.sampling.jitter": 0.1})


def controlled(method: str) -> Experiment:
    """The academic example with held noise, whose steps an error estimate controls."""
    return academic_held().varied({"solver": {"method": method, "rtol": 1e-8}})


def alone(base: Experiment, count: int) -> object:
    """So many seeds one after the other, each prepared, carried out and measured as a run of its own."""
    return [simulate(base.varied({"seed": seed})) for seed in range(count)]


def sweep(base: Experiment, count: int, threads: int = 1) -> object:
    """So many seeds, with all metrics."""
    return compute(base, Members.of({"seed": np.arange(count)}), threads=threads)


def built(folder: Path, name: str, source: Path, *options: str) -> ctypes.CDLL:
    """A C file as a shared library."""
    command = academic.compiler()
    assert command is not None
    library = folder / f"{name}.so"
    flags = ["-O3", "-march=native", "-shared", "-fPIC", *options]
    subprocess.run([command, *flags, "-o", library, source, "-lm"], check=True)
    return ctypes.CDLL(str(library))


class PlainC:
    """A run in C, from the tables that hgorun makes of it."""

    def __init__(self, run: PreparedRun, folder: Path, name: str) -> None:
        system = run.structure.system
        self.plan, self.start = plan_of(run, as_given(run))
        home = folder / name
        home.mkdir()
        (home / "functions.h").write_text(_functions(system, self.start.p, home))
        sizes = {"STATES": system.states, "HELD": system.held.size, "OUTPUTS": system.outputs, "WIDTH": system.width}
        options = [f"-D{key}={value}" for key, value in sizes.items()]
        self._run = built(home, name, Path(__file__).with_name("plain.c"), f"-I{home}", *options).run
        self._run.restype, self._run.argtypes = None, [ctypes.c_long, *[POINTER] * 13]
        alpha = np.array([*map(list, system.alpha)] or [[0]], dtype=np.int64)
        grid = np.append(self.plan.grid, np.inf)
        self._slots = np.zeros((self.plan.slots + 1, system.width))
        self._rows = np.zeros((grid.size + 1, system.states))
        self.last = np.zeros(system.states)
        plan = self.plan
        before = [plan.spans, plan.counts, plan.actions, plan.gain, plan.bias, plan.holds, alpha, self.start.p, grid]
        self._arrays = [np.ascontiguousarray(one) for one in [*before, self.start.z]]

    def __call__(self) -> None:
        places = [one.ctypes.data for one in (*self._arrays, self._slots, self._rows, self.last)]
        self._run(len(self.plan.counts), *places)


def _functions(system: HybridSystem, p: np.ndarray, folder: Path) -> str:
    """The right-hand side and the channels in C, with the parameters as literals that the compiler folds."""
    (regime,) = system.regimes
    code = ca.CodeGenerator("functions", {"with_header": False, "main": False})
    names = {}
    for name, function in (("FLOW", regime.flow), ("CHANNELS", system.channels)):
        names[name] = f"{name.lower()}_of"
        symbols = [ca.SX.sym("s", *function.size_in(i)) for i in range(4)]
        t, _, z, w = symbols
        code.add(ca.Function(names[name], symbols, [function(t, p, z, w)]))
    code.generate(f"{folder}/")
    text = (folder / "functions.c").read_text().replace("CASADI_SYMBOL_EXPORT int", "static inline int")
    return text + "".join(f"\n#define {name} {own}" for name, own in names.items())


class Lorenz:
    """Many starts of the Lorenz system, 1,000 steps, by hgorun and by hand-interleaved C."""

    def __init__(self, count: int, folder: Path) -> None:
        run = prepare(Experiment(LORENZ, name="lorenz"))
        self.plan, start = plan_of(run, as_given(run))
        z0 = start.z + np.random.default_rng(0).normal(size=(3, count))
        nothing = np.zeros(0)
        p = np.broadcast_to(start.p, (start.p.shape[0], count))
        self.members = MemberNumbers(z0=z0, p=p, gain=nothing, bias=nothing, holds=self.plan.holds)
        self.ensemble, self.z0, self.last = run.structure.ensemble("rk4"), z0, np.zeros((3, count))
        self._c = built(folder, "lorenz", Path(__file__).with_name("lorenz.c")).run
        double, long = ctypes.c_double, ctypes.c_long
        self._c.restype, self._c.argtypes = None, [long, long, double, POINTER, POINTER, double, double, double]

    def ours(self) -> np.ndarray:
        return self.ensemble.run(self.plan, self.members).last

    def theirs(self) -> np.ndarray:
        self._c(self.z0.shape[1], 1000, 1e-3, self.z0.ctypes.data, self.last.ctypes.data, 10.0, 28.0, 8 / 3)
        return self.last


def cpu(call: Callable[[], object]) -> float:
    """Seconds of CPU time of the process."""
    start = time.process_time()
    call()
    return time.process_time() - start


def ratio(ours: Callable[[], object], theirs: Callable[[], object], count: int, clock: Callable[..., float]) -> float:
    """Median of the ratios of neighbours in time."""
    ours(), theirs()
    return float(np.median([clock(ours) / clock(theirs) for _ in range(count)]))


CASES: Mapping[str, Callable[[], Experiment]] = {"academic": academic_held, "Contois": contois}


def plain(name: str, folder: Path) -> PlainC:
    """The C of a case; checked against hgorun."""
    run = prepare(CASES[name]())
    c = PlainC(run, folder, name)
    c()
    members = MemberNumbers(
        z0=c.start.z, p=c.start.p, gain=c.plan.gain, bias=c.plan.bias, holds=c.plan.holds, bound=c.start.bound
    )
    own = run.structure.ensemble("rk4").run(c.plan, members).last[:, 0]
    np.testing.assert_allclose(c.last, own, rtol=1e-6, atol=1e-8)
    return c


def per_member(name: str, members: int, count: int, folder: Path) -> float:
    """CPU time of a member of a sweep of seeds over that of the same in C."""
    base, c = CASES[name](), plain(name, folder)
    runs = max(round(0.02 / max(cpu(c), 1e-6)), 1)

    def theirs() -> None:
        for _ in range(runs):
            c()

    return ratio(partial(sweep, base, members), theirs, count, cpu) * runs / members


def python_beside_native(count: int) -> float:
    """Microseconds of Python a member, in a sweep of seeds of a short run."""
    base = academic_held().varied({"time.end": 0.1, "metrics": {"window": [0, 0.1], "transient": [0, 0.1]}})
    sweep(base, 64)
    native, run = 0.0, Ensemble.run

    def timed(self: Ensemble, *arguments: Any, **options: Any) -> Outcome:
        nonlocal native
        start = time.process_time()
        found = run(self, *arguments, **options)
        native += time.process_time() - start
        return found

    Ensemble.run = timed  # type: ignore[method-assign]  # for as long as it is timed
    try:
        whole = cpu(partial(sweep, base, count))
    finally:
        Ensemble.run = run  # type: ignore[method-assign]  # for as long as it is timed
    return (whole - native) / count * 1e6
