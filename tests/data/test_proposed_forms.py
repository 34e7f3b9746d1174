"""Dates of which no pattern was known, or a wrong one: what is proposed reads them rightly."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.errors import ConfigError

FOUR = "four numbers between colons may be days to seconds, or hours to seconds with the frames of a video"


def content(stamps: list[str]) -> str:
    return "t;glucose\n" + "".join(f"{stamp};{k % 3}\n" for k, stamp in enumerate(stamps))


def message_of(folder: Path, stamps: list[str]) -> str:
    with pytest.raises(ConfigError) as found:
        recorded(folder, content(stamps))
    return found.value.message


@pytest.mark.parametrize(
    ("stamps", "form", "times"),
    [
        (["31 May 2024", "1 June 2024"], "%d %B %Y", [0, 86400]),
        (["31 May 2024", "1 Jun 2024"], "%d %b %Y", [0, 86400]),
        (["Fri May 31 13:45:10 CEST 2024", "Fri May 31 12:45:20 CET 2024"], "%a %b %d %H:%M:%S %Z %Y", [0, 10]),
        (["2024-05-31 13", "2024-05-31 14"], "%Y-%m-%d %H", [0, 3600]),
        (["2024. 05. 31. 13:00", "2024. 05. 31. 13:01"], "%Y. %m. %d. %H:%M", [0, 60]),
        (["31. 5. 2024 13:00", "1. 6. 2024 13:00"], "%d. %m. %Y %H:%M", [0, 86400]),
        (["3. 5.2024  1:00", "13. 5.2024 11:00"], "%d.%m.%Y %H:%M", [0, 240 * 3600 + 36000]),
        (["31.05.2024 23:00", "31.05.2024 24:00"], "%d.%m.%Y %H:%M", [0, 3600]),
        (["31.05.2024 23:45", "01.06.2024"], "%d.%m.%Y %H:%M", [0, 900]),
        (["5/31/2024 0:30 PM", "5/31/2024 1:30 PM"], "%m/%d/%Y %I:%M %p", [0, 3600]),
        (["0:20.6", "0:41.2", "75:00.0"], "%M:%S.%f", [0, 20.6, 4479.4]),
        (["2024:152:11:28:47", "2024:152:11:28:57"], "%Y:%j:%H:%M:%S", [0, 10]),
        (["13:45:10:007", "13:45:10:27"], "%H:%M:%S:%f", [0, 0.263]),
    ],
)
def test_what_is_proposed_reads_the_log(tmp_path: Path, stamps: list[str], form: str, times: list[float]) -> None:
    assert f'time: {{column: t, format: "{form}"}}' in message_of(tmp_path, stamps)
    found = recorded(tmp_path, content(stamps), {"time": {"column": "t", "format": form}})
    assert np.allclose(found.outputs["S"].taken, times, rtol=0, atol=1e-6)


@pytest.mark.parametrize("stamps", [["00:00:00:24", "00:00:01:02"], ["0:01:41:40", "0:03:23:20"]])
def test_of_four_numbers_no_pattern_is_proposed(tmp_path: Path, stamps: list[str]) -> None:
    message = message_of(tmp_path, stamps)
    assert FOUR in message
    assert "%" not in message


def test_of_two_numbers_both_readings_are_said(tmp_path: Path) -> None:
    assert message_of(tmp_path, ["0:20", "0:40", "1:00"]).endswith(
        'time: {column: t, format: "%H:%M"} where these are hours and minutes, '
        'time: {column: t, format: "%M:%S"} where they are minutes and seconds'
    )


def test_two_numbers_that_pass_midnight_are_hours(tmp_path: Path) -> None:
    assert re.search(r'such as time: \{column: t, format: "%H:%M"\}$', message_of(tmp_path, ["23:50", "0:10"]))


def test_a_half_of_the_day_is_no_zone(tmp_path: Path) -> None:
    assert message_of(tmp_path, ["13:45 PM"]).endswith("what is the same in all stands as it is")
