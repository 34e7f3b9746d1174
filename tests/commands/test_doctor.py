"""``hgorun doctor`` knows a right installation from a wrong one."""

from __future__ import annotations

import errno
import importlib.metadata as metadata
import json
import os
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

import hgorun.commands.doctor as doctor_module
from hgorun.commands.doctor import SelfTest, extras, self_test
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import simulate_prepared

ROOT = Path(__file__).parents[2]


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path / "cache"))
    return Shell(tmp_path, monkeypatch, capsys)


def test_a_sound_installation_passes(shell: Shell) -> None:
    code, out, _ = shell("doctor")
    assert code == 0
    for words in ("numpy 2", "HDF5", "side by side", "programs", "right: largest difference", "ns a step"):
        assert words in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 100
    data = json.loads(shell("doctor", "--json")[1])
    assert data["self_test"]["right"] is True
    assert data["self_test"]["error"] < 1e-10
    assert data["cache"]["entries"] >= 1
    assert data["cache"]["bytes"] > 0
    assert data["extras"]["pandas"] is None


def test_the_cache_is_emptied(shell: Shell) -> None:
    (shell.folder / "cache").mkdir(mode=0o700)
    (shell.folder / "cache" / "old.o").write_bytes(bytes(2**21))
    (shell.folder / "cache" / "mine.txt").write_text("not a program")
    out = shell("doctor", "--prune")[1]
    assert "2.0 MiB were freed" in out
    assert not (shell.folder / "cache" / "old.o").exists()
    assert (shell.folder / "cache" / "mine.txt").exists()


def test_a_cache_that_cannot_be_emptied_is_named(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    (shell.folder / "cache").mkdir(mode=0o700)
    (shell.folder / "cache" / "old.o").write_bytes(b"")

    def refuse(path: Path, *, missing_ok: bool) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(Path, "unlink", refuse)
    code, out, err = shell("doctor", "--prune")
    assert (code, out) == (1, "")
    assert err == f"hgorun: --prune: {shell.folder / 'cache'} cannot be emptied: Read-only file system\n"


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_a_cache_in_which_nothing_can_be_made_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also to the superuser, who may write in /proc as far as its permissions say."""
    monkeypatch.setenv("HGORUN_CACHE_DIR", "/proc/nothing")
    assert list(doctor_module._amiss(SelfTest(0.0, 0.0))) == [
        "compiled code is not kept in /proc/nothing: it cannot be written: No such file or directory; "
        "what is not there yet is compiled by each run"
    ]


def test_a_cache_that_others_can_write_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path))
    tmp_path.chmod(0o777)
    assert "others can write there" in next(doctor_module._amiss(SelfTest(0.0, 0.0)))
    tmp_path.chmod(0o700)
    assert list(doctor_module._amiss(SelfTest(0.0, 0.0))) == []
    assert list(tmp_path.iterdir()) == []


def test_wrong_numbers_are_found(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine whose states are off by 1e-6 at one point."""

    def wrong(run: PreparedRun) -> Result:
        result = simulate_prepared(run)
        result.observers["SHGO"].xhat[1000, 1] += 1e-6
        return result

    monkeypatch.setattr(doctor_module, "simulate_prepared", wrong)
    code, _, err = shell("doctor")
    assert (code, "the self-test is off by 1.0e-06" in err) == (1, True)


def test_what_is_amiss_changes_the_exit_code_only_with_strict(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor_module, "self_test", lambda: SelfTest(1e-12, 1e-6))
    monkeypatch.setattr(doctor_module, "extras", lambda: {"none": ["no-such-package-of-ours"]})
    (shell.folder / "cache").write_text("a file in the place of the folder")
    code, out, _ = shell("doctor")
    assert (code, "! a step takes" in out, "! compiled code is not kept" in out) == (0, True, True)
    assert "not there: pip install no-such-package-of-ours" in out
    assert shell("doctor", "--strict")[0] == 3


def test_extras_are_those_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that users install, also one that is added later; not the tools of developers."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    stated = [f"{one}; extra == '{extra}'" for extra, some in declared.items() for one in some]
    monkeypatch.setattr(metadata, "requires", lambda name: ["numpy>=2.0", *stated, "new ; extra=='new'"])
    found = extras()
    assert set(found) == {*declared, "new"} - {"bench", "dev", "docs", "release", "test"}
    assert found["control"] == ["control"]
    assert found["xarray"] == ["xarray", "h5netcdf"]
    assert found["new"] == ["new"]


def test_what_is_not_installed_has_no_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", none)
    assert extras() == {}


def test_the_solutions_in_closed_form_are_solutions() -> None:
    """The self-test's own error is that of the method: it falls with the fourth power of the step."""
    assert 0 < self_test().error < 1e-10
    assert np.isfinite(self_test().seconds)
