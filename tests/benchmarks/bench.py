"""hgorun's speed beside its bars: ``make bench``, or ``python tests/benchmarks/bench.py``.

Everything is measured side by side: A B, B A, A B, ... after a warm-up, and what is reported is the median of
the ratios of such pairs, so that a machine that slows down for a while slows both. A bar that is missed is
reported and no more: machines differ. The exit code is 1 when something computes wrong numbers or fails.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import academic
import llvmlite.binding as llvm
import numpy as np
import single
import sweep_cases

from hgorun.native.compiler import vector_doubles
from hgorun.reproduce import shipped

CONTOIS = "robles2023/chapter3/contois_te025"
AGREEMENT = 1e-9  # of the final state, relative: hgorun and C round in different places
# scipy covers one second of the forty, with the tolerance at which its error is that of the 80,000 RK4 steps
PART, TOLERANCE = 1.0, 3e-9


@dataclass(frozen=True)
class Row:
    """One line of the table; ``met`` is None where there is no bar or nothing was measured."""

    what: str
    measured: str
    bar: str = ""
    met: bool | None = None
    note: str = ""


class WrongNumbers(Exception):
    """A result that is not what it has to be."""


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def pairs(first: Callable[[], object], second: Callable[[], object], count: int) -> tuple[float, float, float]:
    """Median of the times of both, and of the ratios first/second of neighbours in time."""
    first(), second()
    times = []
    for i in range(count):
        if i % 2:
            late, early = seconds(second), seconds(first)
            times.append((early, late))
        else:
            times.append((seconds(first), seconds(second)))
    a, b = np.array(times).T
    return float(np.median(a)), float(np.median(b)), float(np.median(a / b))


def at_most(what: str, ratio: float, bar: float, note: str, unit: str = "") -> Row:
    return Row(what, f"{ratio:.2f}{unit}", f"<= {bar:g}{unit}", ratio <= bar, note)


def milliseconds(a: float, b: float) -> str:
    return f"{a * 1e3:.1f} ms / {b * 1e3:.1f} ms"


class Case:
    """The academic example in hgorun, in C where there is a compiler, and in scipy; their numbers agree."""

    def __init__(self, folder: Path) -> None:
        self.prepared, self.plan = academic.build(), academic.plan()
        self.run = academic.native(self.prepared)
        self.lanes = 8 if "+avx512f" in llvm.get_host_cpu_features().flatten().split(",") else 4
        self.together = academic.native(self.prepared, lanes=self.lanes)
        alone, beside = self.run(self.plan)[:, :, 0], self.together(self.plan)
        if not all(np.array_equal(beside[:, :, lane], alone) for lane in range(self.lanes)):
            raise WrongNumbers(f"a run beside {self.lanes - 1} others has other bits than alone")
        self.c: list[Callable[[], np.ndarray]] = []
        self.gap = 0.0
        for flags in ([], ["-ffp-contract=off"]) if academic.compiler() else ():
            call = academic.compiled(folder, *flags)
            self.c.append(partial(call, self.plan, self.prepared.numbers.z0))
            self.gap = max(self.gap, gap(alone[-1], self.c[-1]()[-1]))
        steps = round(PART / academic.END * academic.STEPS)
        self.part, fine = academic.plan(PART, steps, 10), academic.plan(PART, 16 * steps, 10)
        self.truth = self.run(fine)[:, :, 0]
        self.errors = [self.error(self.solved()), self.error(self.run(self.part)[:, :, 0])]
        if not max(self.errors) <= 1e-6:
            raise WrongNumbers(f"the errors of scipy and hgorun, {self.errors}, are not below 1e-6")

    def solved(self) -> np.ndarray:
        from scipy.integrate import solve_ivp

        options = {"method": "RK45", "rtol": TOLERANCE, "atol": TOLERANCE, "t_eval": self.part.grid}
        return solve_ivp(academic.python_flow, (0.0, PART), self.prepared.numbers.z0, **options).y.T

    def error(self, z: np.ndarray) -> float:
        return float(np.max(np.abs(z - self.truth) / np.max(np.abs(self.truth), axis=0)))


def gap(found: np.ndarray, expected: np.ndarray, agreement: float = AGREEMENT) -> float:
    """Largest relative difference of two final states."""
    largest = float(np.max(np.abs(found - expected) / np.maximum(np.abs(expected), 1e-3)))
    if not largest <= agreement:
        raise WrongNumbers(f"the final states of hgorun and C differ by {largest:.2g}, not below {agreement:g}")
    return largest


def runs(count: int, folder: Path) -> Iterator[Row]:
    """One run, and runs side by side, against the same in C; one run against scipy."""
    case = Case(folder)

    def run() -> object:
        return case.run(case.plan)

    if not case.c:
        yield Row("one run / C", "skipped", "<= 0.44", None, "no C compiler here")
    else:
        plain, separate = case.c
        a, b, ratio = pairs(run, plain, count)
        yield at_most("one run / C", ratio, 0.44, f"{milliseconds(a, b)}; they agree to {case.gap:.0e}")
        a, b, ratio = pairs(run, separate, count)
        yield Row("one run / C without contraction", f"{ratio:.2f}", note=f"{milliseconds(a, b)}; to compare")
        a, b, ratio = pairs(lambda: case.together(case.plan), plain, count)
        what, bar = f"{case.lanes} runs side by side, each / C", 0.15 if case.lanes == 8 else 0.25
        yield at_most(what, ratio / case.lanes, bar, f"{milliseconds(a / case.lanes, b)}; the bits of one alone")
    a, b, ratio = pairs(case.solved, run, max(count // 2, 7))
    ratio *= academic.END / PART
    theirs, ours = case.errors
    note = f"RK45 {a:.2f} s for {PART:g} s of {academic.END:g}, scaled up / {b * 1e3:.1f} ms"
    note += f"; errors {theirs:.0e}, {ours:.0e}"
    yield Row("solve_ivp / one run", f"{ratio:.0f}", ">= 1000", ratio >= 1000, note)


def single_runs(count: int, folder: Path) -> Iterator[Row]:
    """One run of other systems against plain C."""
    if academic.compiler() is None:
        yield Row("one run of other systems / C", "skipped", note="no C compiler here")
        return
    for case, ours, theirs in single.compared(folder):
        agreed = gap(ours(), theirs(), case.agreement)
        ratio = sweep_cases.ratio(ours, theirs, count, sweep_cases.cpu)
        yield at_most(f"{case.name}, one run / C", ratio, case.bar, f"CPU time; they agree to {agreed:.0e}")


def sweeps(count: int, folder: Path) -> Iterator[Row]:
    """Whole sweeps with their metrics, a member of them against plain C; the engine against hand-interleaved C."""
    if academic.compiler() is None:
        yield Row("sweeps / C", "skipped", note="no C compiler here")
        return
    wide = vector_doubles() == 8
    few = max(count // 5, 3)
    for name, bar in (("academic", 0.1 if wide else 0.25), ("Contois", 0.25)):
        measured = sweep_cases.per_member(name, 1000 if name == "academic" else 500, few, folder)
        yield at_most(f"sweep of seeds, {name}, a member / C", measured, bar, "with all metrics; CPU time")
    if (os.cpu_count() or 1) > 1:
        base = sweep_cases.CASES["Contois"]()
        one, two = (partial(sweep_cases.sweep, base, 500, threads) for threads in (1, 2))
        yield at_most("the same on two cores / on one", sweep_cases.ratio(two, one, few, seconds), 0.55, "elapsed time")
    base, other = sweep_cases.CASES["Contois"](), sweep_cases.jittered()
    jitter = sweep_cases.ratio(
        partial(sweep_cases.sweep, other, 256), partial(sweep_cases.sweep, base, 256), few, sweep_cases.cpu
    )
    yield at_most("jittered samples / periodic ones", jitter, 2.0, "sweeps of seeds, Contois; CPU time")
    for method in ("dopri5", "rodas5p"):
        base = sweep_cases.controlled(method)
        each = sweep_cases.ratio(
            partial(sweep_cases.sweep, base, 256), partial(sweep_cases.alone, base, 32), few, sweep_cases.cpu
        )
        note = "academic, seeds; alone with its preparation and trajectories; CPU time"
        yield Row(f"controlled steps ({method}), a member of a sweep / alone", f"{each * 32 / 256:.2f}", note=note)
    if wide:
        lorenz = sweep_cases.Lorenz(131_072, folder)
        gap(lorenz.ours(), lorenz.theirs())
        ratio = sweep_cases.ratio(lorenz.ours, lorenz.theirs, few, sweep_cases.cpu)
        yield at_most("Lorenz, 131,072 final states / interleaved C", ratio, 2.0, "4 x 8 lanes by hand; CPU time")
    python = sweep_cases.python_beside_native(20_000)
    yield at_most("Python beside the native loop, a member", python, 5.0, "sweep of 20,000 seeds", " us")


def command_line(count: int, folder: Path) -> Iterator[Row]:
    """Whole processes, from the command to its end."""
    program = Path(sys.executable).parent / ("hgorun.exe" if os.name == "nt" else "hgorun")
    if not program.exists():
        yield Row("hgorun, whole process", "skipped", note=f"no {program.name} beside this Python")
        return
    config = shipped.experiments().get(CONTOIS)
    if config is None:
        raise WrongNumbers(f"the experiment {CONTOIS} is missing")
    cache = folder / "cache"

    def simulate() -> None:
        environment = {**os.environ, "HGORUN_CACHE_DIR": str(cache)}
        command: list[str | Path] = [program, "simulate", str(config), "-o", str(folder / "results"), "--quiet"]
        checked(command, environment)

    def emptied() -> None:
        for file in cache.glob("*"):
            file.unlink()

    simulate()  # the byte code of the imports is written now, and not while measuring
    if not any((folder / "results").glob("*.h5")):
        raise WrongNumbers("hgorun simulate wrote no .h5 file")
    cold, warm = [], []
    for _ in range(count):
        emptied()
        cold.append(seconds(simulate))
        warm.append(seconds(simulate))
    name = f"hgorun simulate {Path(CONTOIS).name}"
    yield at_most(f"{name}, empty cache", float(np.median(cold)), 1.5, "whole process", " s")
    yield at_most(f"{name}, filled cache", float(np.median(warm)), 1.0, "whole process", " s")
    typer = [sys.executable, "-c", "import typer"]
    a, b, ratio = pairs(lambda: checked([program, "--help"]), lambda: checked(typer), max(count, 9))
    yield at_most("hgorun --help / import typer", ratio, 2.0, milliseconds(a, b))


def checked(command: Sequence[str | Path], environment: dict[str, str] | None = None) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise WrongNumbers(f"{' '.join(map(str, command))} failed: {said[-1] if said else done.returncode}")


def table(rows: list[Row]) -> str:
    verdict = {True: "met", False: "MISSED", None: ""}
    cells = [("", "measured", "bar", "", "")]
    cells += [(r.what, r.measured, r.bar, verdict[r.met], r.note) for r in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(5)]
    lines = [
        f"{a:<{widths[0]}}  {b:>{widths[1]}}  {c:>{widths[2]}}  {d:<{widths[3]}}  {e}".rstrip()
        for a, b, c, d, e in cells
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])


def main() -> int:
    parser = argparse.ArgumentParser(description="hgorun's speed beside its bars")
    parser.add_argument("--pairs", type=int, default=15, help="of each kind, at least 7 (default 15)")
    parser.add_argument("--check", action="store_true", help="compare the numbers only, measure nothing")
    options = parser.parse_args()
    count = max(options.pairs, 7)
    rows, failures = [], []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        os.environ["HGORUN_CACHE_DIR"] = str(folder / "own")
        if options.check:
            Case(folder)
            for case, ours, theirs in single.compared(folder) if academic.compiler() else ():
                gap(ours(), theirs(), case.agreement)
            for name in sweep_cases.CASES if academic.compiler() else ():
                sweep_cases.plain(name, folder)
            return 0
        machine = f"{platform.system()} {platform.machine()}, {llvm.get_host_cpu_name()}, {os.cpu_count()} cores"
        print(f"Python {platform.python_version()}, {machine}; medians of {count} measurements", flush=True)
        for part in (runs, single_runs, sweeps, command_line):
            try:
                for row in part(count, folder):
                    rows.append(row)
            except (WrongNumbers, subprocess.CalledProcessError) as error:
                failures.append(str(error))
    print(table(rows))
    for failure in failures:
        print(f"failed: {failure}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
