"""Figures and claims of many files: only what is stale is made, and nothing is lost by an interruption."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import matplotlib.image
import pytest

from hgorun import read_sweep
from hgorun.commands.catalogue_options import Figures
from hgorun.commands.figures import figures
from hgorun.config.study import WIDTHS
from hgorun.errors import ConfigError
from hgorun.files import _MACHINE, remove_leftovers, written_whole
from hgorun.reproduce import pool
from hgorun.reproduce.choice import choose
from hgorun.reproduce.job import Folders
from hgorun.reproduce.report import write_report
from hgorun.version import __version__

FILE = """\
title: {name}
time: {{end: 3, output_step: 0.01}}
plant: {{type: integrator_chain, n: 2, phi: -x1, initial: {{x1: 1, x2: 0}}}}
measurement: {{noise: [{{type: uniform, low: -1, high: 1, hold: 0.05}}]}}
observers: {{A: {{type: shgo, theta: 2}}}}
solver: {{step: {step}}}
runs:
  one: {{}}
  many: {{seeds: {seeds}}}
figures:
  first: {{panels: [{{state: x1, observers: [one/A]}}]}}
  second: {{panels: [{{error: x2, observers: [one/A]}}]}}
claims:
  - {{id: "1", claim: The error is small | really., figure: first, value: "rmse('one/A', x1)", below: 1}}
  - {{id: "2", claim: So is its mean., value: "rmse('many/A', x1)", below: 1e-3, expect: refuted}}
"""


def files(folder: Path) -> dict[str, bytes]:
    """All files but the blocks of ensembles with their bytes; a run's file by its data, since it carries a date."""

    def content(path: Path) -> bytes:
        if path.suffix != ".h5" or path.name.endswith(".sweep.h5"):
            return path.read_bytes()
        with h5py.File(path) as file:
            attributes = {k: str(v) for k, v in file.attrs.items() if k != "created"}
            return json.dumps(attributes, sort_keys=True).encode() + file["observers/A/xhat"][()].tobytes()

    paths = [p for p in sorted(folder.rglob("*")) if p.is_file() and "many.sweep" not in p.parts]
    return {str(p.relative_to(folder)): content(p) for p in paths}


def studies(folder: Path, count: int = 2, seeds: int = 3, step: float = 0.01) -> list[str]:
    paths = [folder / f"study{i}.yaml" for i in range(count)]
    for path in paths:
        path.write_text(FILE.format(name=path.stem, seeds=seeds, step=step))
    return [str(p) for p in paths]


def made(names: list[str], output: Path, workers: int = 1) -> list[str]:
    """Make everything; what was stale."""
    works = choose(names, Folders.below(output), figures=True, claims=True)
    stale = [f"{w.study.name}/{part}" for w in works for part in (*w.stale_figures, *w.stale_claims)]
    outcomes = pool.run_all(works, workers=workers, show=False)
    write_report(works, outcomes, Folders.below(output))
    return stale


@pytest.mark.slow
def test_a_second_time_nothing_is_made(tmp_path: Path) -> None:
    names, output = studies(tmp_path), tmp_path / "out"
    assert len(made(names, output)) == 8
    before = {p: p.stat().st_mtime_ns for p in output.rglob("*") if p.is_file() and p.name != "REPORT.md"}
    assert made(names, output) == []
    assert {p: p.stat().st_mtime_ns for p in before} == before


@pytest.mark.slow
def test_only_what_changed_is_made(tmp_path: Path) -> None:
    (name,), output = studies(tmp_path, count=1), tmp_path / "out"
    made([name], output)
    path, original = Path(name), Path(name).read_text()
    path.write_text(original.replace("error: x2", "error: x1"))
    assert made([name], output) == ["study0/second"]
    path.write_text(original.replace("below: 1}", "below: 0.5}").replace("error: x2", "error: x1"))
    assert made([name], output) == []  # the threshold is compared anew, nothing has to run
    path.write_text(original.replace("theta: 2", "theta: 3"))
    assert len(made([name], output)) == 4
    (output / "study0" / "first.pdf").unlink()
    assert made([name], output) == ["study0/first"]


