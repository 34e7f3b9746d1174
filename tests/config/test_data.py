"""The block ``data``: what may be written in short, and what is refused."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from hgorun.config.data import Data, Faults


def test_a_column_may_be_given_by_its_name_alone() -> None:
    short = Data.model_validate({"file": "log.csv", "time": "t", "outputs": {"S": "glucose"}, "inputs": {"F": "feed"}})
    long = Data.model_validate(
        {
            "file": ["log.csv"],
            "time": {"column": "t"},
            "outputs": {"S": {"column": "glucose"}},
            "inputs": {"F": {"column": "feed", "hold": "zero"}},
        }
    )
    assert short == long


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"outputs": {}}, "at least one output"),
        ({"outputs": {"S": 3}}, "the name of a column, or a mapping"),
        ({"time": ["date", "clock"]}, "a date and a time of day in two columns are not joined"),
        ({"outputs": {"S": {"colum": "a"}}}, "Did you mean `column`"),
        ({"time": {"column": "t", "format": "epoch"}}, "iso, unix, excel, excel1904 or a pattern"),
        ({"time": {"column": "t", "format": "iso", "unit": "s"}}, "has no unit"),
        ({"outputs": {"S": {"column": "a", "plausible": [3, 1]}}}, "low < high"),
        ({"outputs": {"S": {"column": "a", "quality": {"column": "q", "good": []}}}}, "at least one entry"),
    ],
)
def test_what_is_wrong_is_said(changes: dict[str, object], message: str) -> None:
    block = {"file": "log.csv", "time": "t", "outputs": {"S": "glucose"}} | changes
    with pytest.raises(ValidationError, match=message):
        Data.model_validate(block)


def test_faults_of_a_signal_go_over_those_of_all() -> None:
    everywhere = Faults(repeated="mean", filled="drop")
    assert Faults(filled="report").over(everywhere) == Faults(repeated="mean", filled="report")
