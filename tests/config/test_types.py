"""What a single value of a file may be: poles, names, expressions, and how a wrong one is described."""

from __future__ import annotations

from typing import Any

import pytest
from examples import chain, experiment

from hgorun.config.models import Time
from hgorun.config.study import Claim
from hgorun.config.types import Block, describe
from hgorun.errors import ConfigError
from hgorun.observers.shgo import StandardObserver


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "nothing"),
        ({}, "a mapping"),
        ([], "a list"),
        ((1,), "a list"),
        (2, "2"),
        ("x" * 70, "'" + 56 * "x" + "..."),
    ],
)
def test_what_was_found(value: object, text: str) -> None:
    assert describe(value) == text


@pytest.mark.parametrize(
    ("poles", "words"),
    [
        ([-1, "x", -2], "a pole is a number or text such as \"-1[+]2j\", found 'x'"),
        ([-1, {}, -2], "found a mapping"),
        ([-1, 2, -2], "must have a negative real part, found 2"),
        (["-1+1j", "-1+1j", -2], "-1\\+1j has no partner"),
        (["-1+1j", "-1-2j", -2], "has no partner"),
        (["-1-1e999j", -1, -1], "poles must be finite"),
    ],
)
def test_poles_that_are_refused(poles: list[object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        experiment(chain(3), {"o": {"type": "shgo", "theta": 1, "poles": poles}})


@pytest.mark.parametrize("poles", [["-1+2j", "-1 - 2i", -3], [-1, -2, "-3"], -2])
def test_poles_as_they_may_be_written(poles: object) -> None:
    experiment(chain(3), {"o": {"type": "shgo", "theta": 1, "poles": poles}})


@pytest.mark.parametrize("wrong", [True, [1], {"a": 1}])
def test_an_expression_is_text_or_a_number(wrong: object) -> None:
    with pytest.raises(ConfigError, match="expected an expression"):
        experiment({**chain(2), "phi": wrong}, {})


@pytest.mark.parametrize("wrong", [1, True, ["a"]])
def test_a_name_is_text(wrong: object) -> None:
    plant = {"states": [wrong], "dynamics": {"x": "0"}, "output": "x", "initial": {"x": 1}}
    with pytest.raises(ConfigError, match="expected a name"):
        experiment(plant, {})


def test_a_block_and_poles_that_are_made_already_are_taken_as_they_are() -> None:
    made = StandardObserver(type="shgo", theta=2, poles=(-1 + 2j, -1 - 2j))
    assert made.poles == (-1 + 2j, -1 - 2j)
    assert StandardObserver.model_validate(made) is made


@pytest.mark.parametrize(
    ("cls", "keys", "words"),
    [
        (Time, {"start": 2, "end": 2, "output_step": 1}, "end must be after start, found end 2, start 2"),
        (Claim, {"id": "a", "claim": "b", "value": "1"}, "give exactly one of below, above and between"),
        (Claim, {"id": "a", "claim": "b", "value": "1", "below": 1, "above": 0}, "give exactly one of below"),
    ],
)
def test_keys_that_exclude_each_other(cls: type[Block], keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        cls.model_validate(keys)
