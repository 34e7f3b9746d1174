"""What docs/estimate.md shows is what happens."""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from broker import Broker
from shell import Shell

PAGE = (Path(__file__).parents[1] / "docs" / "estimate.md").read_text(encoding="utf-8")


@pytest.mark.costly
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
    commands = [one for one in re.findall(r"^    hgorun (.*)$", PAGE, re.MULTILINE) if "mqtt:" not in one]
    assert len(commands) == 3
    for command in commands:
        first, *then = command.split(" | hgorun ")
        code, out, _ = shell(*shlex.split(first))
        for piped in then:
            monkeypatch.setattr(sys, "stdin", io.StringIO(out))
            code, out, _ = shell(*shlex.split(piped))
            assert out.count("\n") == 2 * len(rows) + 1
        assert code == 0
        assert "holdout_rmse" in out or out.startswith("t,observer,angle,speed,status")
    (code_block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(code_block, {})
    assert capsys.readouterr().out.startswith("[")


@pytest.mark.slow
def test_the_example_with_a_broker_runs(tmp_path: Path) -> None:
    (config,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "pendulum.yaml").write_text(config)
    (command,) = re.findall(r"^    hgorun (estimate .*mqtt:.*)$", PAGE, re.MULTILINE)
    published = re.findall(r"^    mosquitto_pub -q 1 -t (\S+) -m '(.*)'$", PAGE, re.MULTILINE)
    ((to, estimate),) = re.findall(r"second one publishes to `(.*)`\n\n    (\{.*)$", PAGE, re.MULTILINE)
    with Broker() as broker:
        words = shlex.split(command.replace("localhost", f"127.0.0.1:{broker.port}"))
        process = subprocess.Popen(
            [sys.executable, "-m", "hgorun", *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        )
        broker.wait_until(lambda: any(one.topics for one in broker.sessions.values()))
        for topic, payload in published:
            broker.publish(topic, payload)
        broker.wait_until(lambda: not broker.unacknowledged)
        process.terminate()
        process.wait()
    found = [text for name, text in broker.received if name == to]
    assert len(found) == 4  # two samples, two observers
    assert found[2] == estimate


@pytest.mark.costly
def test_the_gains_of_the_page_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (config,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (tune,) = re.findall(r"```text\n(tune:.*?)```", PAGE, re.DOTALL)
    (tmp_path / "pendulum.yaml").write_text(config + tune)
    t = np.arange(0, 6, 0.1)
    rows = [f"{a:.1f},{np.cos(a) + 0.02 * np.sin(37.3 * a * a):.4f}" for a in t]
    (tmp_path / "log.csv").write_text("\n".join(["t,encoder", *rows]))
    code, out, err = Shell(tmp_path, monkeypatch, capsys)("tune", "pendulum.yaml")
    assert code == 0, err
    assert "holdout_rmse angle: search" in out
    assert (tmp_path / "results" / "pendulum.tuned.yaml").is_file()
