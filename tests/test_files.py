"""Files are written whole or not at all, and what a killed process leaves is removed."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from hgorun import files
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import refuse_no_result, remove_leftovers, write_text, written_whole


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "there" / "file.txt"
    path.parent.mkdir()
    with written_whole(path) as part:
        part.write_text("half")
        assert not path.exists()
    assert path.read_text() == "half"
    write_text(path, "ξ")
    assert path.read_bytes() == "ξ".encode()
    assert [p.name for p in path.parent.iterdir()] == ["file.txt"]


def test_the_room_of_a_large_file_that_is_replaced_is_given_back_by_a_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[tuple[int, str]] = []
    close = os.close

    def told(handle: int) -> None:
        closed.append((os.fstat(handle).st_nlink, threading.current_thread().name))
        close(handle)

    path = tmp_path / "result.h5"
    path.write_text("old")
    with written_whole(path) as part:
        part.write_text("small")
        monkeypatch.setattr(files, "_LARGE", 2)
        monkeypatch.setattr(os, "close", told)
    for thread in threading.enumerate():
        if thread.name == "giving room back":
            thread.join()
    assert path.read_text() == "small"
    assert closed == [(0, "giving room back")]


def test_a_link_to_a_file_of_another_kind_is_no_name_of_a_result(tmp_path: Path) -> None:
    """What it points to would be replaced."""
    (tmp_path / "plant.yaml").write_text("plant: x")
    for name, end in (("l.h5", "plant.yaml"), ("l2.h5", "l.h5"), ("there.h5", "later.h5"), ("l.csv", "later.h5")):
        (tmp_path / name).symlink_to(end)
    for name, end in (("l.h5", "plant.yaml"), ("l2.h5", "plant.yaml"), ("l.csv", "later.h5")):
        with pytest.raises(ConfigError, match=rf"save: expected .* found .*{name}, a link to .*{end}"):
            refuse_no_result(tmp_path / name, "save")
    refuse_no_result(tmp_path / "there.h5", "save")
    refuse_no_result(tmp_path / "new.h5", "save")


def test_a_name_with_a_nul_is_refused_as_others_are(tmp_path: Path) -> None:
    name = tmp_path / "\0.h5"
    refuse_no_result(name, "save")
    with pytest.raises(HgorunError, match=r"cannot be written: a name of a file has no NUL"), written_whole(name):
        pass
    assert not list(tmp_path.iterdir())


def test_what_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    write_text(path, "old")

    def interrupted() -> None:
        with written_whole(path) as part:
            part.write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]


@pytest.mark.skipif(os.name != "posix", reason="processes are asked for only there")
def test_leftovers_of_dead_processes_are_removed_and_of_others_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with written_whole(tmp_path / "a.h5") as part:
        part.write_text("")
        own = part.name
    dead = subprocess.Popen([sys.executable, "-c", ""])
    zombie = dead.pid
    os.waitid(os.P_PID, zombie, os.WEXITED | os.WNOWAIT)  # ended, and still listed
    names = {pid: own.replace(str(os.getpid()), str(pid)) for pid in (os.getpid(), zombie, 1)}
    elsewhere = names[zombie].replace(files._MACHINE, "01234567")  # of a machine that shares the folder
    for name in (*names.values(), elsewhere, ".notes.part", ".b.h5.x.part"):
        (tmp_path / name).write_text("")
    remove_leftovers(tmp_path)
    left = {p.name for p in tmp_path.iterdir()} - {"a.h5"}
    assert left == {names[os.getpid()], names[1], elsewhere, ".notes.part", ".b.h5.x.part"}
    dead.wait()

    def refused(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "kill", refused)  # of another user: alive
    (tmp_path / names[zombie]).write_text("")
    remove_leftovers(tmp_path)
    assert (tmp_path / names[zombie]).exists()
    monkeypatch.undo()
    remove_leftovers(tmp_path)
    assert not (tmp_path / names[zombie]).exists()
    remove_leftovers(tmp_path / "nowhere")
