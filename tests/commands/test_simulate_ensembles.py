"""``hgorun simulate`` of files with ensembles among their runs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

import hgorun
from hgorun.simulation.simulate import simulate
from hgorun.study.ensembles import ensemble_of
from hgorun.study.loading import load_study

FILE = """\
title: Two observers
time: {end: 1, output_step: 0.05}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {SHGO: {type: shgo, theta: 2}, FHGO: {type: fhgo2, theta: 2}}
measurement: {noise: [{type: gaussian, std: 0.1, hold: 0.05}]}
solver: {step: 0.01}
runs:
  one: {}
  many: {seeds: 4}
  gains: {vary: {name: eps, values: [0.5, 0.25, 0.2], set: {observers.SHGO.theta: 1/eps, observers.FHGO.theta: 2/eps}}}
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "s.yaml").write_text(FILE)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_ensembles_are_carried_out_beside_the_single_runs(shell: Shell) -> None:
    code, out, err = shell("simulate", "s.yaml", "--json")
    assert (code, err) == (0, "")
    one, many, gains = json.loads(out)
    assert [found["name"] for found in (one, many, gains)] == ["one", "many", "gains"]
    assert many["file"] == "results/s/many.sweep.h5"
    members = list(load_study("s.yaml").runs["many"].members())
    naive = [simulate(member).observers["FHGO"].metrics["rmse"][1] for member in members]
    summary = many["observers"]["FHGO"]["rmse"]["x2"]
    assert summary["mean"] == pytest.approx(np.mean(naive), rel=1e-14)
    assert summary["q95"] == pytest.approx(np.quantile(naive, 0.95), rel=1e-14)
    assert [p["at"] for p in gains["points"]] == [{"observers.SHGO.theta": theta} for theta in (2.0, 4.0, 5.0)]


@pytest.mark.slow
def test_members_are_those_of_the_study(shell: Shell) -> None:
    shell("simulate", "s.yaml", "-q")
    found = hgorun.read_sweep("results/s/gains.sweep.h5")
    for i, member in enumerate(load_study("s.yaml").runs["gains"].members()):
        result = simulate(member)
        assert found.axes["observers.FHGO.theta"][i] == member.observers["FHGO"].theta  # type: ignore[attr-defined]  # of this family
        np.testing.assert_array_equal(found.metrics["hf"][i, 0], result.observers["SHGO"].metrics["hf"])
        assert found.trajectories is not None
        np.testing.assert_array_equal(found.trajectories.xhat[i, 1], result.observers["FHGO"].xhat)


@pytest.mark.slow
def test_what_is_there_of_another_configuration_is_replaced(shell: Shell) -> None:
    shell("simulate", "s.yaml", "-q")
    first = hgorun.read_sweep("results/s/many.sweep.h5").metrics["rmse"]
    code, out, err = shell("simulate", "s.yaml", "-q", "--set", "observers.FHGO.theta=3")
    kept = "the run gains varies observers.FHGO.theta, whose values stay as they are"
    assert (code, out, err) == (0, "", f"hgorun: s.yaml: --set observers.FHGO.theta=3: {kept}\n")
    second = hgorun.read_sweep("results/s/many.sweep.h5").metrics["rmse"]
    assert not np.array_equal(first[:, 1], second[:, 1])
    np.testing.assert_array_equal(first[:, 0], second[:, 0])


@pytest.mark.slow
def test_statistics_are_printed(shell: Shell) -> None:
    code, out, _ = shell("simulate", "s.yaml")
    assert code == 0
    assert "many: Two observers" in out
    assert "  4 members; seed 0, 1, 2, 3" in out
    assert "written: results/s/many.sweep.h5" in out


@pytest.mark.slow
def test_one_ensemble_can_have_a_file_of_its_own(shell: Shell) -> None:
    (shell.folder / "s.yaml").write_text(FILE.replace("  one: {}\n", "").partition("  gains")[0])
    assert shell("simulate", "s.yaml", "-q", "-o", "own.h5") == (0, "", "")
    assert len(hgorun.read_sweep("own.h5")) == 4
    code, _, err = shell("compare", "s.yaml")
    assert code == 2
    assert "all runs are ensembles: many" in err


@pytest.mark.slow
def test_trajectories_of_another_horizon_each_are_not_kept(shell: Shell) -> None:
    (shell.folder / "s.yaml").write_text(FILE.replace("observers.SHGO.theta: 1/eps", "time.end: 1/eps"))
    assert ensemble_of(load_study("s.yaml").runs["gains"]).keep.trajectories == "none"
    assert shell("simulate", "s.yaml", "-q") == (0, "", "")


@pytest.mark.measured
@pytest.mark.slow
def test_a_mistyped_path_of_vary_is_wrong_input(shell: Shell) -> None:
    code, _, err = shell("simulate", "s.yaml", "--run", "one")
    assert code == 0, err
    Path("wrong.yaml").write_text(FILE.replace("set: {observers.SHGO.theta:", "set: {observers.SHGO.thta:"))
    code, _, err = shell("simulate", "wrong.yaml")
    assert code == 2
    assert "observers.SHGO.thta: unknown key 'thta'. Did you mean `theta`?" in err
