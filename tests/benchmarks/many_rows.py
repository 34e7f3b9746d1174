"""Runs with ten million rows beside what the rows cost anyway: ``python tests/benchmarks/many_rows.py``.

``simulate`` with many output points beside h5py, which writes arrays of the same sizes, without checksums; ``estimate``
of a CSV file beside ``pandas.read_csv`` of it. Everything is CPU time of processes of their own, in turns; what is
reported are medians of ratios, and the most memory that a process had. Of ``estimate`` wall times as well: it has
threads.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from bench import Row, at_most, table

SIMULATION = """
time: {{end: 100, output_step: {step!r}}}
plant: {{type: van_der_pol, initial: {{x1: 1, x2: 0}}}}
measurement: {{sampling: {{period: 0.1}}}}
observers: {{SHGO: {{type: shgo, theta: 3, poles: -1}}}}
"""
ESTIMATE = """
data: {file: log.csv, time: t, outputs: {a: a, b: b}, inputs: {u: {column: u, hold: zero}}}
plant: {states: [x1, x2, x3], dynamics: {x1: x2, x2: -x1 + u + x3, x3: "0"}, output: {a: x1, b: x2}}
observers: {SHGO: {type: shgo, theta: 3, poles: -1}}
"""
PLAIN = """
import sys, h5py, numpy
with h5py.File(sys.argv[1]) as made:
    shapes = {}
    made.visititems(lambda name, one: shapes.update({name: (one.shape, one.chunks)}) if hasattr(one, "shape") else None)
with h5py.File(sys.argv[2], "w") as file:
    for name, (shape, chunks) in shapes.items():
        if shape:  # long ones have no chunks
            data = file.create_dataset(name, shape=shape, chunks=chunks, dtype=float)
            count = chunks[0] if chunks else min(shape[0], 2**17)
            values = numpy.random.default_rng(0).random((count, *shape[1:]))
            for first in range(0, shape[0], count):
                data[first : first + count] = values[: shape[0] - first]
"""
READ = "import sys, pandas; pandas.read_csv(sys.argv[1])"
VERSION = "import pandas; print(pandas.__version__)"
PIECE = 100_000  # lines that are written at a time


def taken(command: Sequence[str | Path], folder: Path, python: str = sys.executable) -> tuple[float, float, int]:
    """CPU and wall seconds of a process, and the most bytes that it had.

    Python keeps what it compiles, as it does for users: without that a process takes a second longer.
    """
    kept = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(folder / "compiled")}
    line, before = [python, *map(str, command)], time.perf_counter()
    with subprocess.Popen(line, cwd=folder, stdout=subprocess.DEVNULL, env=kept) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}: exit code {process.returncode}")
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - before, 1024 * usage.ru_maxrss


def compared(
    ours: Callable[[], tuple[float, float, int]], theirs: Callable[[], tuple[float, float, int]], count: int
) -> tuple[list[float], list[float], int]:
    """Of CPU and of wall time: medians of both, and of their ratios; and the memory of ours."""
    pairs, memory = [], 0
    for _ in range(count):
        *own, memory = ours()
        pairs.append((own, theirs()[:2]))
    a, b = np.moveaxis(np.array(pairs), 1, 0)
    cpu, wall = np.median([a, b, a / b], axis=1).T.tolist()
    return cpu, wall, memory


def write_log(path: Path, count: int) -> None:
    """Two outputs with noise, and an input."""
    drawn = np.random.default_rng(1)
    with path.open("w") as file:
        file.write("t,a,b,u\n")
        for first in range(0, count, PIECE):
            t = 1e-3 * np.arange(first, min(first + PIECE, count))
            noise = 0.01 * drawn.standard_normal((2, t.size))
            columns = [t, np.sin(t) + noise[0], np.cos(t) + noise[1], 0.1 * np.sin(3 * t)]
            rows = np.column_stack(columns).tolist()
            file.write("".join("{:.3f},{:.5f},{:.5f},{:.5f}\n".format(*row) for row in rows))


def simulated(points: int, count: int, folder: Path) -> Iterator[Row]:
    """``simulate`` with so many output points."""
    (folder / "run.yaml").write_text(SIMULATION.format(step=100 / points))
    command = ["-m", "hgorun", "simulate", "run.yaml", "-o", "run.h5", "--quiet"]
    taken(command, folder)  # what is compiled is kept
    (a, b, ratio), _, memory = compared(
        lambda: taken(command, folder), lambda: taken(["-c", PLAIN, "run.h5", "plain.h5"], folder), count
    )
    size = (folder / "run.h5").stat().st_size
    yield at_most(f"simulate with {points:.0e} output points", a, 2.0, "whole process", " s")
    yield Row("the same / what it writes, written by h5py", f"{ratio:.2f}", note=f"{a:.1f} s / {b:.1f} s; to compare")
    yield Row(
        "its memory / its file", f"{memory / size:.2f}", note=f"{memory / 2**20:.0f} MiB / {size / 2**20:.0f} MiB"
    )


def estimated(rows: int, count: int, folder: Path, python: str) -> Iterator[Row]:
    """``estimate`` of a CSV file with so many rows, beside the pandas of a Python."""
    (folder / "log.yaml").write_text(ESTIMATE)
    write_log(folder / "log.csv", rows)
    command = ["-m", "hgorun", "estimate", "log.yaml", "-o", "log.h5", "--quiet", "--no-plots"]
    taken(command, folder)
    (a, b, ratio), wall, memory = compared(
        lambda: taken(command, folder), lambda: taken(["-c", READ, "log.csv"], folder, python), count
    )
    size = (folder / "log.csv").stat().st_size
    found = subprocess.run([python, "-c", VERSION], check=True, capture_output=True, text=True).stdout.strip()
    name = f"estimate / read_csv of pandas {found}"
    yield Row(f"{name}, CPU time", f"{ratio:.2f}", note=f"{a:.1f} s / {b:.1f} s, whole processes")
    yield at_most(f"{name}, wall time", wall[2], 2.0, f"{wall[0]:.1f} s / {wall[1]:.1f} s")
    yield at_most("its memory / the CSV file", memory / size, 3.0, f"{memory / 2**20:.0f} MiB / {size / 2**20:.0f} MiB")


def main() -> None:
    parser = argparse.ArgumentParser(description="many rows beside what they cost anyway")
    parser.add_argument("--rows", type=float, default=1e7, help="of each (default 1e7)")
    parser.add_argument("--pairs", type=int, default=3, help="of measurements (default 3)")
    parser.add_argument(
        "--pandas", default=sys.executable, metavar="PYTHON", help="that has the pandas to compare with"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder, rows = Path(name), int(options.rows)
        print(table([*simulated(rows, options.pairs, folder), *estimated(rows, options.pairs, folder, options.pandas)]))


if __name__ == "__main__":
    main()
