"""Every observer's time per step and state over that of ``shgo``, alone and in lanes.

    python tests/benchmarks/observers.py [NAME ...] [--method euler] [--members 256]

Each observer runs on the first of the plants that it takes, with the keys of its example, under each availability that
it takes; ``shgo`` runs on the same plant, under the same availability, with the same method and steps. What is compared
is the CPU time of the native loop of a run, plant and observer together, divided by steps and by states. The bar is 2;
``ukf``, ``mhe`` and ``kkl`` have none.

With a C compiler, what six powers a stage cost by nature: ``homogeneous`` over ``shgo`` in plain C (powers.c), one run
with the C library's ``pow``, and eight runs side by side with its vector functions, which are right to 4 ulp.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from academic import compiler
from sweep_cases import POINTER, built, cpu

from hgorun import Experiment
from hgorun.engine.member_numbers import MemberNumbers
from hgorun.errors import HgorunError
from hgorun.observers.base import OBSERVERS
from hgorun.observers.homogeneous import powers
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.simulate import prepare

Block = dict[str, Any]

REFERENCE, BAR, WITHOUT = "shgo", 2.0, ("ukf", "mhe", "kkl")
_PHI = "-x1 - 2*x2 + (1 - x1**2)*x2/2"
PLANTS: Mapping[str, Block] = {
    f"chain of {n}": {
        "type": "integrator_chain",
        "n": n,
        "phi": _PHI if n == 2 else f"{_PHI} - 2*x{n}",
        "initial": {f"x{i + 1}": 0.5 / (i + 1) for i in range(n)},
    }
    for n in (3, 2)
} | {
    "contois": {"type": "contois", "inputs": {"D": "0.3"}, "initial": {"x1": 1.5, "x2": 15.0}},
    "academic": {"type": "academic", "initial": {"x1": 1.0, "x2": 0.5, "x3": -0.5}},
    "linear": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1 - x2/2"},
        "output": "x1",
        "initial": {"x1": 0.5, "x2": 0.25},
    },
}
AVAILABILITIES: Mapping[str, Block] = {
    "continuous": {},
    "sampled": {"sampling": {"period": 0.05}},
    "late": {"delay": 0.02},
}
# beside the example of each: other ways of one observer that are computed in another way
WAYS: Mapping[str, Mapping[str, Block]] = {
    "levant": {"levant, implicit": {"discretisation": "implicit"}},
    "red": {"red, proper": {"discretisation": "proper"}, "red, explicit": {"discretisation": "explicit"}},
}
STEP, END = 2e-3, 4.0
_SHORTEST = 0.01  # seconds of one measurement


@dataclass(frozen=True)
class Timed:
    """A run and how to carry it out.

    Attributes
    ----------
    alone, beside : callable
        It, and so many of it side by side; both with the number of steps of a member for what they do.
    states : int
        Of plant and observer.
    """

    alone: Callable[[], object]
    beside: Callable[[], object]
    states: int
    steps: int


@cache
def timed(plant: str, availability: str, label: str, method: str, members: int) -> Timed | str:
    """An observer on a plant, or why it does not run there."""
    block = dict(blocks()[label])
    observer = OBSERVERS.find(block["type"])
    initial = PLANTS[plant]["initial"]
    try:
        example = dict(observer.example(tuple(initial))) | block
        config: Block = {
            "time": {"end": END, "output_step": END},
            "plant": PLANTS[plant],
            "measurement": AVAILABILITIES[availability],
            "observers": {"it": {**example, "initial": {name: 1.1 * x + 0.02 for name, x in initial.items()}}},
            "solver": {"method": method, "step": STEP},
        }
        run = prepare(Experiment(config, name="speed"))
    except HgorunError as error:
        return str(error)
    how = as_given(run)
    program, ensemble = run.structure.program(method), run.structure.ensemble(method)
    plan, start = plan_of(run, how)
    wide = np.ones((1, members))
    numbers = MemberNumbers(
        z0=start.z * wide, p=start.p * wide, gain=plan.gain, bias=plan.bias, holds=plan.holds, bound=start.bound
    )
    return Timed(
        lambda: program.run(plan, start),
        lambda: ensemble.run(plan, numbers),
        run.structure.system.states,
        plan.steps,
    )


def blocks() -> dict[str, Block]:
    """Label: block, of all that is measured."""
    found: dict[str, Block] = {}
    for name in OBSERVERS.names():
        found[name] = {"type": name}
        found |= {label: {"type": name, **keys} for label, keys in WAYS.get(name, {}).items()}
    return found


@dataclass(frozen=True)
class Row:
    """What was measured of an observer under an availability.

    Attributes
    ----------
    alone, beside : float
        Its time per step and state in units of the reference's, of one run and of runs side by side.
    nanoseconds : (float, float)
        Its time per step and state, likewise.
    """

    label: str
    plant: str
    availability: str
    alone: float
    beside: float
    nanoseconds: tuple[float, float]

    @property
    def met(self) -> bool | None:
        """None where there is no bar."""
        return None if self.label.split(",")[0] in WITHOUT else max(self.alone, self.beside) <= BAR


def rows(labels: Sequence[str], method: str, members: int, count: int) -> Iterator[Row]:
    """The rows of each label, one for each availability that it takes."""
    for label in labels:
        for availability in AVAILABILITIES:
            for plant in PLANTS:
                mine = timed(plant, availability, label, method, members)
                theirs = timed(plant, availability, REFERENCE, method, members)
                if isinstance(mine, Timed) and isinstance(theirs, Timed):
                    yield _measured(label, plant, availability, mine, theirs, members, count)
                    break


def by_nature(folder: Path, members: int, *flags: str) -> float:
    """``homogeneous`` over ``shgo`` in plain C, so many members side by side."""
    a, b = (powers(d, 3) for d in (-0.1, 0.1))
    gains, start = np.array([6.0, 12.0, 8.0]), np.array([0.5, 0.25, 0.17, 0.57, 0.3, 0.2])
    runs = []
    for kind in (1, 0):
        options = [f"-DMEMBERS={members}", f"-DPOWERS={kind}", "-fopenmp-simd", *flags]
        run = built(folder, f"powers{members}{kind}", Path(__file__).with_name("powers.c"), *options).run
        run.restype, run.argtypes = None, [ctypes.c_long, ctypes.c_double, *[POINTER] * 4]
        runs.append(partial(_in_c, run, (gains, a, b, np.repeat(start[:, None], members, axis=1))))
    return ratio(runs[0], runs[1], 7)[0]


def _in_c(run: Callable[..., None], arrays: Sequence[np.ndarray]) -> None:
    run(4000, 1e-4, *(one.ctypes.data for one in arrays))


def _measured(label: str, plant: str, availability: str, mine: Timed, theirs: Timed, members: int, count: int) -> Row:
    units = mine.steps * mine.states, theirs.steps * theirs.states
    alone, one = ratio(mine.alone, theirs.alone, count)
    beside, each = ratio(mine.beside, theirs.beside, count)
    scale = units[1] / units[0]
    nanoseconds = one / units[0] * 1e9, each / units[0] / members * 1e9
    return Row(label, plant, availability, alone * scale, beside * scale, nanoseconds)


def ratio(ours: Callable[[], object], theirs: Callable[[], object], count: int) -> tuple[float, float]:
    """Median of the ratios of neighbours in time, and seconds of ours; each repeated until it can be measured."""
    times = []
    repeated = []
    for call in (ours, theirs):
        call()
        repeated.append(max(round(_SHORTEST / max(cpu(call), 1e-6)), 1))
    for _ in range(count):
        pair = []
        for call, often in zip((ours, theirs), repeated, strict=True):
            pair.append(cpu(partial(several, call, often)) / often)
        times.append(pair)
    a, b = np.array(times).T
    return float(np.median(a / b)), float(np.median(a))


def several(call: Callable[[], object], often: int) -> None:
    for _ in range(often):
        call()


def line(row: Row) -> str:
    verdict = {True: "met", False: "MISSED", None: "no bar"}[row.met]
    alone, beside = row.nanoseconds
    return (
        f"{row.label:<22}{row.plant:<12}{row.availability:<12}{row.alone:7.2f}{row.beside:9.2f}"
        f"{alone:11.2f}{beside:9.2f}   {verdict}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="time per step and state of observers, over that of shgo")
    parser.add_argument("labels", nargs="*", metavar="NAME", help="of observers; default: all")
    parser.add_argument("--method", default="rk4", help="of integration, with fixed steps (default rk4)")
    parser.add_argument("--members", type=int, default=256, help="side by side (default 256)")
    parser.add_argument("--count", type=int, default=7, help="measurements of each (default 7)")
    options = parser.parse_args()
    labels = options.labels or list(blocks())
    head = f"{'':<22}{'plant':<12}{'outputs':<12}{'alone':>7}{'in lanes':>9}{'ns alone':>11}{'in lanes':>9}"
    print(f"over {REFERENCE}, per step and state; {options.method}; the bar is {BAR:g}\n\n{head}\n{'-' * 94}")
    missed, measured = 0, set()
    for row in rows(labels, options.method, options.members, options.count):
        print(line(row), flush=True)
        missed += row.met is False
        measured.add(row.label)
    print(f"\n{missed} above the bar")
    for label in set(labels) - measured:
        why = {
            str(timed(plant, one, label, options.method, options.members)) for plant in PLANTS for one in AVAILABILITIES
        }
        print(f"{label} runs on none of the plants: {'; '.join(sorted(why))}")
    if compiler() is not None:
        with tempfile.TemporaryDirectory() as folder:
            one, eight = by_nature(Path(folder), 1), by_nature(Path(folder), 8, "-Ofast", "-lmvec")
        print(f"homogeneous / shgo in plain C: {one:.1f} alone, {eight:.1f} in eight lanes")
    return 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        os.environ.setdefault("HGORUN_CACHE_DIR", name)
        sys.exit(main())
