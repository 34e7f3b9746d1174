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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import academic
import llvmlite.binding as llvm
import numpy as np

from hgorun import shipped

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


def pairs(
    first: Callable[[], object], second: Callable[[], object], count: int
) -> tuple[float, float, float]:
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


def require_agreement(what: str, found: np.ndarray, expected: np.ndarray) -> float:
    """Largest relative difference of two final states."""
    gap = float(np.max(np.abs(found - expected) / np.maximum(np.abs(expected), 1e-3)))
    if not gap <= AGREEMENT:
        raise WrongNumbers(f"{what}: the final states differ by {gap:.2g}, more than {AGREEMENT:g}")
    return gap


def single_run(count: int, folder: Path) -> Iterator[Row]:
    """One run, and runs side by side, against the same in C; one run against scipy."""
    system, plan = academic.build(), academic.plan()
    run = academic.native(system)
    lanes = 8 if "+avx512f" in llvm.get_host_cpu_features().flatten().split(",") else 4
    together = academic.native(system, lanes=lanes)
    alone = run(plan)[:, :, 0]
    if not all(np.array_equal(together(plan)[:, :, lane], alone) for lane in range(lanes)):
        raise WrongNumbers(f"a run beside {lanes - 1} others has other bits than alone")
    if academic.compiler() is None:
        yield Row("one run / C", "skipped", "<= 0.6", None, "no C compiler here")
    else:
        plain = academic.compiled(folder)
        separate = academic.compiled(folder, "-ffp-contract=off")
        gap = require_agreement("hgorun and C", alone[-1], plain(plan, system.z0)[-1])
        require_agreement("hgorun and C", alone[-1], separate(plan, system.z0)[-1])
        a, b, ratio = pairs(lambda: run(plan), lambda: plain(plan, system.z0), count)
        yield at_most("one run / C", ratio, 0.6, f"{a * 1e3:.1f} ms / {b * 1e3:.1f} ms; agreement {gap:.1g}")
        a, b, ratio = pairs(lambda: run(plan), lambda: separate(plan, system.z0), count)
        note = f"{a * 1e3:.1f} ms / {b * 1e3:.1f} ms; for information"
        yield Row("one run / C without contraction", f"{ratio:.2f}", note=note)
        a, b, ratio = pairs(lambda: together(plan), lambda: plain(plan, system.z0), count)
        bar = 0.15 if lanes == 8 else 0.25
        note = f"{a / lanes * 1e3:.2f} ms / {b * 1e3:.1f} ms; same bits as alone"
        yield at_most(f"{lanes} runs side by side, each / C", ratio / lanes, bar, note)
    yield against_scipy(system, run, max(count // 2, 7))


def against_scipy(system: academic.System, run: academic.Run, count: int) -> Row:
    from scipy.integrate import solve_ivp

    steps = round(PART / academic.END * academic.STEPS)
    part, fine = academic.plan(PART, steps, 10), academic.plan(PART, 16 * steps, 10)
    whole, truth = academic.plan(), run(fine)[:, :, 0]

    def error(z: np.ndarray) -> float:
        return float(np.max(np.abs(z - truth) / np.max(np.abs(truth), axis=0)))

    def solve() -> np.ndarray:
        span, options = (0.0, PART), {"method": "RK45", "rtol": TOLERANCE, "atol": TOLERANCE}
        return solve_ivp(academic.python_flow, span, system.z0, t_eval=part.grid, **options).y.T

    ours, theirs = error(run(part)[:, :, 0]), error(solve())
    if not (ours <= 1e-6 and theirs <= 1e-6):
        raise WrongNumbers(f"integration errors {ours:.1g} (hgorun) and {theirs:.1g} (scipy) are above 1e-6")
    scipy_time, own_time, ratio = pairs(solve, lambda: run(whole), count)
    ratio *= academic.END / PART
    note = (
        f"RK45 {scipy_time:.2f} s for {PART:g} s of {academic.END:g}, scaled up / {own_time * 1e3:.1f} ms; "
        f"errors {theirs:.0e}, {ours:.0e}"
    )
    return Row("solve_ivp / one run", f"{ratio:.0f}", ">= 1000", ratio >= 1000, note)


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
        command = [program, "simulate", str(config), "-o", str(folder / "results"), "--quiet"]
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
    note = f"{a * 1e3:.0f} ms / {b * 1e3:.0f} ms"
    yield at_most("hgorun --help / import typer", ratio, 2.0, note)


def checked(command: list[str | Path], environment: dict[str, str] | None = None) -> None:
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
    count = max(parser.parse_args().pairs, 7)
    machine = f"{platform.system()} {platform.machine()}, {llvm.get_host_cpu_name()}, {os.cpu_count()} cores"
    print(f"Python {platform.python_version()}, {machine}; medians of {count} measurements", flush=True)
    rows, failures = [], []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        os.environ["HGORUN_CACHE_DIR"] = str(Path(name) / "own")
        for part in (single_run, command_line):
            try:
                for row in part(count, Path(name)):
                    rows.append(row)
            except (WrongNumbers, subprocess.CalledProcessError) as error:
                failures.append(str(error))
    print(table(rows))
    for failure in failures:
        print(f"failed: {failure}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
