"""No command replaces what it reads: a configuration, one that this extends, a recording, what is held out."""

from __future__ import annotations

import fcntl
import io
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from shell import Shell

from hgorun.errors import ConfigError
from hgorun.files import write_text
from hgorun.originals import is_original, kept_as_they_are, note_originals
from hgorun.result.hdf5.forms import refuse_not_ours
from hgorun.result.reading import read

BASE = """
plant: {states: [a, b], dynamics: {a: b, b: -a}, output: a}
observers: {S: {type: shgo, theta: 2, initial: {a: 0, b: 1}}}
solver: {step: 0.05}
"""
FILES = {
    "base.yaml": BASE,
    "log.csv": "t,a\n" + "".join(f"{k},{k % 3 - 1}\n" for k in range(20)),
    "lab.csv": "t,a\n0.5,1\n1.5,0.5\n",
    "log.yaml": "extends: base.yaml\ndata: {file: log.csv, time: t, outputs: {a: {column: a, std: 0.1}}}\n",
    "sim.yaml": "extends: base.yaml\nplant: {initial: {a: 1, b: 0}}\ntime: {end: 1, output_step: 0.1}\n",
    "sim.bib": "extends: base.yaml\nplant: {initial: {a: 1, b: 0}}\ntime: {end: 1, output_step: 0.1}\n",
    "sweep.yaml": "base: sim.yaml\naxes: {seed: {count: 2}}\n",
    "results/tuned.tuned.yaml": "extends: ../sim.yaml\n",
    "tuned.yaml": "extends: results/tuned.tuned.yaml\n"
    "tune: {gains: {observers.S.theta: {log: [1, 9]}}, minimise: 'rmse(S, b)', seeds: 2, held_out: 2, budget: 30}\n",
    "results/gains.tuned.yaml": "extends: ../log.yaml\n",
    "gains.yaml": "extends: results/gains.tuned.yaml\n"
    "tune: {gains: {observers.S.theta: {log: [1, 9]}}, minimise: 'holdout_rmse(S, a)'}\n",
}
LINKS = {"to_log.csv": "log.csv", "to_base.csv": "base.yaml", "to_base.h5": "base.yaml", "to_base.png": "base.yaml"}


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "results").mkdir()
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    for name, target in LINKS.items():
        (tmp_path / name).symlink_to(target)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("estimate log.yaml --export-samples log.yaml", "--export-samples: log.yaml"),
        ("estimate log.yaml --export-samples base.yaml", "--export-samples: base.yaml"),
        ("estimate log.yaml --export-samples to_base.csv", "--export-samples: to_base.csv"),
        ("estimate log.yaml --export-samples to_log.csv", "--export-samples: to_log.csv"),
        ("estimate log.yaml lab.csv --export-samples lab.csv", "--export-samples: lab.csv"),
        ("estimate log.yaml --export-csv to_log.csv", "--export-csv: to_log.csv"),
        ("estimate log.yaml --holdout a=lab.csv --export-csv lab.csv", "--export-csv: lab.csv"),
        ("estimate log.yaml -o to_base.h5", "--output: to_base.h5"),
        ("estimate log.yaml - --checkpoint base.yaml", "--checkpoint: base.yaml"),
        ("simulate sim.yaml --export-csv to_base.csv", "--export-csv: to_base.csv"),
        ("simulate sim.yaml -o to_base.h5", "--output: to_base.h5"),
        ("sweep sweep.yaml -o to_base.h5", "--output: to_base.h5"),
        ("tune tuned.yaml", "--output: results/tuned.tuned.yaml"),
        ("tune gains.yaml", "--output: results/gains.tuned.yaml"),
        ("cite sim.bib -o sim.bib", "sim.bib"),
        ("compare sim.yaml -o to_base.png", "--output: to_base.png"),
    ],
)
def test_what_is_read_stays(shell: Shell, monkeypatch: pytest.MonkeyPatch, words: str, named: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n0,a,1\n"))
    code, _, err = shell(*words.split())
    assert (code, err) == (
        2,
        f"hgorun: {named} is read, and would be replaced: name another file or folder\n",
    )
    assert {name: (shell.folder / name).read_text() for name in FILES} == FILES


def test_a_result_and_its_text_are_two_files(shell: Shell) -> None:
    (shell.folder / "one.csv").symlink_to("one.h5")
    for command in ("estimate log.yaml", "simulate sim.yaml"):
        code, _, err = shell(*command.split(), "-o", "one.h5", "--export-csv", "one.csv")
        assert code == 2
        assert err == "hgorun: --export-csv: one.csv is to be the file of the result, too: name another file\n"


@pytest.mark.parametrize("words", ["simulate sim.yaml", "estimate log.yaml", "sweep sweep.yaml", "rerun run.h5"])
def test_a_file_of_numbers_of_somebody_else_stays(shell: Shell, words: str) -> None:
    with h5py.File(shell.folder / "lab.h5", "w") as file:
        file["a"] = np.arange(3.0)
    before = (shell.folder / "lab.h5").read_bytes()
    assert shell(*words.split(), "-o", "lab.h5") == (
        2,
        "",
        "hgorun: --output: lab.h5 is an HDF5 file that hgorun has not written, such as a recording, and would be "
        "replaced: name another file, or remove this one first\n",
    )
    assert (shell.folder / "lab.h5").read_bytes() == before


def test_only_files_of_numbers_that_can_be_read_stay(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    for head in (b"", b"notes", b"\x89HDF\r\n\x1a\n of one that is cut off"):
        path.write_bytes(head)
        refuse_not_ours(path, "save")
    path.write_bytes(b"CDF\x01")
    with pytest.raises(ConfigError, match=r"save: .*run\.h5 is netCDF of the old kind that hgorun has not written"):
        refuse_not_ours(path, "save")


def test_a_recording_that_is_being_written_stays(shell: Shell) -> None:
    """As by a logger that keeps it open; what it writes later would be lost with the file."""
    with h5py.File(shell.folder / "log.h5", "w") as file:
        file["a"] = np.arange(3.0)
    with (shell.folder / "log.h5").open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # as HDF5 does
        code, _, err = shell("simulate", "sim.yaml", "-o", "log.h5")
    said = (
        "hgorun: --output: log.h5 would be replaced, and another program has it open for writing: name another file\n"
    )
    assert (code, err) == (2, said)
    with h5py.File(shell.folder / "log.h5") as file:
        assert list(file) == ["a"]


def test_a_result_is_not_made_again_in_its_own_place(shell: Shell) -> None:
    assert shell("simulate", "sim.yaml", "-o", "run.h5", "-q")[0] == 0
    (shell.folder / "same.h5").symlink_to("run.h5")
    before = (shell.folder / "run.h5").read_bytes()
    code, _, err = shell("rerun", "run.h5", "-o", "same.h5")
    assert (code, err) == (
        2,
        "hgorun: --output: same.h5 is read, and would be replaced: name another file or folder\n",
    )
    assert (shell.folder / "run.h5").read_bytes() == before
    with h5py.File(shell.folder / "lab.h5", "w") as file:
        file["a"] = np.arange(3.0)
    with pytest.raises(ConfigError, match=r"save: lab\.h5 is an HDF5 file that hgorun has not written"):
        read("run.h5").save("lab.h5")
    read("run.h5").save("run.h5")  # in Python they know


def test_files_are_noted_while_a_command_runs(tmp_path: Path) -> None:
    file, gone, other = tmp_path / "file", tmp_path / "gone", tmp_path / "other"
    other.write_text("")
    file.write_text("")
    note_originals([file])
    assert not is_original(file)  # in Python, whoever reads a file may write it
    with kept_as_they_are():
        with kept_as_they_are():
            note_originals([gone, file])
        assert [is_original(path) for path in (file, gone, other)] == [True, False, False]
        write_text(other, "new")
    assert not is_original(file)
