"""How a process ends: what it says, what it leaves, and with which code. The end itself is a stand-in."""

from __future__ import annotations

import gc
import io
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import pytest

import hgorun.__main__ as entry
from hgorun import process
from hgorun.process import INTERRUPTED, INTERRUPTION_SAID, TERMINATED, TERMINATION_SAID


class Ended(BaseException):
    """In place of the end of the process."""


@pytest.fixture(autouse=True)
def ended(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The codes that the process would have ended with."""
    codes: list[int] = []
    process._said.clear()  # what other tests have made it say
    monkeypatch.setattr(process, "_instead", [])

    def end(code: int) -> NoReturn:
        codes.append(code)
        raise Ended

    monkeypatch.setattr(os, "_exit", end)
    thresholds = gc.get_threshold()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    with warnings.catch_warnings():
        yield codes
    for number, handler in before.items():
        signal.signal(number, handler)
    gc.set_threshold(*thresholds)
    process._ended_by.clear()
    process._said.clear()
    process.unfinished.clear()


@pytest.mark.parametrize(("code", "said"), [(INTERRUPTED, INTERRUPTION_SAID), (TERMINATED, TERMINATION_SAID)])
def test_nothing_is_left_half_written(
    code: int, said: str, ended: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = tmp_path / ".a.part"
    part.write_text("half")
    process.unfinished.update({part, tmp_path / "gone already"})
    for _ in range(2):  # a second signal says nothing again
        with pytest.raises(Ended):
            process._leave(code)
    assert ended == [code, code]
    assert list(tmp_path.iterdir()) == []
    assert capsys.readouterr().err == said + "\n"


@pytest.mark.parametrize(
    ("number", "raised", "code"),
    [(signal.SIGINT, KeyboardInterrupt, INTERRUPTED), (signal.SIGTERM, SystemExit, TERMINATED)],
)
def test_a_signal_becomes_an_exception_and_a_code(
    number: signal.Signals, raised: type[BaseException], code: int, ended: list[int]
) -> None:
    with pytest.raises(raised):
        process._raiser(code)(number, None)
    assert process._ended_by == [code]


def test_what_is_begun_is_ended_before_a_signal_is_answered(ended: list[int]) -> None:
    answer, done = process._raiser(TERMINATED), []

    def work() -> None:
        with process.uninterrupted():
            with process.uninterrupted():
                answer(signal.SIGTERM, None)
            done.append("the inner part does not end the outer one")

    with pytest.raises(SystemExit) as stop:
        work()
    assert stop.value.code == TERMINATED
    assert len(done) == 1
    with pytest.raises(SystemExit):  # from then on at once
        answer(signal.SIGTERM, None)


def test_what_is_to_be_said_besides_is_said_where_a_signal_ends_it(
    ended: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    for error in (None, ValueError):
        with suppress(ValueError), process.told_where_ended(lambda: "nothing"):
            if error is not None:
                raise error
    with suppress(KeyboardInterrupt), process.told_where_ended(lambda: "half of it is done"):
        raise KeyboardInterrupt
    for _ in range(2):
        with pytest.raises(Ended):
            process._leave(INTERRUPTED)
    assert capsys.readouterr().err == f"{INTERRUPTION_SAID}\nhalf of it is done\n"


def test_what_a_library_makes_of_a_signal_is_still_the_signal(
    ended: list[int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(process, "_listen", lambda: None)
    monkeypatch.setattr(process, "_prepare_streams", lambda: None)

    def main() -> NoReturn:
        process._ended_by.append(INTERRUPTED)
        raise ImportError("half of a library")

    with pytest.raises(Ended):
        process.run(lambda: main)
    assert ended == [INTERRUPTED]
    assert capsys.readouterr().err == INTERRUPTION_SAID + "\n"
    process._ended_by.clear()

    def wrong() -> NoReturn:
        raise ImportError("no signal")

    with pytest.raises(ImportError, match="no signal"):
        process.run(lambda: wrong)
    assert ended == [INTERRUPTED]


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, INTERRUPTED), (signal.SIGTERM, TERMINATED)], ids=["SIGINT", "SIGTERM"]
)
def test_native_code_that_does_not_listen_is_not_waited_for(
    number: signal.Signals, code: int, ended: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Children are ended with it; other signals and bytes are nobody's business."""
    ends: list[str] = []

    class Child:
        def terminate(self) -> None:
            ends.append("child")

    monkeypatch.setattr(process, "_PATIENCE", 0.0)
    monkeypatch.setattr(multiprocessing, "active_children", lambda: [Child(), Child()])
    heard, told = os.pipe()
    os.write(told, bytes([signal.SIGWINCH]))
    feeder = threading.Timer(0.05, os.write, (told, bytes([signal.SIGUSR1, number])))
    feeder.start()
    with pytest.raises(Ended):
        process._watch(heard)
    feeder.join()
    os.close(heard)
    os.close(told)
    assert ended == [code]
    assert ends == ["child", "child"]


def test_a_shell_that_wants_signals_ignored_gets_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """As nohup and background jobs do."""
    threads: list[threading.Thread] = []
    monkeypatch.setattr(threading.Thread, "start", lambda thread: threads.append(thread))
    monkeypatch.setattr(signal, "set_wakeup_fd", lambda *_, **__: -1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    process._listen()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    with pytest.raises(SystemExit) as stop:
        signal.raise_signal(signal.SIGTERM)
    assert stop.value.code == TERMINATED
    assert [thread.daemon for thread in threads] == [True]


def test_streams_that_are_no_files_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    process._prepare_streams()
    process.silence(sys.stdout)
    assert isinstance(sys.stdout, io.StringIO)


def test_a_line_that_cannot_be_said_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError("nobody reads")

    monkeypatch.setattr(sys, "stderr", Broken())
    process.say("lost")
    assert "lost" in process._said


def test_the_entry_point_ends_at_once_until_more_is_imported(
    ended: list[int], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    commands: list[object] = []
    monkeypatch.setattr(process, "run", commands.append)
    entry.run()
    assert signal.getsignal(signal.SIGINT) is entry._leave
    with pytest.raises(Ended):
        signal.raise_signal(signal.SIGINT)
    assert ended == [INTERRUPTED]
    assert capfd.readouterr().err == INTERRUPTION_SAID + "\n"
    (command,) = commands
    assert command is entry._command_line
    assert entry._command_line().__module__ == "hgorun.cli"


def test_libraries_are_set_up_for_what_is_done_here_unless_told_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "run", lambda _: None)
    monkeypatch.setattr(os, "environ", {"MKL_NUM_THREADS": "3"})
    was = signal.getsignal(signal.SIGINT)
    try:
        entry.run()
    finally:
        signal.signal(signal.SIGINT, was)
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
    assert os.environ["NUMPY_MADVISE_HUGEPAGE"] == "0"
    assert os.environ["MKL_NUM_THREADS"] == "3"
