"""``hgorun export`` as the command line has it, and what docs/export.md shows."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exported_c import STRICT, driven
from shell import Shell

from hgorun import load
from hgorun.simulation.simulate import prepare

PAGE = (Path(__file__).parents[2] / "docs" / "export.md").read_text(encoding="utf-8")


def of_page(language: str) -> str:
    return str(re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[0])


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "tank.yaml").write_text(of_page("yaml"))
    return Shell(tmp_path, monkeypatch, capsys)


def test_the_page(shell: Shell, tmp_path: Path) -> None:
    """The command says what the page shows, and the page's program gives the numbers of the run."""
    code, out, err = shell(*shlex.split(re.findall(r"^    hgorun (export tank.*)$", PAGE, re.MULTILINE)[0]))
    assert (code, err) == (0, "")
    shown = "".join(re.findall(r"^    (FHGO.*\n(?:      .*\n)+)", PAGE, re.MULTILINE)).replace("\n    ", "\n")
    assert out == shown
    folder = tmp_path / "results" / "tank"
    (folder / "main.c").write_text(of_page("c"))
    command = ["gcc", *STRICT, "-O1", "FHGO.c", "main.c", "-lm", "-o", "observer"]
    assert subprocess.run(command, cwd=folder, capture_output=True).returncode == 0
    found = driven(prepare(load(tmp_path / "tank.yaml")))
    samples = [(t, y) for t, (*_, (_, _, y, _)) in zip(found.events, found.samples, strict=True)]
    lines = "".join(f"{t!r} {y!r}\n" for t, y in np.array(samples).tolist())
    done = subprocess.run(["./observer"], cwd=folder, input=lines, capture_output=True, text=True)
    own = np.array([[float(word) for word in line.split()[1:]] for line in done.stdout.splitlines()])
    np.testing.assert_allclose(own, found.estimates["FHGO"], rtol=1e-12)


def test_json(shell: Shell) -> None:
    code, out, _ = shell("export", "tank.yaml", "--json", "--float", "--inputs-given", "--late", "0.5", "-o", "out")
    found = json.loads(out)
    (observer,) = found["observers"].values()
    assert (code, found["name"], observer["type"], observer["method"], observer["step"]) == (
        0,
        "tank",
        "fhgo2",
        "rk4",
        0.01,
    )
    assert observer["files"] == ["out/FHGO.c", "out/FHGO.h"]
    assert observer["inputs"] == ["D"]
    assert observer["operations"]["step"]["plain"] > 100
    assert "float z[4]" in Path("out/FHGO.h").read_text()
    assert "HGO_FHGO_HISTORY" in Path("out/FHGO.h").read_text()


