"""A file that one process at a time may use."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

from hgorun.commands.held import held_alone
from hgorun.errors import ConfigError
from hgorun.files import write_text


def hold(path: Path) -> None:
    with held_alone(path):
        pass


def test_a_file_is_held_by_one_alone_under_all_its_names(tmp_path: Path) -> None:
    path, other = tmp_path / "there" / "state", tmp_path / "link"
    other.symlink_to(path)
    with held_alone(path):
        write_text(path, "replaced")
        for name in (path, other):
            with pytest.raises(
                ConfigError, match=rf"{name}: another process has it in use \(\.state\.lock is locked\)"
            ):
                hold(name)
        hold(path.with_name("state2"))
    hold(other)
    assert [one.name for one in path.parent.iterdir()] == ["state"]


def test_a_killed_process_holds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "state"
    lock = tmp_path / ".state.lock"
    taken = (
        "import fcntl, sys; file = open(sys.argv[1], 'w'); fcntl.flock(file, fcntl.LOCK_EX); print(flush=True); input()"
    )
    command = [sys.executable, "-S", "-c", taken, str(lock)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.read(1)
        with pytest.raises(ConfigError):
            hold(path)
        process.kill()
    assert lock.exists()
    hold(path)
    assert not list(tmp_path.iterdir())


def test_a_lock_that_is_removed_while_it_is_taken_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, lock, flock = tmp_path / "state", tmp_path / ".state.lock", fcntl.flock
    removed = list[bool]()

    def after_the_other_left(handle: int, how: int) -> None:
        if not removed:
            lock.unlink()
            removed.append(True)
        flock(handle, how)

    monkeypatch.setattr(fcntl, "flock", after_the_other_left)
    with held_alone(path), pytest.raises(ConfigError):
        hold(path)


def test_where_there_are_no_locks_nobody_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with held_alone(tmp_path / "state"):
        hold(tmp_path / "state")
    assert not list(tmp_path.iterdir())
