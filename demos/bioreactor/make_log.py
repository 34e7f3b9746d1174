"""Write online.csv, laboratory.csv and truth.csv: the log of the reactor in plant.yaml, with the faults of a plant.

    python demos/bioreactor/make_log.py [FOLDER]

hgorun simulates the reactor, its noise and the samples that are lost. Here the probe of the biomass sticks for some
hours, the logger is off for some others, and the laboratory loses three samples.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import hgorun

HERE = Path(__file__).parent
STUCK = (300.0, 314.0)  # h, when the probe goes on showing its last value
OFF = (420.0, 426.0)  # h, when nothing is recorded
LOST = (152.0, 320.0, 488.0)  # h, samples of which the laboratory has no value


def samples(result: hgorun.Result, output: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """When the samples of an output were taken and known, and their values; each of shape (N,)."""
    known, taken, y = result.measurements.time, result.measurements.taken[:, output], result.measurements.y[:, output]
    first = np.flatnonzero(np.isfinite(y) & np.concatenate([[True], np.diff(taken) != 0]))
    return taken[first], known[first], y[first]


def text(value: float, digits: int) -> str:
    """A cell: empty where there is no value."""
    return "" if np.isnan(value) else f"{value:.{digits}f}"


def online(result: hgorun.Result) -> list[str]:
    """Biomass and dilution rate every quarter of an hour, with the cell of the biomass empty where it was lost."""
    taken, _, y = samples(result, 0)
    recorded = dict(zip(taken, y, strict=True))  # times are multiples of 0.25 without a rounding error
    rows, shown = ["time_h,biomass_g_per_L,dilution_per_h"], np.nan
    for t, (rate,) in zip(result.time, result.u, strict=True):
        value = recorded.get(t, np.nan)
        if STUCK[0] <= t < STUCK[1]:
            value = shown
        elif not np.isnan(value):
            shown = value
        if not OFF[0] <= t < OFF[1]:
            rows.append(f"{t:.2f},{text(value, 2)},{rate:.4f}")
    return rows


def laboratory(result: hgorun.Result) -> list[str]:
    """A sample of the substrate a day, with the time when the laboratory answered."""
    rows = ["time_h,known_h,substrate_g_per_L"]
    for taken, known, y in zip(*samples(result, 1), strict=True):
        rows.append(f"{taken:g},{known:g},{text(np.nan if taken in LOST else y, 2)}")
    return rows


def truth(result: hgorun.Result) -> list[str]:
    """What no plant has: the states every two hours."""
    rows = (f"{t:g},{X:.4f},{S:.4f}" for t, (X, S) in list(zip(result.time, result.x, strict=True))[::8])
    return ["time_h,biomass_g_per_L,substrate_g_per_L", *rows]


def main(folder: Path) -> None:
    """Write the three files."""
    result = hgorun.simulate(hgorun.load(HERE / "plant.yaml"))
    for name, rows in (("online", online(result)), ("laboratory", laboratory(result)), ("truth", truth(result))):
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
