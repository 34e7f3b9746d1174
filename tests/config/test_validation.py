"""What is wrong with a block, in words of ours: whatever pydantic calls it in the version installed."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import Field

from hgorun.config import validation
from hgorun.config.types import Block, Number, Positive
from hgorun.config.validation import validate
from hgorun.config.yaml_source import parse
from hgorun.errors import ConfigError


class Example(Block):
    size: Positive = 1.0
    share: Annotated[float, Field(ge=0, le=1, strict=True)] = 0.5
    most: Annotated[int, Field(lt=10, strict=True)] = 1
    mode: Literal["fast", "slow"] = "fast"
    text: str = ""
    flag: Annotated[bool, Field(strict=True)] = False
    pair: tuple[Number, Number] = (0.0, 1.0)
    names: dict[str, str] = Field(default_factory=dict)
    all: list[str] = Field(default_factory=list)


def refusal(text: str) -> str:
    source = parse(text, "f.yaml")
    with pytest.raises(ConfigError) as caught:
        validate(Example, source.data, source, ())
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("size: 0", "size: expected a number above 0, found 0"),
        ("share: -1", "share: expected a number of at least 0.0, found -1"),
        ("share: 2", "share: expected a number of at most 1.0, found 2"),
        ("share: much", "share: expected a number, found 'much'"),
        ("most: 10", "most: expected a number below 10, found 10"),
        ("most: 1.5", "most: expected a whole number, found 1.5"),
        ("mode: quick", "mode: expected 'fast' or 'slow', found 'quick'"),
        ("text: [1]", "text: expected text, found a list"),
        ("flag: 1", "flag: expected true or false, found 1"),
        ("pair: 1", "pair: expected a list, found 1"),
        ("pair: [1]", "pair: expected a list of at least 2, found 1"),
        ("pair: []", "pair: expected a list of at least 1, found 0"),
        ("pair: [1, 2, 3]", "pair: expected a list of at most 2, found a list"),
        ("pair: [1, 2 +]", "pair.1: "),
        ("names: x", "names: expected a mapping, found 'x'"),
        ("all: x", "all: expected a list, found 'x'"),
        ("tize: 1", "tize: unknown key 'tize'. Did you mean `size`?"),
        ("mode:", "mode: this key has no value"),
    ],
)
def test_the_message_is_known_by_the_type_of_the_error(text: str, message: str) -> None:
    assert refusal(text).startswith(f"f.yaml:1: {message}")


def test_an_error_of_a_type_not_met_before_has_a_message_too(monkeypatch: pytest.MonkeyPatch) -> None:
    expected: dict[str, Any] = {}
    monkeypatch.setattr(validation, "_EXPECTED", expected)
    assert refusal("text: 5") == "f.yaml:1: text: expected another value, found 5"