def test_latex(shell: Shell) -> None:
    """Whatever integrates the run, and without a run."""
    code, out, _ = shell("export", "tank.yaml", "--lang", "latex", "--set", "solver.method=rodas5p")
    assert (code, out) == (0, "FHGO (fhgo2)\n  written: results/tank/FHGO.tex\n")
    assert json.loads(shell("export", "tank.yaml", "--lang", "latex", "--json")[1])["observers"]["FHGO"]["inputs"] == []
    lines = Path("results/tank/FHGO.tex").read_text().replace(r"2 \cdot 3", "6").splitlines()  # by older CasADi
    shown = re.findall(r"```latex\n(.*?)```", PAGE, re.DOTALL)[0]
    assert "\n".join(lines).startswith("\n".join([*lines[:3], shown.strip()]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--lang", "ada"], "--lang: expected one of c, latex"),
        (["--lang", "latex", "--float"], "--float, --late and --inputs-given are for --lang c"),
        (["-o", "tank.yaml"], "--output: expected a folder"),
        (["--observer", "SHGO"], "no observer is called 'SHGO'. Did you mean `FHGO`? Known: FHGO"),
        (["--set", "solver.method=rodas5p"], "rodas5p solves linear equations in every step"),
        (["--late", "-1"], "--late: expected a number of at least 0, found -1"),
    ],
)
def test_what_is_wrong(shell: Shell, arguments: list[str], message: str) -> None:
    code, out, err = shell("export", "tank.yaml", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert not Path("results").exists()


MIXED = """
time: {end: 1, output_step: 0.1}
plant: {states: [x1, x2], dynamics: {x1: x2, x2: -x1}, output: x1, initial: {x1: 1, x2: 0}}
measurement: {sampling: {period: 0.1}, delay: 0.2, noise: [{type: gaussian, std: 0.1}]}
solver: {method: rk4, step: 0.05}
observers:
  S: {type: shgo, theta: 3}
  replayed: {type: shgo, theta: 3, late: replay}
  K: {type: ekf, theta: 2}
"""


def test_one_that_is_not_exported_names_the_way_to_export_the_others(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "mixed.yaml").write_text(MIXED)
    code, _, err = shell("export", "mixed.yaml")
    assert code == 2
    assert "mixed.yaml:8: observers.replayed.late: " in err
    assert "say `late: innovation`, or leave measurement.delay out; to export the others: --observer S\n" in err
    _, _, err = shell("export", "mixed.yaml", "--observer", "K", "--observer", "S")
    assert "innovation`" not in err  # a Kalman filter has none
    code, *_ = shell("export", "mixed.yaml", "--observer", "S")
    assert code == 0
    _, _, err = shell("export", "mixed.yaml", "--observer", "K")
    assert "to export the others" not in err


@pytest.mark.parametrize(
    "block",
    [
        "prescribed_time, T: 1, mu_max: 20, late: replay",
        "super_twisting, f: 20, late: drop",
        "deadbeat, late: drop",
        "red, L: 2, late: drop",
        "eso, omega_o: 5, late: replay",
    ],
)
def test_no_innovation_is_advised_that_does_not_take_late_samples(shell: Shell, tmp_path: Path, block: str) -> None:
    """It was, and refused in its turn with the advice of what had been there."""
    config = (
        MIXED.split("observers:")[0].replace("delay: 0.2, ", "delay: 0.1, ") + f"observers:\n  P: {{type: {block}}}\n"
    )
    (tmp_path / "punctual.yaml").write_text(config)
    code, _, err = shell("export", "punctual.yaml")
    assert code == 2
    assert err.endswith("leaves none out; leave measurement.delay out\n"), err
    (tmp_path / "punctual.yaml").write_text(config.replace("delay: 0.1, ", "").replace(", late: replay", ""))
    assert shell("export", "punctual.yaml")[0] == 0


LOST = """
time: {end: 2, output_step: 0.1}
plant: {states: [x1, x2], dynamics: {x1: x2, x2: -x1 + x2**3/10}, output: x1, initial: {x1: 0.5, x2: 0}}
measurement: {sampling: {period: 0.1}, delay: 0.2}
observers:
  S: {type: shgo, theta: 2}
  lost: {type: shgo, theta: 30, initial: {x2: 50}}
"""


def test_steps_and_history_follow_from_the_exported_observers_alone(shell: Shell, tmp_path: Path) -> None:
    """The files are those of the configuration without the other one, which escapes in finite time at any step."""
    (tmp_path / "run.yaml").write_text(LOST)
    assert "no fixed step reaches" in shell("export", "run.yaml")[2]
    beside = shell("export", "run.yaml", "--observer", "S", "-o", "a")
    alone = shell("export", "run.yaml", "--set", "observers.lost=null", "-o", "b")
    assert (beside[0], beside[1], beside[2]) == (0, alone[1].replace("b/S", "a/S"), "")
    assert Path("a/S.h").read_bytes() == Path("b/S.h").read_bytes()


def test_divergence_and_much_memory_are_told(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text(LOST)
    code, _, err = shell("export", "run.yaml", "--set", "solver={method: rk4, step: 0.1}")
    assert (code, err.count("\n")) == (0, 1)
    assert "run: the exported observer lost diverged at t=" in err
    assert err.endswith("to export the others, with steps of their own: --observer S\n")
    lose = ("--set", "solver={method: rk4, step: 0.1}", "--set", "observers.S={type: shgo, theta: 100}")
    _, _, err = shell("export", "run.yaml", *lose)
    assert err.count("diverged at t=") == 2
    assert "to export the others" not in err
    _, out, err = shell("export", "tank.yaml", "--late", "10", "--set", "solver.step=0.001")
    (size,) = re.findall(r"memory: (\d+) bytes, of which \d+ steps of history", out)
    assert 10_000 * 6 * 8 <= int(size) < 40_000 * 6 * 8  # 10 h of steps with two times and four numbers each
    assert f"hgo_FHGO_observer takes {size} bytes, more than many a stack: declare it static" in err
    assert "Declare it static" in Path("results/tank/FHGO.h").read_text()


def test_a_run_that_cannot_be_followed_is_exported_nevertheless(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text(LOST.replace("x1: 0.5, x2: 0}", "x1: 0.5, x2: 9}"))
    code, _, err = shell("export", "run.yaml", "--set", "solver={method: rk4, step: 0.1}", "--observer", "S")
    assert (code, "what becomes of the exported observers in this run is not known" in err) == (0, True)
