"""What docs/estimate.md shows is what happens."""

from __future__ import annotations

import io
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

PAGE = (Path(__file__).parents[1] / "docs" / "estimate.md").read_text(encoding="utf-8")


def test_the_commands_and_the_code_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (config,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "pendulum.yaml").write_text(config)
    rng, t = np.random.default_rng(6), np.arange(0, 20, 0.1)
    rows = [f"{a:.1f},{np.cos(a) + 0.02 * rng.standard_normal():.4f}" for a in t]
    (tmp_path / "log.csv").write_text("\n".join(["t,encoder", *rows]))
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n0.1,angle,0.9\n"))
    shell = Shell(tmp_path, monkeypatch, capsys)
    commands = re.findall(r"^    hgorun (.*)$", PAGE, re.MULTILINE)
    assert len(commands) == 2
    for command in commands:
        code, out, _ = shell(*shlex.split(command))
        assert code == 0
        assert "holdout_rmse" in out or out.startswith("t,observer,angle,speed,status")
    (code_block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(code_block, {})
    assert capsys.readouterr().out.startswith("[")
