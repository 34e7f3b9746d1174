"""Times of a stream that are of local time, in the nights when clocks are put forward or back."""

from __future__ import annotations

import io
import json
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from mqtt_follower import Handed, follower
from shell import Shell

SPRING, AUTUMN = datetime(2026, 3, 29, 1, tzinfo=UTC), datetime(2026, 10, 25, 1, tzinfo=UTC)
HOUR, STEP, COUNT = 3600, 300, 40
CONFIG = """
time: {{unit: {unit}, start: {start}}}
plant: {{states: [a], dynamics: {{a: -a/10000}}, output: {{a: a}}}}
solver: {{step: 60}}
data: {{file: log.csv, time: t, outputs: {{a: level}}}}
observers: {{o: {{type: shgo, theta: 0.001, poles: -1, initial: {{a: 1}}}}}}
"""


def numbers(change: datetime, zone: str = "Europe/Berlin") -> list[int]:
    """Local times around a change of clocks as if they were of UTC: seconds since 1970."""
    stamps = [change + timedelta(seconds=STEP * (k - COUNT // 2)) for k in range(COUNT)]
    return [int(at.astimezone(ZoneInfo(zone)).replace(tzinfo=UTC).timestamp()) for at in stamps]


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


def written(shell: Shell, start: int, unit: str = "s") -> None:
    (shell.folder / "plant.yaml").write_text(CONFIG.format(start=start, unit=unit))


def lines(times: list[int], *, as_json: bool = False) -> list[str]:
    y = np.round(np.exp(-np.arange(len(times)) / 30), 4).tolist()
    if as_json:
        return [json.dumps({"t": t, "signal": "a", "y": value}) for t, value in zip(times, y, strict=True)]
    return ["t,signal,y", *(f"{t},a,{value}" for t, value in zip(times, y, strict=True))]


def streamed(shell: Shell, monkeypatch: pytest.MonkeyPatch, text: list[str], *more: str) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n".join(text)))
    return shell("estimate", "plant.yaml", "-", *more)


@pytest.mark.parametrize("dated", [True, False])
def test_an_hour_that_comes_again_is_named_where_it_is_refused(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, dated: bool
) -> None:
    """Also where times count from elsewhere."""
    times = numbers(AUTUMN)
    first = times[0] if dated else 100
    times = [t - times[0] + first for t in times]
    written(shell, first)
    code, out, err = streamed(shell, monkeypatch, lines(times))
    assert code == 2
    assert len(out.splitlines()) == 1 + COUNT // 2
    assert f"standard input:{COUNT // 2 + 2}: " in err
    assert "which has been reached; the times of a go back by an hour, as where clocks are put back: right are" in err
    assert "times in UTC" in err


@pytest.mark.parametrize("as_json", [True, False])
def test_an_hour_that_is_missing_is_told_once(shell: Shell, monkeypatch: pytest.MonkeyPatch, as_json: bool) -> None:
    times = numbers(SPRING)
    written(shell, times[0])
    code, _, err = streamed(shell, monkeypatch, lines(times, as_json=as_json))
    assert code == 0
    assert err.count("when clocks are put forward") == 1
    assert f"a, t = {times[COUNT // 2]}: the time stamps have no zone, and jump by an hour" in err


@pytest.mark.parametrize(
    ("change", "zone", "unit"),
    [(SPRING, "UTC", "s"), (SPRING + timedelta(days=1), "UTC", "s"), (SPRING, "Europe/Berlin", "-")],
)
def test_nothing_is_told_of_times_in_utc_nor_without_a_unit(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, change: datetime, zone: str, unit: str
) -> None:
    times = numbers(change, zone)
    if change != SPRING:
        times = [t + HOUR * (k >= COUNT // 2) for k, t in enumerate(times)]  # in another night
    written(shell, times[0], unit)
    for as_json in (True, False):
        assert streamed(shell, monkeypatch, lines(times, as_json=as_json))[::2] == (0, "")


def test_a_broker_loses_the_hour_that_comes_again_and_says_so(shell: Shell, capsys: pytest.CaptureFixture[str]) -> None:
    """Its samples would correct the estimates of the hour before; a process that begins anew knows of it, too."""
    times = numbers(AUTUMN)
    written(shell, times[0])
    wanted = [t for k, t in enumerate(times) if t > max(times[:k], default=0)]
    payloads = lines(times, as_json=True)
    for part in (payloads[:25], payloads[25:]):
        follower(publish=None).take_some(Handed(*part))
    out, err = capsys.readouterr()
    assert [json.loads(line)["t"] for line in out.splitlines()] == wanted
    assert len(wanted) == COUNT - HOUR // STEP
    assert err.count("a message is left out: the times of a go back by an hour, as where clocks are put back") == 2
    assert err.count(f"in this night: samples up to t = {times[COUNT // 2 - 1]} are left out; right are") == 2


def test_where_no_night_is_known_it_is_told_that_samples_count_as_late(
    shell: Shell, capsys: pytest.CaptureFixture[str]
) -> None:
    times = [t - numbers(AUTUMN)[0] for t in numbers(AUTUMN)]
    written(shell, 0)
    follower(publish=None).take_some(Handed(*lines(times, as_json=True)))
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == COUNT
    assert err.count("go back by an hour, as where clocks are put back, and count as those of late samples") == 1
    assert "left out" not in err


def test_checkpoints_that_know_nothing_of_times_are_read(shell: Shell, capsys: pytest.CaptureFixture[str]) -> None:
    times = numbers(AUTUMN)
    written(shell, times[0])
    payloads = lines(times, as_json=True)
    follower(publish=None).take_some(Handed(*payloads[:8]))
    stored = Path("state").read_bytes()
    head, _, rest = stored.partition(b"\n")
    magic, _, numbers_of = head.partition(b" ")
    Path("state").write_bytes(magic + b" " + json.dumps(json.loads(numbers_of)[:4]).encode() + b"\n" + rest)
    follower(publish=None).take_some(Handed(*payloads[8:16]))
    assert len(capsys.readouterr().out.splitlines()) == 16


@pytest.mark.parametrize("as_json", [True, False])
def test_an_hour_that_is_skipped_behind_a_checkpoint_is_told(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, as_json: bool
) -> None:
    """A stream that is started again skips what is older; where all is sent again, it is no other hour."""
    times, more = numbers(AUTUMN), ("--checkpoint", "state")
    written(shell, times[0])
    half = COUNT // 2
    assert streamed(shell, monkeypatch, lines(times[:half], as_json=as_json), *more)[::2] == (0, "")
    assert streamed(shell, monkeypatch, lines(times[:half], as_json=as_json), *more)[::2] == (0, "")
    code, out, err = streamed(shell, monkeypatch, lines(times[half:], as_json=as_json), *more)
    assert (code, len(out.splitlines())) == (0, half - HOUR // STEP + 1 + (not as_json))  # one is of the last time
    assert err.count("the times of a go back by an hour, as where clocks are put back in this night") == 1
    assert f"samples up to t = {times[half - 1]} are skipped as old ones" in err
