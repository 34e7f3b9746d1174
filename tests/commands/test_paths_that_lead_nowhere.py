"""Paths that the system refuses to open: named with its reason, and no traceback."""

from __future__ import annotations

import io
import socket
import sys
from pathlib import Path

import pytest
from pendulum_log import write
from shell import Shell

from hgorun.cli import main
from hgorun.files import real_path, why_unreachable

WHY = {"loop": "Too many levels of symbolic links", "below/a": "Too many levels", "long": "File name too long"}
PLACES = {
    "configuration": ("simulate", "{0}.yaml"),
    "extends": ("simulate", "over.yaml"),
    "base": ("tune", "base.yaml"),
    "result": ("compare", "{0}.h5"),
    "data": ("estimate", "pendulum.yaml", "{0}.csv"),
    "data.file": ("estimate", "pendulum.yaml", "--set", "data.file={0}.csv"),
    "of an output": ("estimate", "pendulum.yaml", "--set", "data.outputs.a.file={0}.csv"),
    "held out": ("estimate", "pendulum.yaml", "--holdout", "a={0}.csv"),
    "checkpoint": ("estimate", "pendulum.yaml", "-", "--checkpoint", "{0}.state"),
    "output": ("simulate", "pendulum.yaml", "-o", "{0}.h5"),
    "text": ("estimate", "pendulum.yaml", "--export-csv", "{0}.csv"),
}
ENDS = {"configuration": ".yaml", "extends": ".yaml", "base": ".yaml", "checkpoint": ".state"} | dict.fromkeys(
    ("result", "output"), ".h5"
)
TUNE = "tune: {gains: {observers.F.theta: {log: [1, 2]}}, minimise: 'rmse(F, x1)'}\n"


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    write(tmp_path)
    for suffix in (".yaml", ".h5", ".csv", ".state"):
        for name in ("loop", "below"):
            (tmp_path / f"{name}{suffix}").symlink_to(f"{name}{suffix}")
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n0,a,1\n"))
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize("kind", WHY)
@pytest.mark.parametrize("place", PLACES)
def test_what_cannot_be_opened_is_named_with_the_reason(shell: Shell, place: str, kind: str) -> None:
    first, *suffix = PLACES[place]
    named = {"long": 300 * "x", "below/a": "below{1}/a"}.get(kind, kind)
    name = named.replace("{1}", ENDS.get(place, ".csv"))
    (shell.folder / "over.yaml").write_text(f"extends: {name}.yaml\n")
    (shell.folder / "base.yaml").write_text(f"base: {name}.yaml\n{TUNE}")
    code, out, err = shell(first, *(word.format(name) for word in suffix))
    assert (code, out) == (2, ""), err
    assert WHY[kind] in err or "its name is longer than 255 bytes" in err
    assert "Did you mean" not in err


@pytest.mark.parametrize("place", ["configuration", "result", "data", "held out", "base"])
def test_a_link_to_nothing_is_not_proposed_in_its_own_place(shell: Shell, place: str) -> None:
    (shell.folder / "base.yaml").write_text(f"base: nothing.yaml\n{TUNE}")
    (shell.folder / f"nothing{ENDS.get(place, '.csv')}").symlink_to("nowhere")
    code, _, err = shell(*(word.format("nothing") for word in PLACES[place]))
    assert code == 2
    assert "there is no such file" in err
    assert "Did you mean `nothing" not in err


@pytest.mark.parametrize("place", ["configuration", "result", "data", "held out", "base"])
def test_a_socket_is_no_file(shell: Shell, place: str) -> None:
    (shell.folder / "base.yaml").write_text(f"base: socket.yaml\n{TUNE}")
    words = [word.format("socket") for word in PLACES[place]]
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(f"socket{ENDS.get(place, '.csv')}")
        code, _, err = shell(*words)
    assert code == 2
    assert "not a regular file" in err


def test_a_checkpoint_that_may_not_be_read_is_named(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As of another user, whose files root may read."""

    def closed(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    (tmp_path / "own.state").touch()
    monkeypatch.setattr(Path, "read_bytes", closed)
    code, _, err = shell("estimate", "pendulum.yaml", "-", "--checkpoint", "own.state")
    assert (code, err) == (2, "hgorun: own.state: cannot be read: Permission denied\n")


def test_whatever_cannot_be_opened_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where nobody has thought of it; an output that ends has no name."""

    def closed(*_: object) -> None:
        raise PermissionError(13, "Permission denied", "/some/file")

    monkeypatch.setattr("hgorun.cli._called", closed)
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    assert capsys.readouterr().err == "hgorun: /some/file: Permission denied\n"


def test_real_paths_and_reasons(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "link").symlink_to("file")
    assert real_path(tmp_path / "link") == real_path(tmp_path) / "file"
    assert real_path(tmp_path / "loop").name == "loop"
    assert why_unreachable(tmp_path / "link") == why_unreachable(tmp_path) == ""
    assert why_unreachable(Path("a\0b")) == "embedded null byte"
