"""What docs/tuning.md shows is what happens."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from shell import Shell

from hgorun import load

PAGE = (Path(__file__).parents[1] / "docs" / "tuning.md").read_text(encoding="utf-8")


@pytest.mark.costly
def test_the_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    small = (
        file.replace("seeds: 20", "seeds: 2")
        .replace("held_out: 50", "held_out: 4")
        .replace("budget: 2000", "budget: 60")
    )
    (tmp_path / "pendulum.yaml").write_text(small)
    shell = Shell(tmp_path, monkeypatch, capsys)
    commands = re.findall(r"^    hgorun (.*)$", PAGE, re.MULTILINE)
    assert len(commands) == 2
    for command in commands:
        assert shell(*shlex.split(command), "-q")[::2] == (0, "")
    tuned = load(tmp_path / "results" / "pendulum.tuned.yaml")
    assert {o.theta for o in tuned.observers.values()}.isdisjoint({2.0})  # type: ignore[attr-defined]  # of both families
    text = (tmp_path / "results" / "pendulum.tuned.yaml").read_text()
    assert text.count("# the standard one") == text.count("# with a filter") == 1
