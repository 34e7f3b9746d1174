"""Signs of a pattern of dates that are not read, or stand there twice, are refused with the pattern that is meant."""

from __future__ import annotations

from datetime import datetime

import pytest
from pydantic import ValidationError

from hgorun.config.data import Clock


def told(pattern: str) -> str:
    with pytest.raises(ValidationError) as caught:
        Clock.model_validate({"column": "t", "format": pattern})
    return str(caught.value.errors()[0]["msg"])


@pytest.mark.parametrize(
    ("pattern", "wrong", "meant"),
    [
        ("%d.%m.%Y %H:%m", "%m stands there 2 times", "%d.%m.%Y %H:%M"),
        ("%d.%m.%Y %I:%m:%S %p", "%m stands there 2 times", "%d.%m.%Y %I:%M:%S %p"),
        ("%d.%M.%Y %H:%M", "%M stands there 2 times", "%d.%m.%Y %H:%M"),
        ("%Y-%m-%d %H:%M:%M", "%M stands there 2 times", "%Y-%m-%d %H:%M:%S"),
        ("%Y-%d-%d", "%d stands there 2 times", "%Y-%m-%d"),
        ("%Y-%m-%d %H:%M:%s", "%s is no sign of a pattern", "%Y-%m-%d %H:%M:%S"),
        ("%F %T", "%F is no sign of a pattern", "%Y-%m-%d %H:%M:%S"),
        ("%-d.%-m.%Y %k:%M", "%-d is no sign of a pattern", "%d.%m.%Y %H:%M"),
        ("%d.%m.%Y %h:%i:%s", "%h is no sign of a pattern", "%d.%m.%Y %H:%M:%S"),
        ("%d-%h-%Y %H:%M", "%h is no sign of a pattern", "%d-%b-%Y %H:%M"),
        ("%d.%m.%Y %H:%M%", "% is no sign of a pattern", "%d.%m.%Y %H:%M"),
    ],
)
def test_the_pattern_that_is_meant_is_said_and_taken(pattern: str, wrong: str, meant: str) -> None:
    assert told(pattern).endswith(f"format {pattern}: {wrong}. Did you mean `{meant}`?")
    Clock.model_validate({"column": "t", "format": meant})
    moment = datetime(2026, 11, 23, 0, 0, 0)
    assert datetime.strptime(moment.strftime(meant), meant) == moment


@pytest.mark.parametrize(
    ("pattern", "wrong"),
    [
        ("%Y %Y", "%Y stands there 2 times"),
        ("%f:%f:%f", "%f stands there 3 times"),
        ("%Q", "%Q is no sign of a pattern"),
        ("%d.%m.%Y %h:%m:%S", "%h is no sign of a pattern"),
        ("%", "% is no sign of a pattern"),
    ],
)
def test_where_no_pattern_can_be_meant_none_is_said(pattern: str, wrong: str) -> None:
    assert told(pattern).endswith(f"format {pattern}: {wrong}")


@pytest.mark.parametrize("pattern", ["100%% %d.%m.%Y %%", "%A, %d %B %y %I:%M:%S.%f %p %z", "%G-W%V-%u", "%Y-%j", "%c"])
def test_signs_that_are_read_are_taken(pattern: str) -> None:
    assert Clock.model_validate({"column": "t", "format": pattern}).format == pattern
