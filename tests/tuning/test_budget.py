"""What a search does with its budget: it uses it, or says why it does not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun import load
from hgorun.config.tuning import Tune
from hgorun.tuning.search import Found, search
from hgorun.tuning.task import tasks
from hgorun.tuning.trials import Trials

CONFIG = """\
time: {end: 0.5, output_step: 0.1}
plant: {type: integrator_chain, n: 2, initial: {x1: 1, x2: 0}}
measurement: {noise: [{type: gaussian, std: 0.1}], sampling: {period: 0.1}}
observers: {S: {type: shgo, theta: 2, poles: [-1, -2], initial: {x1: 0, x2: 0}}}
solver: {method: rk4, step: 0.1}
"""
THETA = {"observers.S.theta": {"log": [0.5, 4]}}


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "c.yaml"
    path.write_text(CONFIG)
    return path


def found(config: Path, goal: str, budget: int, seeds: int) -> Found:
    block = {"gains": THETA, "minimise": goal, "seeds": seeds, "budget": budget}
    (task,) = tasks(load(config), Tune.model_validate(block))
    return search(Trials(task))


@pytest.mark.measured("160-20")
@pytest.mark.costly
@pytest.mark.parametrize(("budget", "seeds"), [(400, 20), (160, 20), (150, 7), (60, 2)])
def test_less_is_left_than_another_candidate_takes(config: Path, budget: int, seeds: int) -> None:
    one = found(config, "rmse(S, x2)", budget, seeds)
    assert budget - seeds < one.trials.spent <= budget
    assert not one.ended
    # every run that is counted has its number, and none is run twice
    assert one.trials.spent == np.isfinite(one.trials.values[:, :, 0]).sum()


def test_what_is_too_little_for_a_generation_is_said(config: Path) -> None:
    one = found(config, "rmse(S, x2)", 21, 1)  # a scan of 8, two generations of 6
    assert (one.trials.spent, one.ended) == (20, "another generation of 6 candidates takes 6 runs")


@pytest.mark.costly
def test_what_no_gain_changes_ends_it_and_it_says_so(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                     capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    # the error of x1 starts at 1 and falls from there, whatever theta is
    one = found(config, "peak(S, x1)", 400, 5)
    assert one.trials.means[one.trials.complete].ravel() == pytest.approx(1.0, abs=1e-9)
    assert one.trials.spent < 395
    assert "equally good" in one.ended
    tune = f"tune: {{gains: {json.dumps(THETA)}, minimise: 'peak(S, x1)', seeds: 5, held_out: 2, budget: 400}}\n"
    config.write_text(CONFIG + tune)
    shell = Shell(tmp_path, monkeypatch, capsys)
    code, out, _ = shell("tune", "c.yaml", "--no-plots")
    assert code == 0
    assert f"{one.trials.spent} of 400 runs" in out
    assert "the search ended before its budget: all candidates" in out.replace("\n", " ")
    told = json.loads(shell("tune", "c.yaml", "--no-plots", "--json")[1])["observers"]["S"]
    assert (told["budget"], told["runs"], told["ended"]) == (400, one.trials.spent, one.ended)
