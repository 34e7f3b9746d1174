"""docs/differentiators.md says what experiments/benchmark/differentiators.yaml gives."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import hgorun
from hgorun.study.check import check
from hgorun.study.loading import load_study

ROOT = Path(__file__).parents[1]
FILE = ROOT / "experiments" / "benchmark" / "differentiators.yaml"
PAGE = (ROOT / "docs" / "differentiators.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| ([^|`]+) \| `\w+` \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", PAGE, re.MULTILINE)


def errors(run: hgorun.Result) -> dict[str, np.ndarray]:
    """Of y' from t = 2 on."""
    late = run.time >= 2
    return {label: (one.xhat - run.x)[late, 1] for label, one in run.observers.items()}


@pytest.fixture(scope="module")
def study() -> hgorun.Study:
    return load_study(FILE)


def test_the_file_is_whole(study: hgorun.Study) -> None:
    check(study)


@pytest.mark.costly
def test_numbers_of_the_page() -> None:
    """Over four of the fifty seeds."""
    noisy = hgorun.load(FILE, run="one")
    found = [errors(hgorun.simulate(noisy.varied({}, seed=seed))) for seed in range(4)]
    clean = errors(hgorun.simulate(hgorun.load(FILE, run="clean")))
    assert [name for name, *_ in ROWS] == list(clean)
    for label, *numbers in ROWS:
        rmse, largest, without = map(float, numbers)
        mine = [one[label] for one in found]
        assert np.mean([np.sqrt(np.mean(e**2)) for e in mine]) == pytest.approx(rmse, rel=0.05), label
        assert np.mean([np.abs(e).max() for e in mine]) == pytest.approx(largest, rel=0.12), label
        assert np.sqrt(np.mean(clean[label] ** 2)) == pytest.approx(without, abs=6e-4), label


def test_the_published_bound() -> None:
    """2 sqrt(2 L N) + L h/2, of the worst case; the implicit differentiator is within it from t = 2 on."""
    noisy = hgorun.load(FILE, run="one").varied(
        {f"observers.{label}": None for label, *_ in ROWS if label != "implicit"}
    )
    bound = 2 * np.sqrt(2 * 0.08) + 0.01 / 2
    assert bound == pytest.approx(0.805)
    for seed in range(8):
        assert np.abs(errors(hgorun.simulate(noisy.varied({}, seed=seed)))["implicit"]).max() < bound