@pytest.mark.slow
def test_processes_give_the_same_files_as_one(tmp_path: Path) -> None:
    names = studies(tmp_path)
    made(names, tmp_path / "one", workers=1)
    made(names, tmp_path / "two", workers=2)
    assert files(tmp_path / "one") == files(tmp_path / "two")


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_killed_in_the_middle_and_started_again(tmp_path: Path, how: signal.Signals) -> None:
    names = studies(tmp_path, count=2, seeds=400, step=2e-4)
    made(names, tmp_path / "whole")
    command = [sys.executable, "-m", "hgorun.cli", "figures", "--report", *names, "-o", str(tmp_path / "broken")]
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not list((tmp_path / "broken").rglob("many.sweep/blocks/*.h5")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.killpg(process.pid, how)
    process.communicate(timeout=30)
    assert process.returncode == (130 if how == signal.SIGINT else -signal.SIGKILL)
    assert not (tmp_path / "broken" / "REPORT.md").exists()
    assert made(names, tmp_path / "broken") != []
    assert files(tmp_path / "broken") == files(tmp_path / "whole")


@pytest.mark.slow
def test_the_report_says_what_was_measured(tmp_path: Path) -> None:
    names, output = studies(tmp_path, count=1), tmp_path / "out"
    made(names, output)
    report = (output / "REPORT.md").read_text()
    assert "| 1 | The error is small \\| really. |" in report
    assert "**refuted**" in report
    assert "claims: 1 confirmed" in report
    assert (output / "report" / "study0" / "first.png").stat().st_size < 60_000


@pytest.mark.slow
def test_a_damaged_state_is_made_anew(tmp_path: Path) -> None:
    names, output = studies(tmp_path, count=1), tmp_path / "out"
    made(names, output)
    state = output / "runs" / "study0" / "state.json"
    state.write_text('{"runs": 3, "figures": {"first": [1]}}')
    assert len(made(names, output)) == 4


@pytest.mark.measured
@pytest.mark.slow
def test_trajectories_of_an_ensemble_are_drawn(tmp_path: Path) -> None:
    (name,), output = studies(tmp_path, count=1), tmp_path / "out"
    path = Path(name)
    path.write_text(path.read_text().replace("{error: x2, observers: [one/A]}", "{error: x2, run: many}"))
    assert made([name], output) == ["study0/first", "study0/second", "study0/0", "study0/1"]
    assert (output / "study0" / "second.png").stat().st_size > 10_000
    collected = read_sweep(output / "runs" / "study0" / "many.sweep.h5")
    assert collected.trajectories is not None
    assert collected.trajectories.member.tolist() == [0, 1, 2]
    assert made([name], output) == []


@pytest.mark.costly
def test_leftovers_of_dead_processes_go_and_of_living_ones_stay(tmp_path: Path) -> None:
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    (tmp_path / f".a.png-{_MACHINE}-{dead.pid}-abc_d.part").touch()
    (tmp_path / ".note.part").touch()
    with written_whole(tmp_path / "b.png") as part:
        remove_leftovers(tmp_path)
        assert sorted(p.name for p in tmp_path.iterdir()) == sorted([".note.part", part.name])
        part.write_text("b")
    assert (tmp_path / "b.png").read_text() == "b"


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="makes a pseudo-terminal")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_person_at_a_terminal_sees_progress(tmp_path: Path, jobs: str) -> None:
    import pty

    names = studies(tmp_path, seeds=2000, step=1e-4)  # takes longer than the bar waits
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "hgorun.cli", "claims", *names, "-o", str(tmp_path / "out"), "--jobs", jobs]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, text=True)
    os.close(theirs)
    seen = b""
    while True:
        try:
            part = os.read(ours, 4096)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        seen += part
    out, _ = process.communicate(timeout=60)
    os.close(ours)
    assert process.returncode == 0
    assert b"100 %" in seen
    # of the two files, whichever spoke last when the bar was drawn
    assert any(name in seen for name in (b"study0: ", b"study1: "))
    assert "4 claims: 2 confirmed, 2 refuted" in out
    assert "%" not in out.replace("95 %", "")


@pytest.mark.slow
def test_a_figure_that_is_drawn_again_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (name,), output = studies(tmp_path, count=1), tmp_path / "out"
    path, original = Path(name), Path(name).read_text()

    def reasons() -> dict[str, str | None]:
        assert figures(Figures(names=[name], output=output, json=True, jobs=1)) == 0
        return {row["figure"]: row["reason"] for row in json.loads(capsys.readouterr().out)}

    assert reasons() == {"first": "for the first time in this folder", "second": "for the first time in this folder"}
    assert reasons() == {"first": None, "second": None}
    path.write_text("# a comment\n" + original.replace("title: study0", "title: Another title"))
    assert reasons() == {"first": None, "second": None}
    path.write_text(original.replace("theta: 2", "theta: 3").replace("error: x2", "error: x1"))
    assert reasons() == dict.fromkeys(("first", "second"), "configuration of run one changed")
    path.write_text(original.replace("theta: 2", "theta: 3"))
    assert reasons() == {"first": None, "second": "the figure's block changed"}
    (output / "study0" / "first.pdf").unlink()
    assert reasons() == {"first": "file missing: first.pdf", "second": None}
    state = output / "runs" / "study0" / "state.json"
    state.write_text(state.read_text().replace(f'"hgorun": "{__version__}"', '"hgorun": "0.0.9"'))
    assert reasons()["first"] == f"hgorun 0.0.9 -> {__version__}"
    state.write_text(json.dumps({"figures": {"first": {"key": "0123", "files": []}}}))
    assert reasons() == {"first": "made by another version of hgorun", "second": "for the first time in this folder"}
    (output / "study0" / "first.pdf").unlink()
    assert figures(Figures(names=[name], output=output, jobs=1)) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert "; drawn: file missing: first.pdf)" in first
    assert "; drawn" not in second


def test_figures_for_another_page_are_drawn_again_and_are_as_wide(tmp_path: Path) -> None:
    """A column of a journal and a dark page, which no file says; the panels stand one below the other."""
    (name,), output = studies(tmp_path, count=1), tmp_path / "out"
    assert figures(Figures(names=[name], output=output, quiet=True, jobs=1, width="one", style="dark")) == 0
    picture = matplotlib.image.imread(output / "study0" / "first.png")
    assert picture.shape[1] == round(WIDTHS["one"] * 300)
    assert picture[0, 0, :3].max() < 0.2
    state = (output / "runs" / "study0" / "state.json").read_text()
    works = choose([name], Folders.below(output), figures=True, claims=False, width="one", style="dark")
    assert works[0].stale_figures == {}
    assert {block.columns for block in works[0].study.figures.values()} == {1}
    assert set(choose([name], Folders.below(output), figures=True, claims=False)[0].stale_figures.values()) == {
        "the figure's block changed"
    }
    assert (output / "runs" / "study0" / "state.json").read_text() == state
    with pytest.raises(ConfigError, match=r"--style: expected one of light, dark, found 'grey'"):
        choose([name], Folders.below(output), figures=True, claims=False, style="grey")
