"""Logs whose clock begins again, and dates without their times: to sort them, or to take the first, would be wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import recorded, table

from hgorun.config.data import Data
from hgorun.data.faults.another_log import begun_again
from hgorun.errors import ConfigError

FIRST = np.round(0.1 * np.arange(30), 3)
VALUES = np.sin(np.arange(70.0))
SORT, TAKE = {"backwards": "sort"}, {"backwards": "sort", "repeated": "first"}


def refused(folder: Path, times: np.ndarray, faults: dict[str, Any]) -> str:
    with pytest.raises(ConfigError) as error:
        recorded(folder, table(times, VALUES[: times.size]), {"faults": faults})
    return error.value.message


@pytest.mark.parametrize("faults", [{}, SORT])
def test_a_second_log_behind_the_first_is_told_of(tmp_path: Path, faults: dict[str, Any]) -> None:
    """Also where the first advice, to sort, was followed."""
    said = refused(tmp_path, np.tile(FIRST, 2), faults)
    assert "as if another log began, or another signal, whose clock begins again" in said
    assert "; cut the file before line 32, and give each part a run of its own, or let the times" in said
    assert "faults: {" not in said


def test_it_is_told_where_they_are_mixed_all_the_same(tmp_path: Path) -> None:
    notes = recorded(tmp_path, table(np.concatenate([FIRST, FIRST + 0.05]), VALUES[:60]), {"faults": TAKE}).notes
    assert any("as if another log began" in str(note) for note in notes)


def test_of_files_each_is_to_be_run_alone(tmp_path: Path) -> None:
    (tmp_path / "more.csv").write_text(table(FIRST, VALUES[30:60]), encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        recorded(tmp_path, table(FIRST, VALUES[:30]), {"file": ["log.csv", "more.csv"]})
    assert f"; give each file a run of its own, as by hgorun estimate CONFIG {tmp_path}" in error.value.message


@pytest.mark.parametrize(
    "times",
    [
        np.concatenate([FIRST[:10], FIRST[8:9], FIRST[10:]]),  # one that is late
        np.concatenate([FIRST + 3, FIRST]),  # parts in another order
        np.concatenate([FIRST, FIRST[20:25] + 0.05, FIRST + 3]),  # sent again
        FIRST[::-1],
        np.concatenate([FIRST[:2], FIRST]),  # a false start
    ],
)
def test_other_disorder_is_none(tmp_path: Path, times: np.ndarray) -> None:
    assert begun_again(times, VALUES[: times.size]) is None
    assert "another log" not in refused(tmp_path, times, {})


def test_the_same_samples_again_are_none() -> None:
    assert begun_again(np.tile(FIRST, 2), np.tile(VALUES[:30], 2)) is None
    assert begun_again(np.tile(FIRST, 2), VALUES[:60]) == 30


def days(*count: int) -> str:
    rows = [f"{9 + day:02}.11.2026,{k % 7}\n" for day, many in enumerate(count) for k in range(many)]
    return "t,glucose\n" + "".join(rows)


def test_dates_without_times_of_day_are_told_of(tmp_path: Path) -> None:
    clock = {"time": {"column": "t", "format": "%d.%m.%Y"}}
    with pytest.raises(ConfigError, match=r"dates without a time of day: if that is in a column of its own, data.time"):
        recorded(tmp_path, days(4, 4), clock)
    with pytest.raises(ConfigError, match=r"has come before, on line 2; faults: \{repeated: first\}"):
        recorded(tmp_path, days(2, 1, 1, 1), clock)  # one day twice


@pytest.mark.parametrize("time", [["day", "clock"], {"column": ["day", "clock"]}])
def test_of_two_columns_the_clock_may_be_taken(time: Any) -> None:
    with pytest.raises(ValueError, match=r"or take that .* \{column: clock, format: '%H:%M:%S', next_day: true\}"):
        Data.model_validate({"file": "log.csv", "time": time, "outputs": {"S": "glucose"}})
