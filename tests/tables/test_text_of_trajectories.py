"""Trajectories as text."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.result.reading import read

CONFIG = """
time: {end: 1, output_step: 0.1, unit: h}
plant:
  states: [a, b]
  dynamics: {a: b, b: -a}
  output: a
  initial: {a: 1, b: 0}
observers:
  o: {type: shgo, theta: 2, poles: -1}
  p: {type: shgo, theta: 3, poles: -1}
"""


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "chain.yaml").write_text(CONFIG)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.costly
def test_a_simulation_is_written_as_text_with_all_digits(shell: Shell) -> None:
    code, out, err = shell("simulate", "chain.yaml", "--export-csv", "chain.csv")
    assert (code, err) == (0, "")
    assert "written: results/chain.h5, chain.csv" in out
    with open(shell.folder / "chain.csv", encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["t", "observer", "a", "b"]
    result = read(shell.folder / "results" / "chain.h5")
    sources = {"plant": result.x} | {label: one.xhat for label, one in result.observers.items()}
    for label, values in sources.items():
        own = np.array([[row[0], *row[2:]] for row in rows if row[1] == label], dtype=float)
        assert own[:, 0].tolist() == [k / 10 for k in range(11)]  # 0.3 where sums have 0.30000000000000004
        assert np.array_equal(own[:, 1:], values)
    assert len(rows) == 3 * result.time.size


@pytest.mark.costly
def test_what_is_undefined_is_an_empty_cell(shell: Shell) -> None:
    code, _, _ = shell(
        "simulate",
        "chain.yaml",
        "--export-csv",
        "x.csv",
        "--set",
        "observers.p.initial.b=1e200",
        "--set",
        "plant.dynamics.b=-a**3",
    )
    assert code == 0
    lines = (shell.folder / "x.csv").read_text().splitlines()
    assert any(line.endswith(",p,,") for line in lines)
    assert not any("nan" in line or "inf" in line for line in lines)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--export-csv", "chain.yaml"), "name another file"),
        (("--export-csv", "results/chain.h5"), "expected a file .csv"),
        (("--export-csv", "x.csv", "--set", "time.output_step=1e-7"), "are in the result file alone"),
        (("--export-csv", "x.csv", "--set", "runs={one: {}, two: {}}"), "takes one run"),
    ],
)
def test_where_no_text_is_written_nothing_runs(shell: Shell, words: tuple[str, ...], said: str) -> None:
    code, out, err = shell("simulate", "chain.yaml", *words)
    assert (code, out) == (2, "")
    assert said in err
    assert not (shell.folder / "results").exists()
