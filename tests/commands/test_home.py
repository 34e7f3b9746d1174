"""A home that cannot be written is no hindrance."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
from shell import Shell

DRAW = "import hgorun.cli; hgorun.cli._show_warnings(); import matplotlib; print(matplotlib.get_cachedir())"


def test_matplotlib_says_nothing_of_a_home_that_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("a file")
    inherited = {k: v for k, v in os.environ.items() if k not in {"MPLCONFIGDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"}}
    home = str(tmp_path / "home")
    found = subprocess.run(
        [sys.executable, "-c", DRAW],
        env={**inherited, "HOME": home, "USERPROFILE": home},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (found.stderr, home in found.stdout) == ("", False)


def test_what_else_it_says_is_shown(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    Shell(tmp_path, monkeypatch, capsys)("list")
    logging.getLogger("matplotlib").warning("a font is missing")
    assert "a font is missing" in caplog.text
