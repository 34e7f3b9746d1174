"""docs/qube.md says of its tables what stands in them, and its pendula move as pendula do."""

from __future__ import annotations

import importlib
import re
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "qube.md").read_text(encoding="utf-8")
OURS = ("SHGO", "FHGO I", "FHGO II", "impulsive")


def table(first: str) -> list[dict[str, str]]:
    """The rows of the table whose head begins with a word, by the words of its head."""
    lines = PAGE.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"| {first} |"))
    head, _, *cells = (
        line.strip("| ").split(" | ") for line in takewhile(lambda line: line.startswith("|"), lines[start:])
    )
    return [dict(zip(head, row, strict=True)) for row in cells]


def worst(rows: list[dict[str, str]], column: str) -> float:
    return max(float(row[column]) for row in rows)


def test_ratios_are_those_of_the_errors() -> None:
    rows = table("left out")
    assert len(rows) == 3 * 2 * 4
    for row in rows:
        digits = 0.005 if row["error of"].startswith("angle") else 0.00005
        for label in OURS:
            ratio = float(row[label]) / float(row["EKF"])
            assert float(row[f"{label}/EKF"]) == pytest.approx(ratio, abs=2.2 * digits / float(row["EKF"]) + 0.0005)
        largest = max(float(row[label]) for label in OURS) / float(row["Savitzky-Golay (SG)"])
        assert float(row["largest/SG"]) == pytest.approx(largest, abs=0.006)


def test_what_is_said_of_the_machine() -> None:
    """Of each observer the largest ratio of an angle and of a velocity, in the sentence below the table."""
    rows = table("left out")
    angles, velocities = ([row for row in rows if row["error of"].startswith(kind)] for kind in ("angle", "velocity"))
    said = re.findall(r"`?([\w ]+?)`? (\d\.\d{3}) and (\d\.\d{3})", PAGE.replace("\n", " "))
    assert {label.removeprefix("of ").strip() for label, *_ in said} >= set(OURS)
    for label, angle, velocity in said:
        assert float(angle) == worst(angles, f"{label}/EKF")
        assert float(velocity) == worst(velocities, f"{label}/EKF")
    assert worst(rows, "largest/SG") <= 0.26
    for label in ("SHGO", "FHGO II", "impulsive"):
        assert worst(angles, f"{label}/EKF") <= 1.05
        assert worst(velocities, f"{label}/EKF") <= 1.1


def test_what_is_said_of_the_simulated_pendula() -> None:
    rows = table("pendulum")
    pendula = {"coulomb", "noisy", "driven", "small", "drag", "windy"}
    assert {row["pendulum"].removesuffix(" *") for row in rows} == pendula
    for label in ("SHGO", "impulsive"):
        assert worst(rows, f"{label}: angle") <= 1.05
        assert worst(rows, f"{label}: velocity") <= 1.1
    said = re.search(
        r"of `SHGO` are ([\d.]+) in an angle and ([\d.]+) in a velocity, those of `impulsive` ([\d.]+) and ([\d.]+);",
        PAGE,
    )
    assert said is not None
    columns = ("SHGO: angle", "SHGO: velocity", "impulsive: angle", "impulsive: velocity")
    assert [float(one) for one in said.groups()] == [worst(rows, column) for column in columns]
    for label, least in (("SHGO", 1.085), ("impulsive", 1.025)):
        trusting = [
            float(row[f"{label}: velocity"]) * float(row["EKF"]) / float(row["EKF that trusts"]) for row in rows
        ]
        assert max(trusting) <= least
    assert worst(rows, "largest/SG") <= 0.26


def test_what_is_said_of_poles_that_follow_from_theta() -> None:
    """The damping is that of the rule, with the digits of theta T that are shown, and the bounds hold for all."""
    rows = table("third log of")
    for row in rows:
        x = float(row["theta T"])
        zeta = min(1.8, max(min((1 + x / 2) / 2**0.5, 1.1), x / 2))
        assert float(row["zeta"]) == pytest.approx(zeta, abs=0.008)
    assert worst(rows, "angle") <= 1.05
    assert worst(rows, "velocity") <= 1.1


def test_a_simulated_pendulum_loses_what_friction_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a small angle Coulomb's friction takes 2 c/omega^2 every half period; then it rests."""
    monkeypatch.syspath_prepend(str(ROOT / "demos" / "qube"))
    pendula = importlib.import_module("pendula")
    monkeypatch.setattr(pendula, "END", 2.0)
    one = pendula.Pendulum(5.0, 0.0, (), c=0.1, noise=0.0, encoder=10**7, jitter=0.0)
    one.log(tmp_path / "log.csv", (0.02, 0.0), seed=0)
    log = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)
    half = np.pi / 5
    assert np.interp(half, log["time"], log["angle"]) == pytest.approx(-(0.02 - 2 * 0.1 / 25), abs=2e-5)
    assert np.interp(2 * half, log["time"], log["angle"]) == pytest.approx(0.02 - 4 * 0.1 / 25, abs=1e-4)
    assert log["velocity"][-1] == 0.0  # 0.004 is what friction holds
