"""A place that cannot be written is told before any work; a name that is no file is told as what it is."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from shell import Shell

from hgorun.commands import outputs
from hgorun.files import why_unwritable
from hgorun.plants.base import PLANTS

SMALL = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {S: {type: shgo, theta: 2}}
"""
UNREADABLE = "this: is, no: configuration"  # what is said of it comes later than what is said of the place


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "a.yaml").write_text(SMALL)
    (tmp_path / "b.yaml").write_text(UNREADABLE)
    (tmp_path / "file").write_text("x")
    (tmp_path / "there.h5").mkdir()
    (tmp_path / "read_only.h5").write_text("x")
    (tmp_path / "read_only.h5").chmod(0o444)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    "command", ["simulate", "compare", "analyze", "export", "explore", "tune", "benchmark", "sweep"]
)
def test_it_is_told_before_the_configuration_is_read(shell: Shell, command: str) -> None:
    code, out, err = shell(command, "b.yaml", "-o", "file/results")
    said = f"hgorun: --output: file/results cannot be written: {shell.folder.resolve()}/file is a file, not a folder"
    assert (code, out, err) == (2, "", f"{said}; name another place with --output\n")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("simulate a.yaml -o there.h5", "--output: there.h5 cannot be written: it is a folder"),
        ("simulate a.yaml -o read_only.h5", "--output: read_only.h5 cannot be written: it is read-only"),
        ("simulate a.yaml -o /dev/null", "--output: /dev/null cannot be written: it is no regular file"),
        (f"compare a.yaml -o {'a' * 300}.png", f"--output: {'a' * 300}.png cannot be written: its name is longer than"),
        (f"compare a.yaml -o {'a' * 300}.h5", "--output: expected a file .pdf, .png or a folder"),
        ("simulate a.yaml -o -", "--output: - is the standard output, and what is written goes into files"),
        ("simulate a.yaml --export-csv -", "--export-csv: - is the standard output"),
        ("simulate a.yaml --export-csv file/x.csv", "--export-csv: file/x.csv cannot be written"),
        ("estimate a.yaml --export-csv there.h5", "--export-csv: expected a file .csv, .dat, .txt, found the folder"),
        ("estimate a.yaml - --checkpoint file/x", "--checkpoint: file/x cannot be written"),
        ("estimate a.yaml - --checkpoint there.h5", "--checkpoint: there.h5 cannot be written: it is a folder"),
        ("estimate a.yaml --export-samples file/x", "--export-samples: file/x cannot be written"),
        ("cite a.yaml -o file/x.bib", "--output: file/x.bib cannot be written"),
        ("report a.h5 -o file/x.html", "--output: file/x.html cannot be written"),
        ("rerun a.h5 -o file/x.h5", "--output: file/x.h5 cannot be written"),
        ("merge a.sweep -o file/x.h5", "--output: file/x.h5 cannot be written"),
        ("figures a.yaml -o file/x", "--output: file/x cannot be written"),
        ("claims a.yaml -o file/x", "--output: file/x cannot be written"),
        ("init contois_te025 file/x", "FOLDER: file/x cannot be written"),
        ("init --plant contois -o file/x.yaml", "--output: file/x.yaml cannot be written"),
    ],
)
def test_of_every_option_that_names_one(shell: Shell, words: str, said: str) -> None:
    code, out, err = shell(*words.split())
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert err.startswith(f"hgorun: {said}"), err


@pytest.mark.parametrize(
    "command", ["simulate", "compare", "analyze", "export", "explore", "tune", "claims", "figures"]
)
@pytest.mark.parametrize("option", [("-o", "there"), ()])
def test_no_place_is_tried_twice(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, command: str, option: tuple[str, ...]
) -> None:
    tried: list[Path] = []

    def tries(path: Path) -> str:
        tried.append(path)
        return ""

    monkeypatch.setattr(outputs, "why_unwritable", tries)
    assert shell(command, "b.yaml", *option)[0] == 2  # it is no configuration, which is found out later
    assert len(set(tried)) == len(tried), tried
    assert [str(path).split("/")[0] for path in tried[:1]] in ([*option[1:]] or ["results"], []), tried


@pytest.mark.parametrize("command", ["simulate", "compare", "analyze", "export"])
def test_the_place_without_an_option_too(shell: Shell, command: str) -> None:
    (shell.folder / "results").write_text("")
    code, out, err = shell(command, "a.yaml", "-q")
    assert (code, out) == (2, "")
    assert "a file, not a folder; name another place with --output" in err
    assert not [path for path in shell.folder.iterdir() if path.suffix == ".part"]


def test_nothing_is_asked_of_a_place_where_nothing_is_written(shell: Shell) -> None:
    (shell.folder / "results").write_text("")
    assert shell("compare", "a.yaml", "--no-plots", "-q") == (0, "", "")


def test_what_can_be_written_is_left_as_it_is(tmp_path: Path) -> None:
    assert [why_unwritable(tmp_path / name) for name in ("x.h5", "not/there/yet")] == ["", ""]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="a folder of Linux, where root makes no file either")
def test_it_is_tried_since_rights_do_not_say_it() -> None:
    assert why_unwritable(Path("/proc/x")).startswith("no file can be made in /proc (")


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_of_somebody_else(tmp_path: Path) -> None:  # pragma: no cover
    tmp_path.chmod(0o555)
    assert "Permission denied" in why_unwritable(tmp_path / "x.h5")


@pytest.mark.parametrize(
    ("command", "name", "said"),
    [
        (
            "simulate",
            "2.3",
            "It is a figure, which hgorun figures 2.3 draws: hgorun init ",
        ),
        ("estimate", "23a", "It is a claim, which hgorun show 23a describes; hgorun claims lee2016/"),
        ("rerun", "chapter3", "It is a folder of experiments, of which init copies one: robles2023/"),
        ("report", "shgo", "It is an observer: hgorun init --plant NAME --observer shgo"),
    ],
)
def test_what_is_no_file_is_told_as_what_it_is(shell: Shell, command: str, name: str, said: str) -> None:
    (shell.folder / "chapter").write_text("")  # more alike than anything in the folder
    code, out, err = shell(command, name)
    assert (code, out) == (2, "")
    assert err.startswith(f"hgorun: {name}: there is no such file. {said}"), err


@pytest.mark.costly
def test_an_unknown_plant_lists_those_that_there_are(shell: Shell) -> None:
    code, _, err = shell("init", "--plant", "foo")
    assert code == 2
    told = f"There are {', '.join(PLANTS.names())}; hgorun init --ask asks for equations of your own"
    assert err == f"hgorun: --plant: no plant is called 'foo'. {told}\n"
    assert shell("init", "--plant", "contoi")[2].startswith(
        "hgorun: --plant: no plant is called 'contoi'. Did you mean `contois`? There are "
    )
