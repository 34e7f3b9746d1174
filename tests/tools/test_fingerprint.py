"""The tool that compares all numbers ends, with its reason, where the processes that do its work cannot."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "fingerprint.py"

# The tool as a module that its workers find in a file of its own name only: what that file does, they do.
SCRIPT = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("other", sys.argv[1])
tool = importlib.util.module_from_spec(spec)
sys.modules["other"] = tool
spec.loader.exec_module(tool)
tool.START = float(sys.argv[2])
sys.argv[1:] = ["--only", "katayama"]
sys.exit(tool.main())
"""


@pytest.mark.costly
@pytest.mark.parametrize(
    ("source", "limit", "reason"),
    [
        ("raise ImportError", "60", "a worker ended before its work was done"),
        ("import time; time.sleep(600)", "1", "the workers did not answer within 1 s"),
    ],
    ids=["fails", "hangs"],
)
def test_workers_that_cannot_import_are_not_waited_for(source: str, limit: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "other.py").write_text(source)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, TOOL, limit],
        cwd=TOOL.parents[1],  # from which -c imports the hgorun of this checkout
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 1
    assert f"failed: {reason}" in done.stderr
    assert not done.stdout
