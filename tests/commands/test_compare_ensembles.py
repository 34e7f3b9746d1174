"""``hgorun compare`` of ensembles, as typed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from collected_files import write
from matplotlib.image import imread
from shell import Shell

import hgorun

THETA = "observers.F.theta"
VALUES = 1 + np.random.default_rng(2).random((3, 10, 2, 2))


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    axes = {THETA: [2.0, 4.0, 8.0], "seed": range(10)}
    status = np.zeros((3, 10, 2))
    status[2, 0, 1] = 2
    write(tmp_path / "a.sweep.h5", axes, {"rmse": VALUES}, observers=["F", "S"], states=["x1", "x2"], status=status)
    return Shell(tmp_path, monkeypatch, capsys)


def test_statistics_of_an_ensemble(shell: Shell) -> None:
    code, out, err = shell("compare", "a.sweep.h5", "--json", "--no-plots")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert (found["name"], found["members"]) == ("a", 30)
    assert found["observers"]["S"]["failed"] == 1
    assert found["observers"]["F"]["rmse"]["x2"]["mean"] == pytest.approx(VALUES[:, :, 0, 1].mean(), rel=1e-13)
    assert [p["at"] for p in found["points"]] == [{THETA: 2.0}, {THETA: 4.0}, {THETA: 8.0}]


@pytest.mark.measured
@pytest.mark.slow
def test_figures_and_tables_are_written(shell: Shell) -> None:
    code, out, _ = shell("compare", "a.sweep.h5", "-o", "figures")
    assert code == 0
    assert "theta = 4" in out
    assert (shell.folder / "figures" / "a-against-theta.png").is_file()
    assert out.splitlines()[-1].startswith("written: figures/a-against-theta.png")
    assert shell("compare", "a.sweep.h5", "-o", "one.png", "-q")[0] == 0
    assert (shell.folder / "one.png").is_file()
    assert not (shell.folder / "one.pdf").exists()
    assert shell("compare", "a.sweep.h5", "-o", "narrow.png", "-q", "--width", "one", "--style", "dark")[0] == 0
    assert imread(shell.folder / "narrow.png").shape[1] == pytest.approx(3.5 * 300, abs=1)


def test_a_point_of_an_axis(shell: Shell) -> None:
    code, out, _ = shell("compare", "a.sweep.h5", "--at", "theta=4", "--format", "csv", "--no-plots")
    assert code == 0
    first = out.splitlines()[1].split(",")
    assert float(first[4]) == pytest.approx(VALUES[1, :, 0, 0].mean(), rel=1e-13)


def test_all_members_together(shell: Shell) -> None:
    _, out, _ = shell("compare", "a.sweep.h5", "--by", "none", "--no-plots")
    assert "F - S" in out
    assert "theta = 4" not in out
    assert "S: 1 diverged" in out


@pytest.mark.measured(
    "arguments3-Did you mean",
    "arguments2-Did you mean",
    "arguments1-expected AXIS=VALUE",
    "arguments7-expected one of text, csv, latex",
    "arguments5-is for configurations",
    "arguments6---width: expected one of one, two",
)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--at", "theta=5"], "no member has the value 5; there are 2, 4, 8"),
        (["--at", "theta"], "expected AXIS=VALUE"),
        (["--by", "thta"], "Did you mean"),
        (["--metric", "rsme"], "Did you mean"),
        (["--seed", "3"], "is for configurations"),
        (["--set", "seed=3"], "is for configurations"),
        (["--width", "three"], "--width: expected one of one, two"),
        (["--format", "xml"], "expected one of text, csv, latex"),
        (["-o", "a.yaml"], "--output: expected a file"),
    ],
)
def test_what_does_not_fit_is_refused(shell: Shell, arguments: list[str], message: str) -> None:
    code, _, err = shell("compare", "a.sweep.h5", *arguments)
    assert code == 2
    assert message in err


def test_single_runs_are_compared_beside_ensembles_which_are_named(shell: Shell) -> None:
    configuration = {
        "time": {"end": 1, "output_step": 0.1},
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
        "observers": {"S": {"type": "shgo", "theta": 2}},
    }
    hgorun.simulate(configuration).save(shell.folder / "r.h5")
    alone = shell("compare", "r.h5", "--no-plots")
    code, out, err = shell("compare", "a.sweep.h5", "r.h5", "--no-plots")
    assert (code, out) == alone[:2]
    told = "compared are the single runs; ensembles are left out: hgorun compare a.sweep.h5 compares them"
    assert err.splitlines()[0] == f"hgorun: {told}"
    code, out, err = shell("compare", "r.h5", "a.sweep.h5", "--by", "theta", "--no-plots")
    assert (code, out) == shell("compare", "a.sweep.h5", "--by", "theta", "--no-plots")[:2]
    assert err == "hgorun: compared are the ensembles; single runs are left out: hgorun compare r.h5 compares them\n"
    code, _, err = shell("compare", "r.h5", "--by", "seed")
    assert "for ensembles" in err


@pytest.mark.parametrize("more", [[], ["--metric", "rmse"], ["--by", "theta"]])
@pytest.mark.parametrize(
    ("sources", "message"),
    [
        (["b.sweep.h5"], "b.sweep.h5: there is no such file. Did you mean `a.sweep.h5`?"),
        (["a.sweep.h5", "b.sweep.h5"], "b.sweep.h5: there is no such file. Did you mean `a.sweep.h5`?"),
        (["b.h5"], "b.h5: there is no such file"),
        (["folder"], "folder: this folder is not that of an ensemble: name the files in it"),
        (["a.sweep.h5", "folder"], "folder: this folder is not that of an ensemble: name the files in it"),
        (["folde.yaml"], "folde.yaml: there is no such file"),
    ],
)
def test_what_is_not_there_is_no_single_run(shell: Shell, sources: list[str], more: list[str], message: str) -> None:
    (shell.folder / "folder").mkdir()
    code, out, err = shell("compare", *sources, *more, "--no-plots")
    assert (code, out) == (2, "")
    assert err.startswith(f"hgorun: {message}")


def test_an_experiment_that_is_brought_along_is_no_ensemble(shell: Shell) -> None:
    code, _, err = shell("compare", "katayama/van_der_pol", "--by", "theta")
    assert (code, "these are single runs" in err) == (2, True)


def test_where_all_are_lost_it_is_said_that_nothing_is_drawn(shell: Shell) -> None:
    values = np.full((3, 10, 2, 2), np.inf)
    axes, lost = {THETA: [2.0, 4.0, 8.0], "seed": range(10)}, np.full((3, 10, 2), 2)
    write(shell.folder / "l.sweep.h5", axes, {"rmse": values}, observers=["F", "S"], states=["x1", "x2"], status=lost)
    code, out, err = shell("compare", "l.sweep.h5")
    assert (code, "written" in out, err.count("\n")) == (0, False, 1)
    assert "l: no figure is drawn: no member has numbers of an observer (F: 30 diverged; S: 30 diverged); " in err


@pytest.mark.slow
def test_strict(shell: Shell) -> None:
    assert shell("compare", "a.sweep.h5", "--strict", "-q", "--no-plots")[0] == 3
    assert shell("compare", "a.sweep.h5", "--strict", "-q", "--no-plots", "--at", "theta=2")[0] == 0


@pytest.mark.measured
@pytest.mark.slow
def test_an_ensemble_without_observers(shell: Shell) -> None:
    """Of the plant alone there are trajectories, and nothing to compare."""
    path = shell.folder / "p.sweep.h5"
    write(path, {"seed": range(3)}, {"rmse": np.zeros((3, 0, 2))}, observers=[], states=["x1", "x2"])
    code, out, err = shell("compare", "p.sweep.h5")
    assert (code, err) == (0, "")
    assert out.splitlines()[:4] == ["p", "  3 members; seed 0, 1, 2", "", "no observers"]
    for how in (["--format", "csv"], ["--format", "latex"], ["--json"], ["-o", "a.png"]):
        assert shell("compare", "p.sweep.h5", *how)[::2] == (0, "")
    assert not (shell.folder / "a.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 2])
def test_few_members(shell: Shell, size: int) -> None:
    values = np.ones((size, 2, 1))
    status = np.full((size, 2), 2)
    for name, lost in (("fine", np.zeros_like(status)), ("lost", status)):
        values = np.where(lost[:, :, None] > 1, np.inf, values)
        path = shell.folder / f"{name}.sweep.h5"
        write(path, {"seed": range(size)}, {"rmse": values}, observers=["F", "S"], states=["x1"], status=lost)
        code, _, err = shell("compare", f"{name}.sweep.h5")
        assert (code, "no figure is drawn" in err, err.count("\n")) == (0, name == "lost", name == "lost")
        for how in (["--format", "csv"], ["--format", "latex"], ["--json"]):
            assert shell("compare", f"{name}.sweep.h5", "--no-plots", *how)[::2] == (0, "")
