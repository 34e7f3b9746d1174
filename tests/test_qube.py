"""A real rotary pendulum, recorded at 250 Hz: what observers say of a recording that nobody has tuned them on.

The recordings are not shipped; HGORUN_DATA names the folder that has them as qube/run1.csv and so on.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml
from shell import Shell

DEMO = Path(__file__).parents[1] / "demos" / "qube"
LOGS = Path(os.environ.get("HGORUN_DATA", "")) / "qube"

needs_recordings = pytest.mark.skipif(
    not (LOGS / "run1.csv").is_file(), reason="HGORUN_DATA names no folder with qube/run1.csv"
)


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


Scores = Mapping[str, Mapping[str, float]]  # by score, then by what it is of


def scores(shell: Shell, config: Path, log: Path, *options: str) -> Mapping[str, Scores]:
    """Of every observer."""
    code, out, _ = shell("estimate", str(config), str(log), *options, "--no-sensitivity", "--no-plots", "--json")
    assert code == 0
    observers = json.loads(out)["observers"]
    assert {one["status"] for one in observers.values()} == {"ok"}
    return {label: one["scores"] for label, one in observers.items()}


@needs_recordings
@pytest.mark.parametrize(("config", "period"), [("qube.yaml", 0.02), ("qube_25.yaml", 0.04)])
def test_a_recording_that_was_not_used(config: str, period: float, shell: Shell) -> None:
    """run5: the model and all gains are from run1 and run2, and the baselines are the best on run5 itself."""
    ours = scores(shell, DEMO / config, LOGS / "run5.csv")
    ekf = ours["EKF"]
    for angle in ("theta", "alpha"):
        plain = scores(shell, DEMO / f"{angle}.yaml", LOGS / "run5.csv", "--set", f"data.period={period}")
        held_out = [one["holdout_rmse"][angle] for one in (ekf, *plain.values())]
        velocity = f"{angle}_dot"
        savgol = min(one["reference_rmse"][velocity] for label, one in plain.items() if label.startswith("SG"))
        for own in (ours["SHGO"], ours["SHGO_S"], ours["FHGO2"], ours["IMP"]):
            assert own["holdout_rmse"][angle] < 1.05 * min(held_out)
            assert own["reference_rmse"][velocity] < 0.26 * savgol
            assert own["reference_rmse"][velocity] < 1.1 * ekf["reference_rmse"][velocity]
            assert 0.9 <= own["holdout_coverage"][angle] <= 1.0


@needs_recordings
def test_the_reference_lags_by_what_is_said() -> None:
    """The instrument's derivatives are v+ = 0.8 v + 0.2 difference/0.004 s, a time constant of 0.004/ln(1/0.8)."""
    rows = np.genfromtxt(LOGS / "run2.csv", delimiter=",", names=True)
    for angle in ("theta", "alpha"):
        v, y = rows[f"{angle}_dot"], np.unwrap(rows[angle])
        np.testing.assert_allclose(v[1:], 0.8 * v[:-1] + 50 * np.diff(y), rtol=0, atol=1e-6)
    block = yaml.safe_load((DEMO / "columns.yaml").read_text())
    lags = {one["lag"] for one in block["data"]["reference"].values()}
    assert lags == {round(0.004 / np.log(1 / 0.8), 4)}


def swinging(path: Path, omega_0: float, d: float, angle: float) -> None:
    """A log of a pendulum with an encoder of 4096 steps at 250 Hz and exact velocities, by Euler's method."""
    speed, rows, h = 0.0, [], 1e-4
    for i in range(40_001):
        if i % 40 == 0:
            rows.append(f"{i * h:.4f},{2 * np.pi / 4096 * round(angle / (2 * np.pi / 4096)):.9f},{speed:.9f}")
        speed += h * (-(omega_0**2) * np.sin(angle) - d * speed)
        angle += h * speed
    path.write_text("\n".join(["time,angle,velocity", *rows]) + "\n")


@pytest.mark.costly
def test_a_plain_pendulum_of_which_the_model_is_found(shell: Shell) -> None:
    for name, angle in (("one", 2.5), ("two", -1.5), ("left_out", 2.0)):
        swinging(shell.folder / f"{name}.csv", 6.3, 0.25, angle)
    sought = yaml.safe_load((DEMO / "pendulum.yaml").read_text())["tune"]["gains"]
    del sought["plant.parameters.b"]  # these pendula have no drag, and 60 runs are few
    options = ("--json", "--set", "tune.budget=60", "--set", f"tune.gains={json.dumps(sought)}")
    code, out, _ = shell("tune", str(DEMO / "pendulum.yaml"), "one.csv", "two.csv", *options)
    assert code == 0
    gains = json.loads(out)["observers"]["SHGO"]["gains"]
    assert gains["plant.parameters.omega_0"] == pytest.approx(6.3, rel=1e-2)
    found = scores(shell, shell.folder / "results" / "pendulum.tuned.yaml", shell.folder / "left_out.csv")
    baselines = [found[label]["holdout_rmse"]["angle"] for label in ("EKF", "spline", "SG")]
    assert found["SHGO"]["holdout_rmse"]["angle"] < 1.05 * min(baselines)
    velocities = {label: one["reference_rmse"]["speed"] for label, one in found.items()}
    assert velocities["SHGO"] < 0.26 * velocities["SG"]
