"""hf where its moving mean is of one point: 0 whatever the error is, which no verdict and no gain may follow from."""

from __future__ import annotations

from pathlib import Path

import pytest
from shell import Shell

BASE = """time: {{end: 2, output_step: {step}, unit: s}}
plant:
  states: [x, v]
  dynamics: {{x: v, v: -x}}
  output: x
  initial: {{x: 1, v: 0}}
measurement:
  sampling: {{period: 0.05}}
  noise: [{{type: gaussian, std: 0.02}}]
observers:
  S: {{type: shgo, theta: 4, initial: {{x: 0.5}}}}
solver: {{step: 0.005}}
"""
CLAIM = "claims:\n  - {id: '1', claim: smooth, source: own, value: \"hf('S', v)\", below: 0.0001}\n"
TUNE = """base: base.yaml
tune:
  gains: {observers.S.theta: {log: [1, 30]}}
  minimise: hf(S, v)
  seeds: 4
  held_out: 8
  budget: 60
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.costly
@pytest.mark.parametrize(("step", "said", "verdict"), [(0.02, True, "undecidable"), (0.01, False, "refuted")])
def test_a_mean_of_one_point_is_told_and_has_no_verdict(shell: Shell, step: float, said: bool, verdict: str) -> None:
    (shell.folder / "base.yaml").write_text(BASE.format(step=step) + CLAIM)
    code, out, _ = shell("simulate", "base.yaml", "--set", "metrics.average=0.02")
    assert code == 0
    assert ("hf is 0 whatever the error is" in " ".join(out.split())) is said
    _, out, _ = shell("claims", "base.yaml")
    assert f"1 {verdict}" in out.splitlines()[-1]


def test_it_is_not_tuned(shell: Shell) -> None:
    (shell.folder / "base.yaml").write_text(BASE.format(step=0.02))
    (shell.folder / "tune.yaml").write_text(TUNE)
    code, _, err = shell("tune", "tune.yaml")
    assert code == 2
    assert "tune.yaml:4: tune.minimise" in err
    assert "hf is 0 for all gains" in err
    assert "metrics.average" in err
