"""A log as lines of a stream: the stream has the estimates of the log."""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.result.reading import read

CONFIG = """
plant:
  states: [a, b]
  dynamics: {a: b, b: u - a}
  output: {y: a}
  units: {y: m}
time: {start: 0, end: 4, output_step: 0.1}
solver: {step: 0.02}
data:
  file: log.csv
  time: t
  outputs: {y: {column: level, unit: cm, std: 0.02LATE}}
  inputs: {u: force}
observers:
  o: {type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}
"""


@pytest.fixture(name="shell")
def in_folder(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
) -> Shell:
    late = request.param
    shell = Shell(tmp_path, monkeypatch, capsys)
    t = np.arange(0, 4.05, 0.1)
    known = t + np.where(np.arange(t.size) % 7 == 3, 0.25, 0)
    columns = zip(t, 100 * np.sin(t), np.cos(t), known, strict=True)
    rows = [f"{a:.1f},{level:.3f},{force:.2f},{b:.2f}" for a, level, force, b in columns]
    (shell.folder / "log.csv").write_text("t,level,force,known\n" + "\n".join(rows) + "\n")
    (shell.folder / "case.yaml").write_text(CONFIG.replace("LATE", ", available: known" if late else ""))
    return shell


@pytest.mark.measured("True")
@pytest.mark.slow
@pytest.mark.parametrize("shell", [False, True], indirect=True)
def test_a_stream_of_the_samples_has_the_estimates_of_the_log(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    code, text, err = shell("estimate", "case.yaml", "--export-samples", "-")
    assert (code, err) == (0, "")
    header, *rows = csv.reader(io.StringIO(text))
    late = "available" in header
    assert header == ["t", "signal", "y", *(["available"] if late else [])]
    assert len(rows) == 2 * 41
    known = [float(row[3] if late else row[0]) for row in rows]
    assert known == sorted(known)
    levels = [float(row[2]) for row in rows if row[1] == "y"]
    assert max(map(abs, levels)) < 1.01  # in metres, as the model has them
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    code, out, _ = shell("estimate", "case.yaml", "-")
    assert code == 0
    assert shell("estimate", "case.yaml", "--no-plots")[0] == 0
    result = read(shell.folder / "results" / "case.h5")
    last = {float(row[0]): row for row in csv.reader(out.splitlines()[1:])}  # the last line of each time
    for t in (1.0, 2.0, 3.0):
        k = int(np.argmin(np.abs(result.time - t)))
        nearest = last[min(last, key=lambda at, t=t: abs(at - t))]  # type: ignore[misc]  # bound at once
        assert [float(v) for v in nearest[2:4]] == pytest.approx(result.observers["o"].xhat[k], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("shell", [False], indirect=True)
def test_into_a_file_that_is_not_read(shell: Shell) -> None:
    code, out, _ = shell("estimate", "case.yaml", "--export-samples", "samples.csv")
    assert (code, out) == (0, "written: samples.csv\n")
    assert (shell.folder / "samples.csv").read_text().startswith("t,signal,y\n")
    assert not (shell.folder / "results").exists()
    code, _, err = shell("estimate", "case.yaml", "--export-samples", "log.csv")
    assert code == 2
    assert "is read" in err


@pytest.mark.parametrize("shell", [False], indirect=True)
def test_faults_of_the_log_are_told(shell: Shell) -> None:
    with (shell.folder / "log.csv").open("a") as file:
        file.write("4,0,0,4\n")  # as in the line before
    repeated = ("--set", "data.faults.repeated=first")
    code, _, err = shell("estimate", "case.yaml", *repeated, "--export-samples", "samples.csv")
    assert code == 0
    assert (
        "case: log.csv:43: outputs.y, inputs.u: 1 sample (first): the time stamp 4 s has come before, on line 42" in err
    )


@pytest.mark.parametrize("shell", [False], indirect=True)
@pytest.mark.parametrize("beside", [["--export-csv", "e.csv"], ["-o", "r.h5"], ["--holdout", "y=5"]])
def test_nothing_that_it_does_not_write_is_taken_beside_it(shell: Shell, beside: list[str]) -> None:
    code, _, err = shell("estimate", "case.yaml", "--export-samples", "samples.csv", *beside)
    assert code == 2
    assert "leave out --holdout, --export-csv and --output" in err
    assert not (shell.folder / "samples.csv").exists()
