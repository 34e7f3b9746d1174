"""A single stamp that is mistyped is named with its line, and is no reason to read all others otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from logs import recorded

from hgorun.errors import HgorunError

DAYS = [f"2026-05-{day:02d} 10:00" for day in range(6, 12)]
MORE_DAYS = [f"2026-05-{day:02d} 10:00" for day in range(6, 20)]
MINUTES = [f"2026-05-05 10:{minute:02d}" for minute in range(1, 20)]
GERMAN = [f"{day:02d}.05.2026 10:00" for day in range(6, 12)]
IN_DAYS_AND_MONTHS = [f"2026-{day:02d}-05 10:00" for day in range(8, 13)]
MISTYPED = "the others are dates in order, and this one alone is wrong: correct it in the file"
AHEAD = "is later than stamps below it, and without it all are in order; correct it, or take its row out"


def said(folder: Path, stamps: Sequence[str], form: str | None = None) -> str:
    content = "t,glucose\n" + "".join(f"{stamp},{20 + k % 3}\n" for k, stamp in enumerate(stamps))
    time = {"column": "t"} | ({"format": form} if form else {})
    with pytest.raises(HgorunError) as caught:
        recorded(folder, content, {"time": time})
    return str(caught.value)


@pytest.mark.parametrize("rest", [DAYS, MORE_DAYS, MINUTES])
@pytest.mark.parametrize("place", [0, 3])
def test_a_month_that_is_none_is_one_stamps_fault(tmp_path: Path, rest: list[str], place: int) -> None:
    stamps = [*rest[:place], "2026-13-05 10:00", *rest[place:]]
    told = said(tmp_path, stamps)
    assert f"log.csv:{place + 2}: t: '2026-13-05 10:00': there is no month 13; {MISTYPED}" in told


def test_so_it_is_in_a_pattern(tmp_path: Path) -> None:
    told = said(tmp_path, ["05.13.2026 10:00", *GERMAN], "%d.%m.%Y %H:%M")
    assert told.endswith(
        f"log.csv:2: t: expected a date of the form %d.%m.%Y %H:%M, found '05.13.2026 10:00'; {MISTYPED}"
    )


@pytest.mark.parametrize("beyond", [["2026-13-05 10:00"], ["2026-13-05 10:00", "2026-14-05 10:00"]])
def test_days_that_follow_each_other_only_when_exchanged_are_read_so(tmp_path: Path, beyond: list[str]) -> None:
    told = said(tmp_path, [*IN_DAYS_AND_MONTHS, *beyond])
    assert told.endswith('needs its pattern, such as time: {column: t, format: "%Y-%d-%m %H:%M"}')


@pytest.mark.parametrize(
    ("stamps", "form", "line"),
    [
        (["2026-06-05 10:00", *DAYS], None, 2),
        (["2026-12-05 10:00", *DAYS], None, 2),
        (["2026-06-05 10:00", *MORE_DAYS], None, 2),
        (["2026-06-05 10:00", *MINUTES], None, 2),
        ([*DAYS[:3], "2026-06-09 10:00", *DAYS[3:]], None, 5),
        (["05.06.2026 10:00", *GERMAN], "%d.%m.%Y %H:%M", 2),
        (["0", "1", "20", "3", "4", "5"], None, 4),
    ],
)
def test_a_stamp_that_is_ahead_of_all_others_is_named(
    tmp_path: Path, stamps: list[str], form: str | None, line: int
) -> None:
    told = said(tmp_path, stamps, form)
    assert f"log.csv:{line}: outputs.S: the time stamp " in told
    assert told.endswith(AHEAD)


@pytest.mark.parametrize(
    ("stamps", "line"),
    [
        ([*DAYS[:5], "2026-04-11 10:00"], 7),
        (["0", "1", "3", "2", "4", "5"], 5),  # either may be wrong
        (["0", "5", "6", "2", "3", "4"], 5),
        (["5", "1", "2"], 3),  # too few to say which
    ],
)
def test_otherwise_it_is_the_one_that_lies_behind(tmp_path: Path, stamps: list[str], line: int) -> None:
    assert f"log.csv:{line}: outputs.S: the time stamp " in (told := said(tmp_path, stamps))
    assert "lies before one above it" in told
