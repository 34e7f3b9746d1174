"""Compiled code is kept, found again, and never executed where somebody else could have written it."""

from __future__ import annotations

import ctypes
import gc
import hashlib
import os
import weakref
from pathlib import Path

import numpy as np
import pytest

from hgorun.native import compiler
from hgorun.native.compiler import NativeModule, address_of, cache_folder

IR = "define dso_local double @number() {\n  ret double 42.0\n}"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What has been compiled and not taken from the cache."""
    seen: list[str] = []
    original = compiler._compile

    def spy(ir: str, machine: object) -> bytes:
        seen.append(ir)
        return original(ir, machine)

    monkeypatch.setattr(compiler, "_compile", spy)
    return seen


def number(module: NativeModule) -> float:
    return float(ctypes.CFUNCTYPE(ctypes.c_double)(module.address["number"])())


def test_a_second_time_nothing_is_compiled(folder: Path, compiled: list[str]) -> None:
    modules = [NativeModule(IR, ("number",)) for _ in range(2)]  # two of them live side by side
    assert [number(m) for m in modules] == [42.0, 42.0]
    assert compiled == [IR]
    assert sorted(path.suffix or path.name for path in folder.iterdir()) == [".o", ".written"]
    assert folder.stat().st_mode & 0o077 == 0


def test_an_entry_that_cannot_be_touched_is_used(
    folder: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a file system that is read-only."""
    NativeModule(IR, ("number",))

    def refuse(*_: object) -> None:
        raise OSError

    monkeypatch.setattr(os, "utime", refuse)
    assert number(NativeModule(IR, ("number",))) == 42.0
    assert compiled == [IR]


def test_other_code_is_another_entry(folder: Path, compiled: list[str]) -> None:
    other = IR.replace("42.0", "43.0")
    assert [number(NativeModule(ir, ("number",))) for ir in (IR, other)] == [42.0, 43.0]
    assert len(list(folder.glob("*.o"))) == 2


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: b"\0" + data[1:], lambda data: b""])
def test_a_damaged_entry_is_compiled_again(folder: Path, compiled: list[str], damage: object) -> None:
    NativeModule(IR, ("number",))
    (entry,) = folder.glob("*.o")
    whole = entry.read_bytes()
    entry.write_bytes(damage(whole))  # type: ignore[operator]  # a function
    assert number(NativeModule(IR, ("number",))) == 42.0
    assert len(compiled) == 2
    assert entry.read_bytes() == whole


def test_rubbish_with_the_right_digest_is_compiled_again(folder: Path, compiled: list[str]) -> None:
    NativeModule(IR, ("number",))
    (entry,) = folder.glob("*.o")
    whole, rubbish = entry.read_bytes(), b"not an object file"
    entry.write_bytes(hashlib.sha256(entry.stem.encode() + rubbish).digest() + rubbish)
    assert number(NativeModule(IR, ("number",))) == 42.0
    assert len(compiled) == 2
    assert entry.read_bytes() == whole


def test_an_entry_under_the_name_of_another_is_not_run(folder: Path, compiled: list[str]) -> None:
    other = IR.replace("42.0", "43.0")
    NativeModule(other, ("number",))
    (wrong,) = folder.glob("*.o")
    NativeModule(IR, ("number",))
    (entry,) = set(folder.glob("*.o")) - {wrong}
    entry.write_bytes(wrong.read_bytes())
    compiled.clear()
    assert NativeModule(IR, ("number",)).function("number", ctypes.c_double)() == 42
    assert compiled == [IR]


@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_only_files_are_entries(kind: str, folder: Path, compiled: list[str], tmp_path: Path) -> None:
    NativeModule(IR, ("number",))
    (entry,) = folder.glob("*.o")
    entry.rename(tmp_path / "elsewhere")
    entry.symlink_to(tmp_path / "elsewhere") if kind == "link" else os.mkfifo(entry)
    assert number(NativeModule(IR, ("number",))) == 42.0
    assert len(compiled) == 2
    assert entry.is_file()
    assert not entry.is_symlink()


