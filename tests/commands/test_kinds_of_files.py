"""A file that a command cannot take is told by what it is, with the command that takes it."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest
from shell import Shell

from hgorun.config.kinds import HEAD, kind_of_file
from hgorun.config.yaml_source import MAX_BYTES

CONFIG = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {S: {type: shgo, theta: 2}}
"""
# How the files of other programs begin, as their formats say.
OTHERS = {
    "x.png": (b"\x89PNG\r\n\x1a\n\0", "this is a picture (PNG), not a configuration; a YAML file was expected"),
    "x.yaml": (b"\xff\xd8\xff\xe0", "this is a picture (JPEG)"),
    "x.pdf": (b"%PDF-1.7\n%\xd0\xd4", "this is a PDF"),
    "x.xlsx": (
        b"PK\x03\x04\x14\0",
        "workbook of Excel, not a configuration; if it holds measurements: save the",
    ),
    "x.pkl": (b"\x80\x04\x95\x0b\0", "this is a pickle of Python"),
    "x.npy": (b"\x93NUMPY\x01\0", "numpy.savetxt writes CSV"),
    "x.mat": (b"MATLAB 5.0 MAT-file, Platform\0", "this is a file of MATLAB (.mat) that is not HDF5"),
    "y.mat": (b"MATLAB 7.3 MAT-file, Platform\0", "this is a file of MATLAB (.mat) that is cut off"),
    "p.csv": (b"PAR1,t\n1,0\n", "this is a log, not a configuration: hgorun estimate CONFIG p.csv runs"),
    "x.csv.gz": (
        b"\x1f\x8b\x08\0",
        "this is compressed by gzip, not a configuration; if it holds measurements: un",
    ),
    "x.db": (b"SQLite format 3\0", "this is an SQLite database"),
    "x.parquet": (
        b"PAR1\x15\x04",
        "this is a log, not a configuration: hgorun estimate CONFIG x.parquet runs",
    ),
    "x.txt": (b"t;y\n0;1,5\n", "this is a log, not a configuration: hgorun estimate CONFIG x.txt runs observers"),
    "x.npz": (b"PK\x03\x04" + bytes(22) + b"\x05\0\0\0a.npy", "this is arrays of NumPy (.npz), as a checkpoint"),
    "x.py": (b"import hgorun\n", "this is a program of Python, not a configuration: python x.py runs it"),
    "x.md": (b"# Title\n", "this is a page to read, not a configuration: hgorun init copies an example"),
    "y.yaml": (b"a,b\n0,1\n" * MAX_BYTES, "this is a log, not a configuration"),
}
WANTS_A_CONFIGURATION = ("simulate", "compare", "analyze", "export", "explore", "sweep", "benchmark", "cite", "figures")


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "a.yaml").write_text(CONFIG)
    (tmp_path / "s.yaml").write_text("base: a.yaml\naxes: {observers.S.theta: [2, 3]}\n")
    return Shell(tmp_path, monkeypatch, capsys)


def _hdf5(path: Path, form: str | None = None) -> None:
    with h5py.File(path, "w") as file:
        file["y"] = [1.0, 2.0]
        if form is not None:
            file.attrs["format"] = form


@pytest.mark.parametrize("name", OTHERS)
def test_a_file_of_another_program_is_told_by_its_first_bytes(shell: Shell, name: str) -> None:
    content, said = OTHERS[name]
    (shell.folder / name).write_bytes(content)
    code, out, err = shell("simulate", name)
    assert (code, out, err.startswith(f"hgorun: {name}: ")) == (2, "", True), err
    assert said in err


@pytest.mark.parametrize("command", WANTS_A_CONFIGURATION)
def test_every_command_says_it(shell: Shell, command: str) -> None:
    (shell.folder / "x.png").write_bytes(OTHERS["x.png"][0])
    code, _, err = shell(command, "x.png")
    assert (code, err) == (2, "hgorun: x.png: " + OTHERS["x.png"][1] + "\n")


@pytest.mark.parametrize("words", ["time: {end: 1, output_step: 0.1}\n", "a: [1,\n  2,\n  3]\n", "1\n", "# 1,2\n", ""])
def test_a_configuration_is_no_table(shell: Shell, words: str) -> None:
    (shell.folder / "c.yaml").write_text(words)
    assert "log" not in shell("simulate", "c.yaml")[2]


@pytest.mark.parametrize(("command", "key"), [("estimate", "data"), ("tune", "tune")])
def test_a_text_is_no_configuration_that_lacks_a_key(shell: Shell, command: str, key: str) -> None:
    (shell.folder / "x.txt").write_text("Hello\n")
    code, _, err = shell(command, "x.txt")
    assert (code, "x.txt:1: expected keys such as" in err, key in err, "'Hello'" in err) == (2, True, True, True), err


