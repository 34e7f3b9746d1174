"""What the page of the analysis shows of the command is what it prints; its bounds and limits are right."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from shell import Shell

import hgorun

PAGE = (Path(__file__).parents[2] / "docs" / "analysis.md").read_text(encoding="utf-8")


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_the_output_on_the_page_is_that_of_the_command(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    found = re.search(r"\$ hgorun analyze contois_te025\n(.*?)\n\nThen", PAGE, re.DOTALL)
    assert found is not None
    expected = [line.removeprefix("    ") for line in found[1].splitlines()]
    monkeypatch.setenv("COLUMNS", "110")
    code, out, _ = shell("analyze", "contois_te025", "--no-plots")
    assert code == 0
    assert out.splitlines()[: len(expected)] == expected


@pytest.mark.costly
def test_bounds_are_as_far_from_the_limits_as_the_page_says() -> None:
    experiment = hgorun.Experiment(
        {
            "time": {"end": 1, "output_step": 0.1},
            "plant": {"type": "integrator_chain", "n": 3, "phi": "0", "initial": {"x1": 1, "x2": 0, "x3": 0}},
            "observers": {"S": {"type": "shgo", "theta": 1}, "F": {"type": "fhgo2", "theta": 1, "r": 3}},
            "solver": {"step": 0.01},
        }
    )
    found = hgorun.analyze(experiment).observers
    words = " ".join(PAGE.split())
    standard, filtered = (found[label].values for label in ("S", "F"))
    assert standard["delay_bound"] == pytest.approx(2.6e-3, rel=0.02)
    assert filtered["delay_bound"] == pytest.approx(1.7e-6, rel=0.03)
    assert "2.6e-3/theta for the standard observer and 1.7e-6/theta with a filter of order 3" in words
    assert standard["delay_critical"] == pytest.approx(0.93, rel=0.005)
    assert filtered["delay_critical"] == pytest.approx(1.40, rel=0.005)
    assert "up to 0.93/theta and 1.40/theta" in words
