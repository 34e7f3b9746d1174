"""What the README shows is what happens."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from shell import Shell
from typed import assert_strictly_typed

import hgorun
from hgorun.cli import main
from hgorun.observers.base import OBSERVERS
from hgorun.testing import check_observer

README = (Path(__file__).parent.parent / "README.md").read_text()


def block(language: str, containing: str) -> str:
    found = [b for b in re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL) if containing in b]
    assert len(found) == 1
    return str(found[0])


@pytest.mark.costly
def test_the_example_prints_what_the_readme_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bioreactor.yaml").write_text(block("yaml", "mu*x1*x2"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["hgorun", "simulate", "bioreactor.yaml"])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 0
    shown = re.search(r"\$ hgorun simulate bioreactor.yaml\n(.*?)\n\nYou did not have", README, re.DOTALL)
    assert shown is not None
    expected = [line.strip() for line in shown[1].splitlines()]
    assert [line.strip() for line in capsys.readouterr().out.strip().splitlines()] == expected


@pytest.mark.costly
def test_the_example_with_a_recording_prints_what_the_readme_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell = Shell(tmp_path, monkeypatch, capsys)
    assert "    hgorun init fermentation\n" in README
    assert shell("init", "fermentation")[0] == 0
    written = yaml.safe_load((tmp_path / "fermentation" / "fermentation.yaml").read_text())
    shown = yaml.safe_load(block("yaml", "file: online.csv"))
    assert shown["data"].items() <= written["data"].items()
    found = re.search(r"\$ hgorun (estimate fermentation/.*?)\n(.*?)\n\n`holdout", README, re.DOTALL)
    assert found is not None
    code, out, _ = shell(*found[1].split(), "--no-plots")
    assert code == 0
    *numbers, files = [line.strip() for line in found[2].strip().splitlines()]
    assert [line.strip() for line in out.strip().splitlines()] == [*numbers, files.split(",")[0]]


@pytest.mark.slow
def test_the_way_to_a_figure_of_your_own_plant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The commands after the installation, each as it stands there."""
    shell = Shell(tmp_path, monkeypatch, capsys)
    lines = [line.split("#")[0].split() for line in block("sh", "git clone").splitlines() if line.startswith("hgorun")]
    assert [line[1] for line in lines] == ["init", "compare", "analyze"]
    for line in lines:
        code, _, err = shell(*line[1:])
        assert code == 0, err
    assert (tmp_path / "results" / "mine-comparison.png").exists()


@pytest.mark.costly
def test_the_python_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bioreactor.yaml").write_text(block("yaml", "mu*x1*x2"))
    monkeypatch.chdir(tmp_path)
    exec(compile(block("python", "hgorun.load"), "README.md", "exec"), {})
    assert (tmp_path / "bioreactor.h5").exists()
    assert (tmp_path / "bioreactor.png").exists()


@pytest.mark.costly
def test_the_tutorial_observer_runs_from_outside_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with an entry point and the README's class: hgorun finds it by name."""
    (tmp_path / "my_package.py").write_text(block("python", "pi_observer"))
    info = tmp_path / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n")
    entry = block("toml", "entry-points")
    assert 'pi_observer = "my_package:ProportionalIntegral"' in entry
    (info / "entry_points.txt").write_text("[hgorun.observers]\npi_observer = my_package:ProportionalIntegral\n")
    monkeypatch.syspath_prepend(tmp_path)
    config = yaml.safe_load(block("yaml", "mu*x1*x2"))
    config["time"]["end"] = 40
    config["metrics"]["window"] = [20, 40]
    config["measurement"] = {"sampling": {"period": 0.25}}
    config["plant"]["disturbance"] = {"x1": 0.05}
    config["observers"] = {
        "PI": {"type": "pi_observer", "theta": 1, "initial": {"x1": 1, "x2": 14}},
        "P": {"type": "pi_observer", "theta": 1, "k_i": 0, "initial": {"x1": 1, "x2": 14}},
        "SHGO": {"type": "shgo", "theta": 1, "initial": {"x1": 1, "x2": 14}},
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    try:
        result = hgorun.simulate(hgorun.load(tmp_path / "config.yaml"))
        check_observer(OBSERVERS.find("pi_observer"), {"theta": 2})  # on two outputs too
    finally:
        sys.modules.pop("my_package", None)
        OBSERVERS.forget("pi_observer")
    np.testing.assert_allclose(result.observers["P"].xhat, result.observers["SHGO"].xhat, rtol=1e-12)
    assert "w" in result.observers["PI"].internal
    metrics = result.metrics()
    assert metrics["PI"]["rmse"]["x1"] < 0.5 * metrics["P"]["rmse"]["x1"]


@pytest.mark.slow
def test_the_tutorial_passes_strict_type_checking_as_an_outside_package(tmp_path: Path) -> None:
    """What a newcomer meets has its types said: no Any comes in from hgorun."""
    shown = "        reveal_type((plant.copy(s.xhat), k.theta, e))\n"
    text = block("python", "pi_observer").replace("        kappa =", shown + "        kappa =")
    (tmp_path / "my_package.py").write_text(text)
    reported = assert_strictly_typed(tmp_path / "my_package.py")
    assert 'Revealed type is "tuple[casadi.casadi.SX, casadi.casadi.SX, casadi.casadi.SX]"' in reported
