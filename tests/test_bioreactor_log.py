"""The log of demos/bioreactor is what its script writes, and gives what docs/bioreactor_log.md says of it."""

from __future__ import annotations

import json
import re
import runpy
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from shell import Shell

from hgorun.result.reading import read
from hgorun.result.result import Result

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "demos" / "bioreactor"
PAGE = (ROOT / "docs" / "bioreactor_log.md").read_text(encoding="utf-8")
ONLINE, RIGHT, LABORATORY = re.findall(r"^    hgorun (estimate .*)$", PAGE, re.MULTILINE)
TRUTH = np.genfromtxt(FOLDER / "truth.csv", delimiter=",", names=True)
SETTLED = TRUTH[TRUTH["time_h"] >= 24]
STUCK = (TRUTH["time_h"] >= 300) & (TRUTH["time_h"] <= 314)


def table(head: str) -> dict[str, list[float]]:
    """The rows of the table whose header has this text, by their first cell."""
    lines = PAGE.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("|") and head in line) + 2
    rows = {}
    for line in lines[start:]:
        if not line.startswith("|"):
            break
        label, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        rows[label.strip("`")] = [float(cell.removesuffix(" %")) for cell in cells]
    return rows


def truth_in_band(found: Result, label: str) -> tuple[float, float]:
    """Which part of the true substrate is in the band, in percent, and the band's mean half width."""
    assessed, k = found.observers[label].assessed, found.states.index("S")
    assert assessed is not None
    lower, upper = (np.interp(SETTLED["time_h"], found.time, b[:, k]) for b in (assessed.lower, assessed.upper))
    inside = (lower <= SETTLED["substrate_g_per_L"]) & (upper >= SETTLED["substrate_g_per_L"])
    return 100 * float(np.mean(inside)), float(np.mean(upper - lower)) / 2


def error(found: Result, label: str) -> float:
    """Of the substrate against the truth, root mean square."""
    S = np.interp(SETTLED["time_h"], found.time, found.observers[label].xhat[:, found.states.index("S")])
    return float(np.sqrt(np.mean((S - SETTLED["substrate_g_per_L"]) ** 2)))


def worst_biomass(found: Result, label: str) -> float:
    """The largest error of the biomass while the probe sticks."""
    X = np.interp(TRUTH["time_h"], found.time, found.observers[label].xhat[:, found.states.index("X")])
    return float(np.max(np.abs(X - TRUTH["biomass_g_per_L"])[STUCK]))


def score(found: Result, label: str, name: str) -> float:
    assessed = found.observers[label].assessed
    assert assessed is not None
    value = assessed.scores[name]["S"]
    assert value is not None
    return value


Estimate = Callable[..., tuple[Result, str]]


@pytest.fixture
def estimate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Estimate:
    shell = Shell(tmp_path, monkeypatch, capsys)
    (tmp_path / "demos").symlink_to(ROOT / "demos", target_is_directory=True)

    def run(command: str, *more: str) -> tuple[Result, str]:
        code, _, err = shell(*shlex.split(command), "--no-sensitivity", "--no-plots", "-o", "log.h5", *more)
        found = read(tmp_path / "log.h5")
        assert (code, found.status) == (0, "ok")
        return found, err

    return run


def test_the_script_writes_the_files_byte_for_byte(tmp_path: Path) -> None:
    runpy.run_path(str(FOLDER / "make_log.py"))["main"](tmp_path)
    for name in ("online", "laboratory", "truth"):
        assert (tmp_path / f"{name}.csv").read_bytes() == (FOLDER / f"{name}.csv").read_bytes(), name


def test_substrate_from_biomass(estimate: Estimate) -> None:
    found, err = estimate(ONLINE)
    for line in re.findall(r"^demos/bioreactor/online.csv:.*$", PAGE, re.MULTILINE):
        assert line in err
    for label, (holdout, mean, rms, width, inside) in table("band, to either side").items():
        errors = [score(found, label, "holdout_rmse"), score(found, label, "holdout_mean"), error(found, label)]
        assert errors == pytest.approx([holdout, mean, rms], abs=0.006)
        assert truth_in_band(found, label)[0] == pytest.approx(inside, abs=0.6)
        assert truth_in_band(found, label)[1] == pytest.approx(width, abs=0.006)
    nis = found.observers["EKF"].assessed
    assert nis is not None
    assert f"{nis.scores['nis']['X']:.2f}" in PAGE
    legend = {text.get_text() for legend in found.plot().legends for text in legend.get_texts()}
    assert {"held out", "reference"} <= legend


@pytest.mark.costly
def test_the_right_kinetics(estimate: Estimate) -> None:
    found, _ = estimate(RIGHT)
    for label, (holdout, rms, inside) in table("with the right kinetics | hold-out").items():
        assert [score(found, label, "holdout_rmse"), error(found, label)] == pytest.approx([holdout, rms], abs=0.006)
        assert truth_in_band(found, label)[0] == pytest.approx(inside, abs=0.6)


@pytest.mark.costly
def test_the_stuck_sensor(estimate: Estimate) -> None:
    report = ("--set", "data.faults.stuck=report")
    runs = [estimate(command, *more)[0] for command in (ONLINE, RIGHT) for more in ((), report)]
    for label, errors in table("`stuck: drop`").items():
        assert [worst_biomass(found, label) for found in runs] == pytest.approx(errors, abs=0.006)


@pytest.mark.costly
def test_with_the_laboratory_samples(estimate: Estimate) -> None:
    found, err = estimate(LABORATORY)
    assert re.findall(r"^demos/bioreactor/laboratory.csv:.*$", PAGE, re.MULTILINE)[0] in err
    for label, (rms, inside) in table("error of substrate against the truth").items():
        assert error(found, label) == pytest.approx(rms, abs=0.006)
        assert truth_in_band(found, label)[0] == pytest.approx(inside, abs=0.6)
        K = found.observers[label].xhat[found.time > 100, found.states.index("K")]
        assert np.all(np.abs(K - 2.2) < 0.3)


@pytest.mark.costly
def test_samples_that_correct_the_substrate_alone_are_forgotten(estimate: Estimate) -> None:
    plant = yaml.safe_load((FOLDER / "online.yaml").read_text(encoding="utf-8"))["plant"] | {"output": ["X", "S"]}
    changes = [f"plant={json.dumps(plant)}"]
    for label in ("EKF", "EKF_blind"):
        changes += [f"observers.{label}.Q={{X: 0.003, S: 0.02}}", f"observers.{label}.initial={{X: 8.2, S: 4}}"]
    found, _ = estimate(LABORATORY, *(part for change in changes for part in ("--set", change)))
    assert "of 0.79 g/L with the samples and without them" in PAGE
    assert [error(found, label) for label in found.observers] == pytest.approx([0.79, 0.79], abs=0.006)
