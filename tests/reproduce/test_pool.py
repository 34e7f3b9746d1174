"""Jobs on several processes, as their parent sees them, and what a worker does in its own process."""

import os
import queue
import signal
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest

from hgorun import progress as progress_of
from hgorun.errors import ConfigError, SimulationError
from hgorun.reproduce import pool
from hgorun.reproduce.choice import choose
from hgorun.reproduce.job import Folders, Outcome, Work

STUDY = """
time: {end: 1, output_step: 0.1}
plant: {type: integrator_chain, n: 2, phi: -x1, initial: {x1: 1, x2: 0}}
observers: {A: {type: shgo, theta: 2}}
solver: {step: 0.1}
claims: [{id: "1", claim: Small., value: "rmse('A', x1)", below: 10}]
"""


def works(folder: Path, count: int = 2) -> list[Work]:
    paths = [folder / f"study{i}.yaml" for i in range(count)]
    for path in paths:
        path.write_text(STUDY)
    return choose([str(p) for p in paths], Folders.below(folder / "out"), figures=False, claims=True)


def finished(outcome: Outcome | None = None, error: Exception | None = None) -> Future[Outcome]:
    future: Future[Outcome] = Future()
    if error is None:
        future.set_result(outcome or Outcome())
    else:
        future.set_exception(error)
    return future


def test_a_worker_reports_what_it_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages: queue.Queue[tuple[int, float, str]] = queue.Queue()
    handlers: dict[int, Any] = {}
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(pool, "_queue", None, raising=False)
    monkeypatch.setattr(pool, "_threads", None, raising=False)
    monkeypatch.setattr(pool, "_OFTEN", 0.0)
    pool._start(messages, 1)
    assert handlers[signal.SIGINT] == signal.SIG_IGN
    codes: list[int] = []
    with monkeypatch.context() as patch:
        patch.setattr(os, "_exit", codes.append)
        handlers[signal.SIGTERM](signal.SIGTERM, None)
    assert codes == [143]
    (work,) = works(tmp_path, 1)
    assert set(pool._work(work.job, 7).values) == {"1"}
    assert messages.get_nowait() == (7, 0.0, "study0: study0")


def test_all_jobs_are_finished_before_the_first_error_is_raised() -> None:
    futures = {
        finished(error=ConfigError("the first")): 0,
        finished(Outcome(values={"1": [[1.0]]})): 1,
    }
    told: list[tuple[int, float, str]] = []
    found: list[tuple[int, Outcome]] = []

    def collect() -> None:
        messages: queue.Queue[tuple[int, float, str]] = queue.Queue()
        messages.put((1, 0.5, "half"))
        found.extend(pool._collected(futures, messages, lambda *message: told.append(message)))

    with pytest.raises(ConfigError, match="the first"):
        collect()
    assert [number for number, _ in found] == [1]
    assert told == [(1, 0.5, "half"), (1, 1.0, "")]


def test_a_killed_worker_is_said() -> None:
    futures = {finished(error=BrokenProcessPool("gone")): 0}
    with pytest.raises(SimulationError, match="killed; what it had finished is kept"):
        list(pool._collected(futures, queue.Queue(), lambda *message: None))


def test_an_interruption_ends_the_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pool, "_collected", interrupted)
    with pytest.raises(KeyboardInterrupt):
        pool.run_all(works(tmp_path), workers=2, show=False)


def test_the_bar_is_drawn_at_a_terminal_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fill(show: bool) -> str:
        with pool._progress(2, show) as progress:
            progress(0, 0.5, "first: run")
            progress(0, 0.25, "")  # late news do not turn the bar back
            progress(1, 1.0, "second: figure")
        return capsys.readouterr().err

    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(progress_of, "SOON", 0.0)
    assert fill(show=True) == ""
    monkeypatch.setattr(progress_of, "_at_a_terminal", lambda: True)
    assert fill(show=False) == ""
    assert "75 %" in fill(show=True)
