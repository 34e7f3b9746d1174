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


@pytest.mark.costly
def test_the_observer_of_theirs_estimates_what_ours_does(ran: dict[str, object]) -> None:
    result, estimate = ran["result"], ran["estimate"]
    ours = result.observers["SHGO"].xhat  # type: ignore[attr-defined]  # what the page has made
    np.testing.assert_allclose(np.asarray(estimate).T[-5:], ours[-5:], atol=0.05)  # its input is a polygon


def octave(folder: Path, script: str) -> list[float]:
    """The numbers that a script prints."""
    (folder / "script.m").write_text(script)
    done = subprocess.run(
        ["octave", "--no-gui", "--quiet", "script.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return [float(line) for line in done.stdout.split()]


@pytest.mark.skipif(shutil.which("octave") is None, reason="there is no octave here")
def test_octave_reads_a_result(ran: dict[str, object]) -> None:
    import hgorun

    (script,) = blocks("octave")
    folder = Path(str(ran["folder"]))
    result = hgorun.read(folder / "pendulum.h5")
    largest = np.abs(result.observers["SHGO"].xhat - result.x).max(axis=0)
    assert octave(folder, script) == pytest.approx(largest, rel=1e-12)


# Octave has no h5read: what MATLAB's returns, dimensions from the other end, and names, which Octave cannot read.
STAND_INS = {
    "h5read": """
function found = h5read(file, name)
  parts = strsplit(name(2:end), '/');
  if strcmp(name, '/plant_state')
    found = {'angle'; 'speed'};
    return
  end
  found = getfield(load('-hdf5', file, parts{1}), parts{:});
end
""",
    "h5readatt": "function found = h5readatt(file, name, attribute)\n  found = 'rad, rad/s';\nend\n",
}


@pytest.mark.skipif(shutil.which("octave") is None, reason="there is no octave here")
def test_the_lines_for_matlab_run_and_give_a_row_for_every_time(ran: dict[str, object]) -> None:
    import hgorun

    folder = Path(str(ran["folder"]))
    for name, text in STAND_INS.items():
        (folder / f"{name}.m").write_text(text)
    (script,) = blocks("matlab")
    result = hgorun.read(folder / "pendulum.h5")
    largest = np.abs(result.observers["SHGO"].xhat - result.x).max(axis=0)
    told = "printf('%.15g\\n', size(x), numel(t), max(abs(xhat - x)));\n"
    assert octave(folder, script + told) == pytest.approx([*result.x.shape, result.time.size, *largest], rel=1e-12)
