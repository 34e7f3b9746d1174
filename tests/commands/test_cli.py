"""The commands as a user types them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest
import yaml
from outside import installed
from shell import Shell
from waiting import wait_until_it_computes

from hgorun.files import _MACHINE
from hgorun.observers.base import OBSERVERS
from hgorun.observers.shgo import StandardObserver

SMALL = """
time: {end: 2, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
measurement: {sampling: {period: 0.1}, noise: [{type: gaussian, std: 0.1}]}
observers:
  SHGO: {type: shgo, theta: 2}
  r=1: {type: fhgo2, theta: 2}
solver: {step: 0.01}
"""
DIVERGING = SMALL + "seed: 3\n"


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "small.yaml").write_text(SMALL)
    return Shell(tmp_path, monkeypatch, capsys)


def test_simulate_writes_a_file_and_prints_a_table(shell: Shell) -> None:
    code, out, err = shell("simulate", "small.yaml")
    assert (code, err) == (0, "")
    assert "SHGO" in out
    assert "rmse" in out.lower()
    assert (shell.folder / "results" / "small.h5").exists()


def test_quiet_prints_nothing(shell: Shell) -> None:
    assert shell("simulate", "small.yaml", "--quiet") == (0, "", "")


def test_json_has_the_documented_shape(shell: Shell) -> None:
    code, out, _ = shell("simulate", "small.yaml", "--json", "-o", "there/a.h5")
    found = json.loads(out)
    assert code == 0
    assert found["name"] == "small"
    assert found["file"] == str(Path("there/a.h5"))
    assert found["status"] == "ok"
    assert set(found["observers"]) == {"SHGO", "r=1"}
    observer = found["observers"]["SHGO"]
    assert observer["status"] == "ok"
    for metric in ("rmse", "sup", "peak", "settling", "hf", "tv"):
        assert set(observer[metric]) == {"x1", "x2"}
        assert all(isinstance(v, float) for v in observer[metric].values())


def test_a_diverged_observer_is_a_result(shell: Shell) -> None:
    arguments = ("simulate", "small.yaml", "--json", "--set", "observers.SHGO.gains=[-99, 1]")
    code, out, err = shell(*arguments)
    found = json.loads(out)
    assert code == 0
    assert "SHGO diverged at t=" in err
    assert found["status"] == found["observers"]["SHGO"]["status"] == "diverged"
    assert 0 < found["observers"]["SHGO"]["status_at"] < 1
    assert found["observers"]["SHGO"]["rmse"]["x1"] == "inf"
    assert found["observers"]["r=1"]["status"] == "ok"
    assert shell(*arguments, "--strict")[0] == 3


def test_a_diverging_plant_writes_nothing(shell: Shell) -> None:
    config = yaml.safe_load(SMALL)
    config["plant"] = {"states": ["x1"], "dynamics": {"x1": "x1**2"}, "output": "x1", "initial": {"x1": 1}}
    (shell.folder / "wild.yaml").write_text(yaml.safe_dump(config))
    code, _, err = shell("simulate", "wild.yaml")
    assert code == 1
    assert "the plant itself diverged at t = 1, where x1 reaches infinity" in err
    assert not (shell.folder / "results").exists()


def test_all_is_checked_before_anything_runs(shell: Shell) -> None:
    (shell.folder / "wrong.yaml").write_text(SMALL.replace("theta: 2}\n  r", "theta: -2}\n  r"))
    code, out, err = shell("simulate", "small.yaml", "wrong.yaml")
    assert (code, out) == (2, "")
    assert "wrong.yaml:6: observers.SHGO.theta" in err
    assert not (shell.folder / "results").exists()


@pytest.mark.costly
def test_overrides_and_seed(shell: Shell) -> None:
    results = {}
    for name, extra in (
        ("a", ()),
        ("b", ("--seed", "1")),
        ("c", ("--set", "seed=1")),
        ("d", ("--set", "observers.r=1.theta=3")),
    ):
        code, out, _ = shell("simulate", "small.yaml", "--json", "-o", f"{name}.h5", *extra)
        assert code == 0
        results[name] = json.loads(out)["observers"]
    assert results["b"] == results["c"]
    assert results["a"]["SHGO"] != results["b"]["SHGO"]
    assert results["a"]["SHGO"] == results["d"]["SHGO"]
    assert results["a"]["r=1"] != results["d"]["r=1"]


def test_check_step_reports_the_integration_error(shell: Shell) -> None:
    code, out, _ = shell("simulate", "small.yaml", "--json", "--check-step")
    assert code == 0
    error = json.loads(out)["integration_error"]
    assert set(error) == {"plant", "SHGO", "r=1"}
    assert all(0 <= e < 1e-6 for e in error.values())


@pytest.mark.costly
def test_compare_configurations_and_files(shell: Shell) -> None:
    assert shell("simulate", "small.yaml", "--quiet", "-o", "first.h5")[0] == 0
    code, out, _ = shell("compare", "first.h5", "small.yaml")
    assert code == 0
    assert "SHGO" in out
    for suffix in ("png", "pdf"):
        assert (shell.folder / "results" / f"comparison.{suffix}").stat().st_size > 1000
    code, out, _ = shell("compare", "first.h5", "--json", "--no-plots")
    assert json.loads(out)["observers"]["SHGO"]["status"] == "ok"
    for style, word in (("csv", "observer,"), ("latex", "\\toprule")):
        code, out, _ = shell("compare", "small.yaml", "--format", style, "--no-plots")
        assert code == 0
        assert word in out


def test_figures_of_ones_own_file(shell: Shell) -> None:
    (shell.folder / "mine.yaml").write_text(SMALL + "figures: {first: {panels: [{state: x1}]}}\n")
    code, out, _ = shell("figures", "mine.yaml", "-o", "pictures")
    assert code == 0
    assert (shell.folder / "pictures" / "mine" / "first.png").exists()
    assert "integration error" in out


@pytest.mark.slow
def test_list_and_show(shell: Shell) -> None:
    code, out, _ = shell("list", "--json")
    found = json.loads(out)
    assert code == 0
    assert {"shgo", "fhgo2"} <= set(found["observers"])
    assert {"contois", "van_der_pol", "integrator_chain"} <= set(found["plants"])
    for name in (*found["observers"], *found["plants"]):
        code, out, _ = shell("show", name)
        assert code == 0
        assert "source: " in out
        described = json.loads(shell("show", name, "--json")[1])
        # every key says what it means, and every entry where it comes from
        assert all(key["description"] for key in described["keys"]), name
        assert described["reference"]
        assert len(described["description"]) > 100
    assert shell("show", "contois_te025")[1].splitlines()[1].startswith("# Figures 3.8 to 3.13")


def test_init_copies_what_runs(shell: Shell) -> None:
    assert shell("init", "contois_te050", "mine")[0] == 0
    copies = ["_contois.yaml", "contois_te050.yaml"]
    assert sorted(p.name for p in (shell.folder / "mine").iterdir()) == copies
    for name in copies:
        assert (shell.folder / "mine" / name).read_text().startswith("# yaml-language-server: $schema=file:///")
    assert shell("init", "contois_te025", "mine")[0] == 0  # shares the base file
    (shell.folder / "mine" / "_contois.yaml").write_text("mine now\n")
    assert shell("init", "contois_te050", "mine")[0] == 2
    assert (shell.folder / "mine" / "_contois.yaml").read_text() == "mine now\n"
    assert shell("init", "contois_te050", "mine", "--force")[0] == 0
    code, out, _ = shell("simulate", "mine/contois_te050.yaml", "--set", "time.end=1", "--set", "metrics={}")
    assert code == 0
    assert "FHGO r=3" in out


@pytest.mark.slow
def test_interrupting_leaves_nothing_and_exits_130(tmp_path: Path) -> None:
    """Ctrl-C in the middle of a long run: native code comes back soon, no file is left."""
    config = SMALL.replace("end: 2, output_step: 0.1", "end: 500000, output_step: 10").replace("0.01", "0.0005")
    config = config.replace("period: 0.1", "period: 50").replace("theta: 2}", "theta: 0.01}")
    (tmp_path / "long.yaml").write_text(config)
    process = subprocess.Popen(
        [sys.executable, "-m", "hgorun", "simulate", "long.yaml"], cwd=tmp_path, stderr=subprocess.PIPE
    )
    wait_until_it_computes(process, seconds=2.5)
    assert process.poll() is None, "the run was too short for this test"
    process.send_signal(signal.SIGINT)
    started = time.perf_counter()
    _, err = process.communicate(timeout=20)
    assert time.perf_counter() - started < 10  # on a machine that is busy with other tests
    assert process.returncode == 130, err
    assert b"interrupted" in err
    assert [p.name for p in tmp_path.iterdir()] == ["long.yaml"]


def test_same_file_from_the_command_line_twice(shell: Shell) -> None:
    for name in ("a.h5", "b.h5"):
        assert shell("simulate", "small.yaml", "--quiet", "-o", name)[0] == 0
    with h5py.File("a.h5") as a, h5py.File("b.h5") as b:
        assert a["observers/SHGO/xhat"][()].tobytes() == b["observers/SHGO/xhat"][()].tobytes()


def test_a_long_chain_is_no_circle(shell: Shell) -> None:
    (shell.folder / "0.yaml").write_text(SMALL)
    for i in range(1, 22):
        (shell.folder / f"{i}.yaml").write_text(f"extends: {i - 1}.yaml\n")
    assert shell("simulate", "20.yaml", "--quiet") == (0, "", "")
    code, _, err = shell("simulate", "21.yaml")
    assert code == 2
    assert "1.yaml:1: extends: a chain of more than 20 files that extend each other" in err


def test_figures_refuses_files_of_one_name(shell: Shell) -> None:
    for folder in ("a", "b"):
        (shell.folder / folder).mkdir()
        text = SMALL + "figures: {first: {panels: [{state: x1}]}}\n"
        (shell.folder / folder / "mine.yaml").write_text(text)
    code, out, err = shell("figures", "a/mine.yaml", "b/mine.yaml")
    assert (code, out) == (2, "")
    assert "have the same name" in err
    assert not (shell.folder / "results").exists()


def test_a_broken_package_harms_only_its_own_name(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    info = shell.folder / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[hgorun.observers]\nbroken = no_such_module:Observer\n")
    monkeypatch.syspath_prepend(shell.folder)
    code, out, _ = shell("list")
    assert code == 0
    assert "shgo" in out
    assert "broken" not in out
    assert shell("schema")[0] == 0
    code, _, err = shell("simulate", "small.yaml", "--set", "observers.SHGO.type=shgoo")
    assert code == 2
    assert "no observer is called 'shgoo'. Did you mean" in err
    code, _, err = shell("simulate", "small.yaml", "--set", "observers.SHGO.type=broken")
    assert code == 2
    assert "the observer 'broken' of no_such_module:Observer cannot be loaded" in err


FAILING = '''
from dataclasses import dataclass
from hgorun.observers.base import observer
from hgorun.observers.shgo import StandardObserver
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.observability import canonical_form


class Form(CanonicalForm):
    def start(self, x, parameters, canonical):
        return {}["start"]


def mine(plant, at, parameters):
    return Form(**vars(canonical_form(plant, at, parameters)))


@observer("failing")
class Failing(StandardObserver):
    """An observer whose form fails."""
    form = staticmethod(mine)
'''


def test_code_of_another_package_that_fails_is_named_without_a_traceback(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    with installed(shell.folder / "other", monkeypatch, OBSERVERS, "other", FAILING, failing="Failing"):
        code, out, err = shell("simulate", "small.yaml", "--set", "observers.SHGO.type=failing")
    assert (code, out) == (2, "")
    assert err == "hgorun: observer 'failing': start (other.py, line 11) raised KeyError: 'start'\n"


def test_a_package_that_takes_a_built_in_name_is_told(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    code_ = "from hgorun.observers.shgo import StandardObserver\nclass Mine(StandardObserver):\n    pass\n"
    with installed(shell.folder / "other", monkeypatch, OBSERVERS, "other", code_, shgo="Mine"):
        code, _, err = shell("simulate", "small.yaml")
    OBSERVERS.add("shgo", StandardObserver)
    assert code == 0
    assert err == (
        "hgorun: the observer 'shgo' of other:Mine is not used, since the name belongs to the class "
        "hgorun.observers.shgo.StandardObserver: its entry point needs another name\n"
    )


@pytest.mark.costly
def test_compare_removes_what_a_killed_process_left(shell: Shell) -> None:
    results = shell.folder / "results"
    results.mkdir()
    left = results / f".small-comparison.png-{_MACHINE}-999999999-x.part"
    left.write_text("half")
    assert shell("compare", "small.yaml", "-q")[0] == 0
    assert not left.exists()
    assert (results / "small-comparison.png").exists()


def test_a_name_that_is_too_long_for_a_file(shell: Shell) -> None:
    code, out, err = shell("simulate", "x" * 5000)
    assert (code, out, err.count("\n")) == (2, "", 1)


def test_a_library_that_cannot_be_loaded(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where memory is limited to less than the libraries need."""

    def fail(*_: object) -> None:
        raise OSError("Could not find/load shared object file")

    monkeypatch.setattr("hgorun.commands.simulate.simulate", fail)
    code, _, err = shell("simulate", "small.yaml")
    assert code == 1
    assert err.startswith("hgorun: a library cannot be loaded: too little memory, or a broken installation: Could not")
    assert err.count("\n") == 1
