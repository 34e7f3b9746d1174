"""The example of a real fermentation gives what docs/fermentation.md says of it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from shell import Shell

from hgorun.result.reading import read

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "demos" / "fermentation"
PAGE = (ROOT / "docs" / "fermentation.md").read_text(encoding="utf-8")

PLACES = np.arange(23)
SETS = [PLACES[1::2], PLACES[::2], PLACES[::3], PLACES[1::3], PLACES[2::3], PLACES[:8], PLACES[8:16], PLACES[16:]]


def test_ethanol_from_glucose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = re.findall(r"^    hgorun estimate (.*)$", PAGE, re.MULTILINE)[0]
    arguments = command.replace("demos/fermentation", str(FOLDER)).split()
    shell = Shell(tmp_path, monkeypatch, capsys)
    code, out, _ = shell("estimate", *arguments, "--no-sensitivity", "--no-plots", "-o", "f.h5")
    assert code == 0
    assert "holdout_rmse E" in out
    found = read(tmp_path / "f.h5")
    assert found.status == "ok"
    table = [float(cell) for cell in re.findall(r"^\| hold-out error.*\|$", PAGE, re.MULTILINE)[0].split("|")[2:-1]]
    errors = {}
    for label, one in found.observers.items():
        assert one.assessed is not None
        errors[label] = one.assessed.scores["holdout_rmse"]["E"]
        k = found.states.index("E")
        aside = found.recorded.held_out["E"] if found.recorded else None
        assert aside is not None
        inside = [np.interp(aside.taken, found.time, band[:, k]) for band in (one.assessed.lower, one.assessed.upper)]
        assert np.mean((inside[0] <= aside.y) & (aside.y <= inside[1])) > 0.85
        assert one.assessed.no_band == {"v": "nothing measures this state", "X": "nothing measures this state"} or (
            label == "KB" and not one.assessed.no_band
        )
    assert errors["KR"] == pytest.approx(table[3], abs=0.01)  # theta = 8
    assert errors["KB"] == pytest.approx(1.17, abs=0.01)


@pytest.mark.costly
def test_ethanol_between_laboratory_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell = Shell(tmp_path, monkeypatch, capsys)
    file = str(FOLDER / "with_laboratory.yaml")
    code, _, err = shell("estimate", file, "--no-sensitivity", "--no-plots", "-o", "f.h5")
    assert (code, "9 samples left out: the value is outside of [-5, 46]" in err) == (0, True)
    found = read(tmp_path / "f.h5")
    lab = np.genfromtxt(FOLDER / "laboratory.csv", delimiter=",", names=True)
    k = found.states.index("E")
    for label, error, inside in re.findall(r"^\| `(EKF\w*)` \| ([\d.]+) \| (\d+) of 23 \|$", PAGE, re.MULTILINE):
        one = found.observers[label]
        assert one.assessed is not None
        assert one.assessed.scores["reference_rmse"]["E"] == pytest.approx(float(error), abs=0.006)
        lower, upper = (
            np.interp(lab["taken_h"], found.time, b[:, k]) for b in (one.assessed.lower, one.assessed.upper)
        )
        assert np.sum((lower <= lab["ethanol"]) & (lab["ethanol"] <= upper)) == int(inside)


def test_the_acetic_acid_says_which_samples_are_concentrated() -> None:
    """What an observer that knows the broth would be charged with, in every set of samples that the page holds out."""
    lab = np.genfromtxt(FOLDER / "laboratory.csv", delimiter=",", names=True)
    excess = lab["ethanol"] * (1 - lab["acetic_acid"][0] / lab["acetic_acid"])
    told = re.findall(r"^\| concentration alone.*\|$", PAGE, re.MULTILINE)[0].split("|")[2:-1]
    assert [float(cell) for cell in told] == [round(float(np.sqrt(np.mean(excess[one] ** 2))), 2) for one in SETS]


def test_interpolation_afterwards() -> None:
    """A monotone cubic through the samples given, constant outside of them; and the filter's row is that of above."""
    lab = np.genfromtxt(FOLDER / "laboratory.csv", delimiter=",", names=True)
    found = []
    for held in SETS:
        t, E = (np.delete(lab[name], held) for name in ("taken_h", "ethanol"))
        between = PchipInterpolator(t, E)(np.clip(lab["taken_h"][held], t[0], t[-1]))
        found.append(round(float(np.sqrt(np.mean((between - lab["ethanol"][held]) ** 2))), 2))
    told = re.findall(r"^\| interpolated between.*\|$", PAGE, re.MULTILINE)[0].split("|")[2:-1]
    assert [float(cell) for cell in told] == found
    rows = [re.findall(rf"^\| {row} \|(.*)$", PAGE, re.MULTILINE)[0] for row in ("error, g/L", "`EKF` as it is")]
    assert rows[0] == rows[1]


@pytest.mark.measured("divided-error without it")
@pytest.mark.costly
@pytest.mark.parametrize(("column", "row"), [("ethanol", "error, g/L"), ("divided", "error without it")])
def test_laboratory_samples_that_are_held_out(
    column: str, row: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every third sample from the second on, the others as the laboratory gave them."""
    lab = np.genfromtxt(FOLDER / "laboratory.csv", delimiter=",", names=True)
    divided = lab["ethanol"] * lab["acetic_acid"][0] / lab["acetic_acid"]
    held = np.arange(23) % 3 == 1
    for name, chosen, E in (
        ("given.csv", ~held, lab["ethanol"]),
        ("held.csv", held, divided if column == "divided" else lab["ethanol"]),
    ):
        table = np.column_stack([lab["taken_h"], lab["available_h"], E])[chosen]
        np.savetxt(tmp_path / name, table, "%.5f", ",", header="taken_h,available_h,ethanol", comments="")
    shell = Shell(tmp_path, monkeypatch, capsys)
    file, given_to = str(FOLDER / "with_laboratory.yaml"), f"data.outputs.E.file={tmp_path / 'given.csv'}"
    options = ("--holdout", f"E={tmp_path / 'held.csv'}", "--set", given_to)
    code, out, err = shell("estimate", file, *options, "--no-sensitivity", "--no-plots", "--json")
    assert code == 0, err
    told = re.findall(rf"^\| {row}.*\|$", PAGE, re.MULTILINE)[0].split("|")[2:-1]
    found = json.loads(out)["observers"]["EKF"]["scores"]["holdout_rmse"]["E"]
    assert found == pytest.approx(float(told[3]), abs=0.006)
