"""The table of the simulated pendula: model and gains from the first two logs of each, errors on the third.

    python demos/qube/pendula.py logs
    python demos/qube/compare_pendula.py logs [NAME ...]

The searches are those of pendulum.yaml and of the command in its comment; where theta T of SHGO is below 0.3, T the
period, SHGO has Butterworth poles instead, and FHGO II those at -1. Splines and Savitzky-Golay filters know no
model, and are those that do best on the third log itself. Errors of angles are in mrad, of velocities in rad/s; the
other columns are ratios, of angles to the best baseline, of velocities to the first of the two Kalman filters.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml
from compare import HERE, best, hgorun, scores
from pendula import PENDULA, Pendulum

SLOW = 0.3  # theta T of SHGO: below it noise is so large that a correction takes many samples
OURS = ("SHGO", "FHGO1", "FHGO2", "IMP")
GAINS = {
    "gains": {"observers.*.theta": {"log": [0.1, 300]}},
    "minimise": "holdout_rmse(*, angle)",
    "seeds": 1,
    "budget": 30,
}
Block = dict[str, Any]


def noise(one: Pendulum) -> float:
    """Standard deviation of the angle; an encoder rounds."""
    return float(f"{one.noise or 2 * math.pi / one.encoder / math.sqrt(12):.2g}")


def model(one: Pendulum) -> Block:
    """pendulum.yaml, with what is known of a pendulum: the noise of its angle, and a torque if there is one."""
    found: Block = yaml.safe_load((HERE / "pendulum.yaml").read_text())
    found["data"]["outputs"]["angle"]["std"] = noise(one)
    if one.torque:
        found["plant"]["dynamics"]["speed"] += " + torque"
        found["plant"]["inputs"] = {"torque": 0}
        found["data"]["inputs"] = {"torque": {"column": "torque", "hold": "zero"}}
    return found


def observers(std: float) -> Block:
    """Those that pendulum.yaml does not have; the last one trusts its start."""
    return {
        "FHGO1": {"type": "fhgo1", "theta": 40, "delta": 12},
        "FHGO2": {"type": "fhgo2", "theta": 40, "r": 1, "poles": [-0.35, "-3+3j", "-3-3j"]},
        "FHGO2_B": {"type": "fhgo2", "theta": 40, "r": 1, "poles": -1},
        "EKF_trusts": {"type": "ekf", "theta": 55, "internal": {"P": [[std**2 / 9, 0], [0, 4 * std**2]]}},
    }


def plain(std: float) -> Block:
    """The observers of theta.yaml and some that smooth more, of the angle."""
    found: Block = yaml.safe_load((HERE / "theta.yaml").read_text())
    found["data"]["outputs"] = {"theta": {"column": "angle", "std": std}}
    found["data"]["reference"] = {"theta_dot": {"column": "velocity"}}
    for window in range(8, 21, 3):
        for degree in (1, 2, 3):
            found["observers"][f"SG {degree} of {window}"] = {"type": "savgol", "degree": degree, "window": window}
    for smoothing in (1e-5, 1e-4, 1e-3):
        found["observers"][f"spline {smoothing:.0e}"] = {"type": "spline", "smoothing": smoothing}
    return found


def written(path: Path, block: Mapping[str, object]) -> Path:
    path.write_text(yaml.safe_dump(dict(block), sort_keys=False))
    return path


def row(name: str, logs: Path, folder: Path, period: float, parameters: Mapping[str, float]) -> str:
    """The line of a pendulum at a rate."""
    one, std = PENDULA[name], noise(PENDULA[name])
    block = model(one)
    block["plant"]["parameters"] |= parameters
    block["data"]["period"] = period
    block["observers"] |= observers(std)
    block["tune"] = GAINS
    config = written(folder / "gains.yaml", block)
    found: Any = hgorun("tune", config, logs / f"{name}0.csv", logs / f"{name}1.csv", "-o", folder)["observers"]
    slow = period * found["SHGO"]["gains"]["observers.SHGO.theta"] < SLOW
    angles, velocities = scores(folder / "gains.tuned.yaml", logs / f"{name}2.csv", folder, period)
    theirs = scores(written(folder / "plain.yaml", plain(std)), logs / f"{name}2.csv", folder, period)
    baselines = [angles[label]["angle"] for label in ("EKF", "EKF_trusts")]
    angle = min(*baselines, *(best(theirs[0], kind, "theta") for kind in ("SG", "spline")))
    filters = [velocities[label]["speed"] for label in ("EKF", "EKF_trusts")]
    chosen = [f"{label}_B" if slow and label in ("SHGO", "FHGO2") else label for label in OURS]
    cells = [name, f"{1 / period:.0f} Hz", f"{1e3 * angle:.2f}", *(f"{one:.3g}" for one in filters)]
    cells += ["Butterworth" if slow else "-0.65, -1.55"]
    cells += [f"{angles[label]['angle'] / angle:.3f}" for label in chosen]
    cells += [f"{velocities[label]['speed'] / filters[0]:.2f}" for label in chosen]
    largest = max(velocities[label]["speed"] for label in chosen)
    return f"| {' | '.join(cells)} | {largest / best(theirs[1], 'SG', 'theta_dot'):.2f} |"


def lines(name: str, logs: Path, folder: Path) -> Iterator[str]:
    config = written(folder / "model.yaml", model(PENDULA[name]))
    found: Any = hgorun("tune", config, logs / f"{name}0.csv", logs / f"{name}1.csv", "-o", folder)["observers"]
    gains = found["SHGO"]["gains"]
    parameters = {key.rpartition(".")[2]: value for key, value in gains.items() if key.startswith("plant.")}
    for period in (0.02, 0.04):
        yield row(name, logs, folder, period, parameters)


def main() -> None:
    names = sys.argv[2:] or list(PENDULA)
    if len(sys.argv) < 2 or not PENDULA.keys() >= set(names):
        raise SystemExit(f"{__doc__}\nThere are {', '.join(PENDULA)}.")
    head = ["pendulum", "rate", "angle", "EKF", "EKF that trusts", "poles of SHGO"]
    head += [f"{label}: {what}" for what in ("angle", "velocity") for label in OURS]
    print(f"| {' | '.join(head)} | largest/SG |\n|{'---|' * (len(head) + 1)}")
    for name in names:
        with TemporaryDirectory() as folder:
            for line in lines(name, Path(sys.argv[1]), Path(folder)):
                print(line, flush=True)


if __name__ == "__main__":
    main()
