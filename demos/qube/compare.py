"""Every recording in turn is left out: model and gains are found on the others, and the scores are those on it.

    python demos/qube/compare.py FOLDER

FOLDER has run1.csv, run2.csv and run5.csv of the rotary pendulum. Baselines that know no model, in alpha.yaml and
theta.yaml, are those that do best on the recording that was left out. The noise densities of EKF are found as the gains
of the others, those of "EKF that knows" on the recording that was left out, from the very error of the row. Errors of
angles are in mrad, of velocities in rad/s.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

HERE = Path(__file__).resolve().parent
RUNS = ("run1.csv", "run2.csv", "run5.csv")
ANGLES = ("theta", "alpha")
CONFIGS = {0.02: "qube.yaml", 0.04: "qube_25.yaml"}  # by period
OBSERVERS = ("SHGO", "SHGO_S", "FHGO1", "FHGO2", "IMP", "EKF")
Scores = Mapping[str, Mapping[str, float]]  # by observer, then by what they are of


def hgorun(*arguments: str | Path) -> dict[str, object]:
    """What a command prints with ``--json``."""
    command = [sys.executable, "-m", "hgorun", *map(str, arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    found: dict[str, object] = json.loads(done.stdout)
    return found


def identified(folder: Path, logs: Sequence[Path]) -> dict[str, float]:
    """The parameters of the plant that some recordings speak for."""
    found = hgorun("tune", HERE / "model.yaml", *logs, "-o", folder)["observers"]
    assert isinstance(found, dict)
    gains = found["SHGO"]["gains"]
    return {key.rpartition(".")[2]: value for key, value in gains.items() if key.startswith("plant.")}


def tuned(folder: Path, base: str, parameters: Mapping[str, float], logs: Sequence[Path]) -> Path:
    """A configuration with the gains that some recordings speak for."""
    config = folder / base
    config.write_text(yaml.safe_dump({"extends": str(HERE / base), "plant": {"parameters": dict(parameters)}}))
    hgorun("tune", config, *logs, "-o", folder)
    return folder / f"{config.stem}.tuned.yaml"


def scores(config: Path, log: Path, folder: Path, period: float) -> tuple[Scores, Scores]:
    """Of every observer the errors of the angles that it was not given, and those of the velocities."""
    options = ("--set", f"data.period={period}", "--no-sensitivity", "--no-plots", "-o", folder / "found.h5")
    observers = hgorun("estimate", config, log, *options)["observers"]
    assert isinstance(observers, dict)
    held_out = {label: one["scores"]["holdout_rmse"] for label, one in observers.items()}
    velocity = {label: one["scores"]["reference_rmse"] for label, one in observers.items()}
    return held_out, velocity


def answered(folder: Path, parameters: Mapping[str, float], log: Path, period: float, score: str, name: str) -> float:
    """The error of a Kalman filter whose noise densities are tuned on this error itself."""
    base = yaml.safe_load((HERE / "qube.yaml").read_text())
    block = {
        "extends": str(HERE / "rig.yaml"),
        "title": "A Kalman filter that knows the answer",
        "plant": {"parameters": dict(parameters)},
        "data": {"period": period},
        "observers": {"EKF": base["observers"]["EKF"]},
        "tune": {
            "gains": {f"observers.EKF.Q.{angle}_dot": {"log": [1e-3, 100]} for angle in ANGLES},
            "minimise": f"{score}(EKF, {name})",
            "seeds": 1,
            "budget": 60,
        },
    }
    config = folder / "answered.yaml"
    config.write_text(yaml.safe_dump(block))
    hgorun("tune", config, log, "-o", folder)
    held_out, velocity = scores(folder / "answered.tuned.yaml", log, folder, period)
    return (held_out if score == "holdout_rmse" else velocity)["EKF"][name]


def best(of: Scores, kind: str, name: str) -> float:
    """The smallest error of the observers of a kind."""
    return min(one[name] for label, one in of.items() if label.startswith(kind))


def lines(logs: Path, run: str, folder: Path) -> Iterator[str]:
    """The rows of the table for a recording that is left out."""
    others = [logs / other for other in RUNS if other != run]
    parameters = identified(folder, others)
    for period, base in CONFIGS.items():
        config = tuned(folder, base, parameters, others)
        held_out, velocity = scores(config, logs / run, folder, period)
        for angle in ANGLES:
            plain = scores(HERE / f"{angle}.yaml", logs / run, folder, period)
            for what, score, ours, theirs, name in (
                ("angle", "holdout_rmse", held_out, plain[0], angle),
                ("velocity", "reference_rmse", velocity, plain[1], f"{angle}_dot"),
            ):
                own = [ours[label][name] for label in OBSERVERS]
                known = answered(folder, parameters, logs / run, period, score, name)
                spline, savgol = best(theirs, "spline", name), best(theirs, "SG", name)
                cells = [run.removesuffix(".csv"), f"{1 / period:.0f} Hz", f"{what} {angle}"]
                errors = (*own, known, spline, savgol)
                cells += [f"{1e3 * error:.2f}" if what == "angle" else f"{error:.4f}" for error in errors]
                *observers, ekf = own
                cells += [f"{one / ekf:.3f}" for one in observers] + [f"{observers[1] / known:.3f}"]
                cells += [f"{max(observers) / savgol:.2f}"]
                yield f"| {' | '.join(cells)} |"


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    ratios = [f"{label}/EKF" for label in OBSERVERS[:-1]]
    head = ["left out", "rate", "error of", *OBSERVERS, "EKF that knows", "spline", "SG", *ratios]
    head += ["SHGO_S/EKF that knows", "largest/SG"]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for run in RUNS:
        with TemporaryDirectory() as folder:
            for line in lines(Path(sys.argv[1]), run, Path(folder)):
                print(line, flush=True)


if __name__ == "__main__":
    main()
