"""The code of docs/interop.md runs, also in Octave where there is one."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "interop.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """What the Python of the page leaves, one block after the other."""
    pytest.importorskip("control")
    folder = tmp_path_factory.mktemp("page")
    found: dict[str, object] = {"folder": folder}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in blocks("python"):
            exec(block, found)  # of this repository
    return found


def test_the_observer_of_theirs_estimates_what_ours_does(ran: dict[str, object]) -> None:
    result, estimate = ran["result"], ran["estimate"]
    ours = result.observers["SHGO"].xhat  # type: ignore[attr-defined]  # what the page has made
    np.testing.assert_allclose(np.asarray(estimate).T[-5:], ours[-5:], atol=0.05)  # its input is a polygon


@pytest.mark.skipif(shutil.which("octave") is None, reason="there is no octave here")
def test_octave_reads_a_result(ran: dict[str, object], tmp_path: Path) -> None:
    import hgorun

    (script,) = blocks("octave")
    folder = Path(str(ran["folder"]))
    (folder / "read.m").write_text(script)
    done = subprocess.run(
        ["octave", "--no-gui", "--quiet", "read.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    result = hgorun.read(folder / "pendulum.h5")
    largest = np.abs(result.observers["SHGO"].xhat - result.x).max(axis=0)
    assert [float(line) for line in done.stdout.split()] == pytest.approx(largest, rel=1e-12)
