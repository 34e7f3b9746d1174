"""The commands of docs/qube.md, as they are printed there.

Those on the recordings need HGORUN_DATA, the folder that has them as qube/run1.csv and so on; they are not shipped.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from shell import Shell

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "qube.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    ((?:hgorun|python) .*)$", PAGE, re.MULTILINE)
RECORDED = [one for one in COMMANDS if "$HGORUN_DATA" in one]
SIMULATED = [one for one in COMMANDS if "$HGORUN_DATA" not in one]

Scores = Mapping[str, Mapping[str, Mapping[str, float]]]  # by observer, score and what it is of

needs_recordings = pytest.mark.skipif(
    not (Path(os.environ.get("HGORUN_DATA", "")) / "qube" / "run1.csv").is_file(),
    reason="HGORUN_DATA names no folder with qube/run1.csv",
)


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "demos").symlink_to(ROOT / "demos")
    return Shell(tmp_path, monkeypatch, capsys)


def carried_out(command: str, shell: Shell) -> Scores:
    """What an estimate is worth, or nothing."""
    program, *words = shlex.split(os.path.expandvars(command))
    if program == "python":
        subprocess.run([sys.executable, *words], cwd=shell.folder, check=True)
        return {}
    code, out, err = shell(*words, "--json")
    assert code == 0, err
    return {label: one.get("scores", {}) for label, one in json.loads(out)["observers"].items()}


def test_there_are_the_commands_that_are_run() -> None:
    assert (len(RECORDED), len(SIMULATED)) == (4, 4)


@pytest.mark.slow
def test_the_simulated_pendulum(shell: Shell) -> None:
    """Noise of 0.03 rad: theta T of SHGO is below 0.3, and the page says to take SHGO_B."""
    *before, last = SIMULATED
    for command in before:
        carried_out(command, shell)
    (theta,) = re.findall(
        r"SHGO: \{type: shgo, theta: ([\d.]+)", (shell.folder / "results" / "pendulum.tuned.tuned.yaml").read_text()
    )
    assert float(theta) * 0.02 < 0.3
    found = carried_out(last, shell)
    angles = {label: one["holdout_rmse"]["angle"] for label, one in found.items()}
    velocities = {label: one["reference_rmse"]["speed"] for label, one in found.items()}
    for own in ("SHGO_B", "SHGO_S"):
        assert angles[own] < 1.05 * min(angles[label] for label in ("EKF", "spline", "SG"))
        assert velocities[own] < min(1.1 * velocities["EKF"], 0.26 * velocities["SG"])


@pytest.mark.slow
@needs_recordings
def test_the_recordings(shell: Shell) -> None:
    """run5, with the gains that stand in qube.yaml."""
    found = [carried_out(command, shell) for command in RECORDED]
    ours, plain = found[2:]
    for score, of, least in (("holdout_rmse", "alpha", 1.05), ("reference_rmse", "alpha_dot", 0.26)):
        assert ours["SHGO"][score][of] < least * min(one[score][of] for one in plain.values())
