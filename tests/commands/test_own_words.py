"""Mistakes that were told in a library's words, at another key, or not at all."""

from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.tables.trajectories import _on_grid

CONFIG = """time: {end: 1, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics:
    x1: x2
    x2: -x1
  output: x1
  initial: {x1: 1, x2: 0}
measurement: {sampling: {period: 0.1}}
solver: {step: 0.05}
observers:
  FHGO: {type: fhgo2, theta: 3, r: 1}
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("output: x1", "output: angle", "c.yaml:7: plant.output: `angle` is not known. Known names: t, x1, x2"),
        ("output: x1", "output: [x1, angle]", "c.yaml:7: plant.output: `angle` is not known."),
        ("output: x1", "output: {a: angle}", "c.yaml:7: plant.output.a: `angle` is not known."),
        (  # a misspelt state is likelier there than an input
            "output: x1",
            "output: 2*X2",
            "c.yaml:7: plant.output: `2*X2`: `X2` is not known. Did you mean `x2`? States: x1, x2; an input is",
        ),
        (
            "x2: -x1\n",
            "x2: -x1 + pump\n",
            "c.yaml:6: plant.dynamics.x2: `-x1 + pump`: `pump` is not known. Known names: t, x1, x2, pi, e; an input "
            "is declared in plant by inputs: {pump: expression of t}, a constant by parameters: {pump: number}; an "
            "input that was recorded, in data by inputs: {pump: column}\n",
        ),
        ("theta: 3", "theta: 3e400", "c.yaml:12: observers.FHGO.theta: 3e400 is larger than any number (1.8e308)"),
        ("theta: 3", "theta: .inf", "c.yaml:12: observers.FHGO.theta: the number inf is not finite"),
        ("x2: -x1", "x2: -x1*1e400", "c.yaml:6: plant.dynamics.x2: `-x1*1e400`: 1e400 is larger than any number"),
        ("    x2: -x1\n", "", "c.yaml:4: plant.dynamics: the right-hand side of x2 is missing: write a line `x2: ...`"),
        ("theta: 3", "theta: eight", "c.yaml:12: observers.FHGO.theta: `eight` is not a number."),
        (
            "type: fhgo2, ",
            "",
            "observers.FHGO: type is missing: the label FHGO is a name of your own, the type one from",
        ),
        ("type: fhgo2, ", "", "such as fhgo1, fhgo2 or fhgo2_nuos\n"),
        (
            "observers:",
            "data: log.csv\nobservers:",
            "write data: {file: log.csv, time: COLUMN, outputs: {NAME: COLUMN}}",
        ),
    ],
)
def test_file_line_key_and_what_would_be_right(shell: Shell, right: str, wrong: str, said: str) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG.replace(right, wrong, 1))
    code, out, err = shell("simulate", "c.yaml")
    assert (code, out) == (2, "")
    assert said in err


@pytest.mark.costly
def test_samples_that_change_places_are_told(shell: Shell) -> None:
    for jitter, told in ((0.05, False), (0.06, True)):  # neighbours keep their order up to half a period
        (shell.folder / "c.yaml").write_text(CONFIG.replace("period: 0.1", f"period: 0.1, jitter: {jitter}"))
        code, _, err = shell("simulate", "c.yaml", "-q")
        assert (code, "is more than half of the period 0.1, so that samples change places" in err) == (0, told)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("content", "name", "said"),
    [
        (b"", "a.h5", "it is empty"),
        (b"time,y\n0,1\n", "a.csv", "it is a table of data; a configuration names it under data.file"),
        (b"PK\x03\x04\0\0", "a.h5", "it is a ZIP archive or a workbook of Excel, not HDF5"),
        (b"words\n", "a.h5", "it is text, not HDF5"),
        (b"\x01\0\x02", "a.h5", "it is a file of another kind, not HDF5"),
    ],
)
def test_a_file_that_is_no_result_is_told_by_what_it_is(shell: Shell, content: bytes, name: str, said: str) -> None:
    (shell.folder / name).write_bytes(content)
    code, _, err = shell("rerun", name)
    assert code == 2
    assert f"{name}: not a file of hgorun: {said}" in err


def test_an_empty_configuration_in_place_of_a_result_is_called_empty(shell: Shell) -> None:
    """It cannot be simulated, as another one could."""
    (shell.folder / "a.yaml").write_bytes(b"")
    assert shell("report", "a.yaml")[2].startswith("hgorun: a.yaml: the file is empty;")


def test_merge_takes_folders(shell: Shell) -> None:
    (shell.folder / "a.h5").write_bytes(b"x")
    code, _, err = shell("merge", "a.h5")
    assert (code, "a.h5: this is a file; merge takes the folders NAME.sweep" in err) == (2, True)


def test_times_of_an_even_grid_print_short() -> None:
    grid = np.cumsum(np.full(250, 0.1)) - 0.1  # 24.699999999999... among them
    assert repr(float(grid[247])) != "24.7"
    assert [repr(t) for t in _on_grid(grid).tolist()] == [repr(k / 10) for k in range(250)]
    thirds = np.arange(9) / 3
    assert _on_grid(thirds).tolist() == thirds.tolist()
    uneven = np.array([0.0, 0.1234567890123, 7.0])
    assert _on_grid(uneven)[[0, 2]].tolist() == [0.0, 7.0]
    assert np.abs(_on_grid(uneven) - uneven).max() <= 1e-13