def test_entries_used_longest_ago_make_room(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    NativeModule(IR, ("number",))
    (first,) = folder.glob("*.o")
    os.utime(first, (1, 1))
    other = folder / "other.o"
    other.write_bytes(bytes(100))
    monkeypatch.setattr("hgorun.native.compiler._ALLOWED", first.stat().st_size + 200)
    monkeypatch.setattr("hgorun.native.compiler._UNLISTED", 0)
    NativeModule(IR.replace("42", "43"), ("number",))
    assert not first.exists()
    assert other.exists()


def test_entries_are_listed_once_enough_has_been_written_by_whoever_wrote_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed: list[int] = []
    monkeypatch.setattr("hgorun.native.compiler._prune", lambda folder, allowed: listed.append(allowed))

    def write(number: int) -> list[int]:
        NativeModule(IR.replace("42", str(number)), ("number",))
        return listed

    assert write(43) == []
    with (folder / ".written").open("ab") as tally:  # another process: 16 MiB less what is written here
        tally.write(bytes(2**14 - 2))
    assert write(44) == [2**28 - 2**24]  # room for what is written until the next time
    assert write(45) == [2**28 - 2**24]
    assert not listed[1:]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with a name are POSIX's")
@pytest.mark.parametrize("kind", ["pipe", "link", "folder"])
def test_entries_are_listed_where_no_file_counts_what_is_written(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    folder.mkdir(mode=0o700)
    tally, elsewhere = folder / ".written", tmp_path / "elsewhere"
    elsewhere.write_text("of another program")
    make = {"pipe": os.mkfifo, "link": lambda path: path.symlink_to(elsewhere), "folder": Path.mkdir}
    make[kind](tally)
    old = folder / "old.o"
    old.write_bytes(bytes(1000))
    os.utime(old, (1, 1))
    monkeypatch.setattr("hgorun.native.compiler._ALLOWED", compiler._UNLISTED + 900)
    NativeModule(IR, ("number",))
    assert not old.exists()
    assert elsewhere.read_text() == "of another program"
    assert kind == "folder" or not tally.exists()


def test_entries_that_others_remove_meanwhile_are_passed_over(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir(mode=0o700)
    entries = [folder / f"{name}.o" for name in "abc"]
    for i, entry in enumerate(entries):
        entry.write_bytes(bytes(100))
        os.utime(entry, (i, i))
    original = Path.unlink

    def late(path: Path, missing_ok: bool = False) -> None:
        original(path)  # another process has been quicker
        original(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", late)
    compiler._prune(folder, 150)
    assert [entry.exists() for entry in entries] == [False, False, True]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="modes are POSIX's")
@pytest.mark.parametrize("mode", [0o720, 0o702])
def test_a_folder_that_others_can_write_is_neither_read_nor_written(
    folder: Path, compiled: list[str], mode: int
) -> None:
    NativeModule(IR, ("number",))
    folder.chmod(mode)
    assert number(NativeModule(IR, ("number",))) == 42.0
    assert len(compiled) == 2
    NativeModule(IR.replace("42.0", "44.0"), ("number",))
    assert len(list(folder.glob("*.o"))) == 1


def test_without_a_cache_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path / "file" / "below"))
    assert number(NativeModule(IR, ("number",))) == 42.0


def test_nothing_is_left_when_an_entry_cannot_be_put_in_its_place(
    folder: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError

    monkeypatch.setattr(os, "replace", refuse)
    assert number(NativeModule(IR, ("number",))) == 42.0
    assert list(folder.iterdir()) == []


def test_where_the_cache_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HGORUN_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "hgorun"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "hgorun"
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path / "there"))
    assert cache_folder() == tmp_path / "there"


def test_code_for_another_processor_is_another_entry(
    folder: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for processor in ("generic", "", "generic"):
        monkeypatch.setenv("HGORUN_CPU", processor)
        assert number(NativeModule(IR, ("number",))) == 42.0
    assert len(compiled) == len(list(folder.glob("*.o"))) == 2


def test_the_address_of_an_array_is_that_of_its_first_number() -> None:
    """Whatever the array is: in pieces, not to be written to, empty, in the order of Fortran."""
    fixed = np.zeros(3)
    fixed.flags.writeable = False
    whole = np.zeros((4, 6))
    for array in (whole, whole[1:, ::2], fixed, np.zeros(0), np.asfortranarray(whole), np.zeros(4, dtype=np.int64)):
        assert address_of(array) == array.ctypes.data


def test_code_lives_as_long_as_a_function_of_it(folder: Path) -> None:
    """Of two threads that make the same module at once, one calls a function of a module that nobody keeps."""
    module = NativeModule(IR, ("number",))
    alive, number = weakref.ref(module), module.function("number", ctypes.c_double)
    del module
    assert alive() is not None
    assert number() == 42
    del number
    gc.collect()
    assert alive() is None
