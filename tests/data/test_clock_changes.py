"""Local time without a zone where clocks are put forward or back, beside the rules of the time zone database."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from logs import recorded

from hgorun.data.faults.clock_changes import put_back, put_forward
from hgorun.data.recording import Origin
from hgorun.errors import ConfigError

SPRING = {"Europe/Berlin": (29, 1), "Europe/London": (29, 1), "Europe/Helsinki": (29, 1), "America/Chicago": (8, 8)}
AUTUMN = {"Europe/Berlin": (10, 25, 1), "Europe/Lisbon": (10, 25, 1), "America/New_York": (11, 1, 6)}
STEPS = [0.5, 5, 60]


def local(zone: str, change: datetime, step: float, count: int = 40) -> list[datetime]:
    """Stamps of a log around a change of clocks, every some minutes, as a clock of that zone shows them."""
    begin = change.replace(tzinfo=UTC) - timedelta(minutes=step * (count // 2) - 0.25)
    stamps = [begin + timedelta(minutes=step * k) for k in range(count)]
    return [stamp.astimezone(ZoneInfo(zone)).replace(tzinfo=None) for stamp in stamps]


def times(stamps: list[datetime]) -> tuple[np.ndarray, Origin]:
    """In hours from the first one."""
    epoch = np.datetime64(stamps[0], "ns")
    return np.array([(stamp - stamps[0]) / timedelta(hours=1) for stamp in stamps]), Origin(unit="h", epoch=epoch)


def log(stamps: list[datetime], zone: str = "") -> str:
    return "t,glucose\n" + "".join(f"{stamp.isoformat()}{zone},{k * 7 % 5}\n" for k, stamp in enumerate(stamps))


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("zone", SPRING)
def test_an_hour_that_clocks_skip_is_found(zone: str, step: float) -> None:
    day, hour = SPRING[zone]
    assert put_forward(*times(local(zone, datetime(2026, 3, day, hour), step))).tolist() == [20]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("zone", AUTUMN)
def test_an_hour_that_comes_twice_is_found(zone: str, step: float) -> None:
    month, day, hour = AUTUMN[zone]
    assert put_back(*times(local(zone, datetime(2026, month, day, hour), step))).tolist() == [20]


@pytest.mark.parametrize("year", range(2023, 2028))
def test_other_nights_are_no_changes(year: int) -> None:
    """Of all nights of a year, those alone in which clocks of Europe or North America are changed."""
    midnights = [datetime(year, 1, 1) + timedelta(days=day) for day in range(365)]
    skipped, twice = [0.0, 0.5, 1.0, 1.5, 3.0, 3.5, 4.0], [0.5, 1.0, 1.5, 2.0, 1.5, 2.0, 2.5, 3.0]
    found: list[set[tuple[int, int]]] = [set(), set()]
    for midnight in midnights:
        origin = Origin(unit="h", epoch=np.datetime64(midnight, "ns"))
        for hours, rule, days in ((skipped, put_forward, found[0]), (twice, put_back, found[1])):
            if rule(np.array(hours), origin).size:
                days.add((midnight.month, midnight.day))
    forward: set[tuple[int, int]] = set()
    back: set[tuple[int, int]] = set()
    for midnight in midnights:
        for zone in ("Europe/Paris", "America/Chicago"):
            ends = [(midnight + timedelta(days=k)).replace(tzinfo=ZoneInfo(zone)).utcoffset() for k in (0, 1)]
            before, after = (end.total_seconds() for end in ends if end is not None)
            if after > before:
                forward.add((midnight.month, midnight.day))
            elif after < before:
                back.add((midnight.month, midnight.day))
    assert found == [forward, back]


def test_stamps_with_a_zone_and_slow_logs_have_none() -> None:
    taken, origin = times(local("Europe/Berlin", datetime(2026, 3, 29, 1), 5))
    zoned = Origin(unit="h", epoch=origin.epoch, zone="UTC")
    assert not put_forward(taken, zoned).size
    assert not put_back(taken[:4], origin).size
    assert not put_back(np.array([3.0, 2.0, 1.0]), Origin(unit="s")).size  # of numbers
    assert not put_forward(*times(local("Europe/Berlin", datetime(2026, 3, 29, 1), 120))).size


def test_spring_is_told_with_its_line(tmp_path: Path) -> None:
    notes = recorded(tmp_path, log(local("Europe/Berlin", datetime(2026, 3, 29, 1), 5))).notes
    assert [(note.kind, note.line, note.count) for note in notes] == [("clock", 22, 1)]
    assert "when clocks are put forward" in str(notes[0])
    assert str(notes[0]).endswith("right are stamps in UTC or with their zone (%z), or a log that is cut there")
    assert not recorded(tmp_path, log(local("UTC", datetime(2026, 3, 29, 1), 5))).notes


@pytest.mark.parametrize(
    ("step", "faults", "first"),
    [
        (5, {}, "lies before one above it"),
        (5, {"backwards": "sort"}, "has come before, on line 10"),
        (5, {"backwards": "drop"}, "has come before, on line 21"),
        (60, {}, "has come before, on line 21"),
    ],
)
def test_autumn_is_refused_with_what_is_right(tmp_path: Path, step: float, faults: dict[str, str], first: str) -> None:
    text = log(local("Europe/Berlin", datetime(2026, 10, 25, 1), step))
    with pytest.raises(ConfigError, match="when clocks are put back") as caught:
        recorded(tmp_path, text, {"faults": faults})
    assert first in str(caught.value)
    assert "right are stamps in UTC or with their zone" in str(caught.value)
    assert "faults:" not in str(caught.value)


def test_hours_that_are_mixed_as_told_are_noted(tmp_path: Path) -> None:
    text = log(local("Europe/Berlin", datetime(2026, 10, 25, 1), 5))
    notes = recorded(tmp_path, text, {"faults": {"backwards": "sort", "repeated": "mean"}}).notes
    assert [note.kind for note in notes] == ["backwards", "repeated"]
    assert all("two hours would be mixed; right are" in str(note) for note in notes)
    clear = recorded(tmp_path, log(local("UTC", datetime(2026, 10, 25, 1), 5), "Z"), {"faults": {"backwards": "sort"}})
    assert not clear.notes