def test_a_kind_is_not_asked_of_what_cannot_be_read(tmp_path: Path) -> None:
    assert kind_of_file(tmp_path) is None
    assert kind_of_file(tmp_path / ("x" * HEAD)) is None


@pytest.mark.parametrize("command", ["simulate", "compare", "estimate", "tune", "report", "rerun", "claims", "cite"])
def test_hdf5_of_another_program_is_no_result(shell: Shell, command: str) -> None:
    _hdf5(shell.folder / "o.h5")
    code, _, err = shell(command, "o.h5")
    right = "tune" if command == "tune" else "estimate"
    start = f"hgorun: o.h5: this is an HDF5 file that hgorun has not written: hgorun {right} CONFIG o.h5 "
    assert (code, err[: len(start)]) == (2, start)


@pytest.mark.parametrize(
    ("form", "said"),
    [
        (
            "hgorun-sweep-1",
            "this is the result of a sweep, not the result of a single run: hgorun compare o.h5",
        ),
        ("hgorun-tune-1", "this is what hgorun tune has tried, not the result of a single run: the gains"),
        (
            "hgorun-result-9",
            "this is a file of another version of hgorun (hgorun-result-9), not the result",
        ),
    ],
)
def test_files_of_hgorun_are_told_apart(shell: Shell, form: str, said: str) -> None:
    _hdf5(shell.folder / "o.h5", form)
    assert said in shell("rerun", "o.h5")[2]
    assert said.split(",")[0].split(" (")[0] in shell("analyze", "o.h5")[2]


def test_a_result_leads_to_the_next_step_of_each_command(shell: Shell) -> None:
    assert shell("simulate", "a.yaml", "-q")[0] == 0
    file = "results/a.h5"
    steps = {
        "simulate": f"hgorun rerun {file} makes it again",
        "estimate": f"hgorun estimate CONFIG {file} reads its measurements",
        "analyze": f"analyze takes a configuration: its own is hgorun.read('{file}').config in Python",
        "sweep": "sweep takes a file with base and axes",
        "claims": "claims takes a configuration",
        "report": f"hgorun compare {file} shows it",
        "init": "init copies experiments: see hgorun list experiments",
    }
    for command, step in steps.items():
        code, _, err = shell(command, file)
        assert (code, step in err) == (2, True), err


def test_a_result_is_one_whatever_it_is_called(shell: Shell) -> None:
    file = "results/a.h5"
    assert shell("simulate", "a.yaml", "-q")[0] == 0
    table = shell("compare", file, "--no-plots")[1]
    for other in ("renamed.yaml", "renamed"):
        (shell.folder / other).write_bytes((shell.folder / file).read_bytes())
        assert shell("compare", other, "--no-plots")[:2] == (0, table)
        assert shell("cite", other)[0] == 0
    assert shell("sweep", "s.yaml", "-q")[0] == 0
    (shell.folder / "renamed.dat").write_bytes((shell.folder / "results/s.sweep.h5").read_bytes())
    assert shell("compare", "renamed.dat", "--no-plots")[1] == shell("compare", "results/s.sweep.h5", "--no-plots")[1]


def test_a_sweep_leads_to_what_reads_it(shell: Shell) -> None:
    for path in ("s.sweep", "s.sweep.h5"):
        if path.endswith("h5"):
            _hdf5(shell.folder / path, "hgorun-sweep-1")
        else:
            (shell.folder / path).mkdir()
            (shell.folder / path / "manifest.json").write_text("{}")
        assert (
            f"a configuration, such as the base of the sweep; hgorun compare {path} shows it"
            in shell("analyze", path)[2]
        )
        assert "goes on with what is missing" in shell("sweep", path)[2]
    for command in ("estimate", "tune", "benchmark", "simulate"):
        assert (
            shell(command, "s.yaml")[2] == "hgorun: s.yaml: this is a sweep file; hgorun sweep s.yaml carries it out\n"
        )


def test_a_recording_leads_to_what_it_needs(shell: Shell) -> None:
    (shell.folder / "l.csv").write_text("t,y\n0,1\n")
    assert "where CONFIG has the key data; hgorun init fermentation copies an example" in shell("estimate", "l.csv")[2]
    assert "hgorun tune CONFIG l.csv tunes observers on it" in shell("tune", "l.csv")[2]


def test_a_name_of_a_file_where_names_are_wanted(shell: Shell) -> None:
    assert "`hgorun init --plant NAME -o new.yaml` writes one" in shell("init", "new.yaml")[2]
    assert "`hgorun init contois_te025` copies" in shell("init", "contois_te025.yaml")[2]
    assert "hgorun cite a.yaml says what it uses" in shell("show", "a.yaml")[2]
    (shell.folder / "n.txt").write_text(CONFIG)
    assert "claims takes figures, experiments, and files whose names end in .yaml" in shell("claims", "n.txt")[2]
