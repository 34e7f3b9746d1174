"""How far long work is: a bar at a terminal, lines elsewhere, nothing for what is over soon."""

from __future__ import annotations

import pytest

from hgorun import progress
from hgorun.progress import duration, shown


class Clock:
    """Time that tests let pass."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr("hgorun.progress.time.monotonic", found.monotonic)
    return found


def test_lines_come_every_few_seconds(
    clock: Clock, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "_at_a_terminal", lambda: False)
    with shown(1000, "a sweep", "members") as told:
        told.update(500)  # finished before
        for done in range(500, 620, 10):
            told.update(done, failed=done // 300)
            clock.now += 1
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "hgorun: a sweep: 55 %, 550 of 1000 members, 10/s, 45 s left, 1 lost or failed",
        "hgorun: a sweep: 60 %, 600 of 1000 members, 10/s, 40 s left, 2 lost or failed",
    ]


def test_what_is_over_soon_says_nothing(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    for terminal in (False, True):
        with pytest.MonkeyPatch.context() as patch, shown(1.0, "a run") as told:
            patch.setattr(progress, "_at_a_terminal", lambda terminal=terminal: terminal)
            for part in (0.1, 0.5, 1.0):
                told.update(part)
                clock.now += 0.1
    with shown(1.0, "a run", show=False) as told:
        clock.now += 100
        told.update(0.5)
    assert capsys.readouterr().err == ""


@pytest.mark.costly
def test_a_bar_is_drawn_at_a_terminal(
    clock: Clock, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "_at_a_terminal", lambda: True)
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "120")
    with shown(200, "a [b] sweep", "members") as told:
        told.update(0)
        clock.now += 2
        told.update(50, failed=3, what="another [b] sweep")
    err = capsys.readouterr().err
    assert "25 %, 50 of 200 members, 25/s, 6 s left, 3 lost or failed" in err
    assert "another [b] sweep" in err


def test_durations_are_readable() -> None:
    assert [duration(s) for s in (0.2, 59.4, 200, 7500, -1)] == ["0 s", "59 s", "3 min 20 s", "2 h 5 min", "0 s"]
