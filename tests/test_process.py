"""The command as a process: streams that fail, signals at any time, places that cannot be written."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest
from waiting import wait_until_it_computes

from hgorun.errors import HgorunError
from hgorun.files import written_whole
from hgorun.process import processors

CONFIG = """
time: {end: 1, output_step: 0.01}
plant: {states: [x1, x2], dynamics: {x1: x2, x2: -x1}, output: x1, initial: {x1: 1, x2: 0}}
measurement: {sampling: {period: 0.25}}
observers: {"HGO θ": {type: shgo, theta: 2}}
solver: {step: 0.01}
"""
HGORUN = [sys.executable, "-m", "hgorun"]
# A process that is stopped at any time, or may write no more, cannot write either what coverage measures in it.
UNMEASURED = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "c.yaml").write_text(CONFIG, encoding="utf-8")
    return tmp_path


def shell(
    folder: Path, command: str, base: Mapping[str, str] = os.environ, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a line of the shell, in which $HGORUN is the command."""
    line = command.replace("$HGORUN", " ".join(HGORUN))
    return subprocess.run(["bash", "-c", line], cwd=folder, capture_output=True, text=True, env={**base, **environment})


@pytest.mark.measured("--help")
@pytest.mark.costly
@pytest.mark.parametrize("command", ["simulate c.yaml --json", "list plants", "--help"])
def test_a_full_disk_under_stdout_is_one_line(command: str, folder: Path) -> None:
    done = shell(folder, f"$HGORUN {command} > /dev/full")
    assert done.returncode == 1
    assert done.stderr == "hgorun: No space left on device: the output is incomplete\n"


@pytest.mark.costly
def test_a_reader_that_leaves_is_no_error(folder: Path) -> None:
    done = shell(folder, "$HGORUN schema | head -n 1 > /dev/null; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.costly
def test_python_ends_without_looking_at_every_object(folder: Path) -> None:
    code = (
        "import atexit, gc, sys; from hgorun.__main__ import run; sys.argv = ['hgorun', 'list', 'plants'];"
        "atexit.register(lambda: print(gc.get_freeze_count() > len(gc.get_objects()), file=sys.stderr)); run()"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    assert done.stderr == "True\n"


@pytest.mark.costly
def test_closed_streams_are_nobodys_file(folder: Path) -> None:
    assert shell(folder, "$HGORUN simulate nofile.yaml 2>&-").returncode == 2
    done = shell(folder, "$HGORUN simulate c.yaml >&- 2>&-")
    assert (done.returncode, done.stdout) == (0, "")
    assert (folder / "results/c.h5").read_bytes().startswith(b"\x89HDF")


@pytest.mark.costly
@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_a_stream_that_cannot_hold_a_label_shows_a_replacement(encoding: str, folder: Path) -> None:
    done = shell(folder, "$HGORUN simulate c.yaml", PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, "")
    assert "HGO ?" in done.stdout


@pytest.mark.costly
def test_a_file_name_that_is_no_text(folder: Path) -> None:
    os.rename(os.fsencode(folder / "c.yaml"), os.fsencode(folder) + b"/\xff.yaml")
    done = shell(folder, "$HGORUN simulate $'\\xff.yaml' -q")
    assert (done.returncode, done.stderr) == (0, "")
    assert os.listdir(os.fsencode(folder / "results")) == [b"\xff.h5"]


@pytest.mark.costly
def test_a_notebooks_backend_does_not_hinder(folder: Path) -> None:
    done = shell(folder, "$HGORUN compare c.yaml -q", MPLBACKEND="module://not_installed.inline")
    assert (done.returncode, done.stderr) == (0, "")
    assert (folder / "results/c-comparison.png").exists()


@pytest.mark.parametrize("blocks", [1, 4, 16])
def test_a_limit_of_file_sizes_leaves_nothing(blocks: int, folder: Path) -> None:
    done = shell(folder, f"ulimit -f {blocks}; $HGORUN simulate c.yaml -q", UNMEASURED, PYTHONDONTWRITEBYTECODE="1")
    assert done.returncode == 1
    assert done.stderr == "hgorun: results/c.h5: cannot be written: File too large\n"
    assert list((folder / "results").iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("delay", [0.2, 0.5, 1.0])
def test_a_signal_at_any_time_is_answered_at_once(number: signal.Signals, delay: float, folder: Path) -> None:
    longer = CONFIG.replace("end: 1,", "end: 500000,").replace("output_step: 0.01", "output_step: 10")
    (folder / "c.yaml").write_text(longer.replace("period: 0.25", "period: 50").replace("step: 0.01}", "step: 0.001}"))
    command = [*HGORUN, "simulate", "c.yaml"]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, env=UNMEASURED)
    wait_until_it_computes(process, delay)
    process.send_signal(number)
    started = time.perf_counter()
    _, err = process.communicate(timeout=30)
    assert time.perf_counter() - started < 10  # a second, on a machine that has nothing else to do
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert err == b"hgorun: interrupted; no file is left half-written\n"
    else:
        assert process.returncode in (143, -signal.SIGTERM)  # the latter before anything was imported
        assert b"Traceback" not in err
    assert [p.name for p in folder.iterdir()] == ["c.yaml"]


def test_a_link_is_followed_and_what_is_read_only_stays(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("before")
    link.symlink_to("target")
    with written_whole(link) as part:
        part.write_text("after")
    assert link.is_symlink()
    assert target.read_text() == "after"
    target.chmod(0o444)
    for path in (target, link):
        with pytest.raises(HgorunError, match="read-only"), written_whole(path):
            pass
    assert target.read_text() == "after"


def test_only_files_are_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(HgorunError, match="no regular file"), written_whole(path):
            pass


def test_memory_that_is_limited_is_one_line(folder: Path) -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31))

    command = [*HGORUN, "simulate", "c.yaml", "--set", "time.output_step=1e-9", "--set", "time.max_memory=1e12"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, preexec_fn=limit, env=UNMEASURED)
    assert done.returncode == 1
    assert done.stderr.startswith("hgorun: out of memory; a longer time.output_step")
    assert done.stderr.count("\n") == 1


def test_processors_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert processors() >= 1
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    monkeypatch.setattr(sys, "platform", "linux")
    assert processors() == 3
    monkeypatch.setattr(sys, "platform", "darwin")
    assert processors() == 1


FAULTS = """
import resource, sys, threading
import numpy as np
from hgorun.process import keep_memory

if sys.argv[1] == "kept":
    keep_memory()

def work():
    for _ in range(20):
        [np.ones(250_000) for _ in range(10)]

thread = threading.Thread(target=work)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
thread.start()
thread.join()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.costly
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere memory is kept as it is")
def test_memory_that_is_kept_is_not_asked_for_again() -> None:
    kept, given_back = (
        int(subprocess.run([sys.executable, "-c", FAULTS, how], capture_output=True, text=True, check=True).stdout)
        for how in ("kept", "given back")
    )
    assert kept < given_back / 2
