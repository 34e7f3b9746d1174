"""A separator that is told and that a file does not have."""

from __future__ import annotations

from pathlib import Path

import pytest
from logs import recorded

from hgorun.errors import ConfigError, Problem

LOG = "t;glucose\n0;1,5\n1;1,7\n2;1,6\n"


def test_a_separator_that_is_not_between_names_is_told_with_the_one_that_is(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        recorded(tmp_path, LOG, {"csv": {"separator": ","}})
    assert error.value.message == "csv.separator is ',', which is not between the names of columns: ';' makes 2"
    assert error.value.line == 1
    assert recorded(tmp_path, LOG, {"csv": {"separator": ";"}}).outputs["S"].values.tolist() == [1.5, 1.7, 1.6]


def test_dates_with_and_without_a_zone_are_told_what_is_right(tmp_path: Path) -> None:
    content = "t,glucose,s,lab\n2026-05-01T10:00Z,1,2026-05-01T10:00,3\n2026-05-01T10:01Z,2,2026-05-01T10:01,4\n"
    with pytest.raises(Problem, match=r"others none: .*; write the zone behind those that have none, as in 2024"):
        recorded(tmp_path, content, {"outputs": {"S": "glucose", "X": {"column": "lab", "time": "s"}}})
