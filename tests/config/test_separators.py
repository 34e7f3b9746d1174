"""What stands between a key and its value: a colon and a space, for every key, wherever it stands."""

from __future__ import annotations

import pytest

from hgorun.config.separators import misread, without_space
from hgorun.config.yaml_source import parse
from hgorun.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "line", "right"),
    [
        ("a:\n  theta:8\n  type: shgo\n", 2, "theta: 8"),
        ("a:\n  type: shgo\n  theta:8\n", 3, "theta: 8"),
        ("a: {type: shgo, theta:8}\n", 1, "theta: 8"),
        ("a: {theta :8, type: shgo}\n", 1, "theta: 8"),
        ("a: {type: shgo,\n  theta:8}\n", 2, "theta: 8"),
        ("seed:3\na: 1\n", 1, "seed: 3"),
        ("a: 1\nseed:3\n", 2, "seed: 3"),
        ("time:{end: 1}\n", 1, "time: {..."),
        ("a: {b:{c: 1}}\n", 1, "b: {..."),
        ("a:\n  - type:gaussian\n    std: 1\n", 2, "type: gaussian"),
        ("a:\n  x1:x2 - 3*x1\n  x2: u\n", 2, "x1: x2 - 3*x1"),
    ],
)
def test_a_colon_without_a_space_is_told_at_its_line(text: str, line: int, right: str) -> None:
    with pytest.raises(ConfigError) as raised:
        parse(text, "c.yaml")
    assert (raised.value.line, str(raised.value).endswith(f"behind the colon, as in {right}")) == (line, True), raised


@pytest.mark.parametrize("text", ["a:\n  b: 1\n  theta = 8\n  c: 1\n", "a: {theta= 8}\n", "a: 1\ntheta = 8\n"])
def test_a_sign_of_equality_is_no_colon(text: str) -> None:
    with pytest.raises(ConfigError, match=r"a colon separates a name from its value, as in theta: 8$"):
        parse(text, "c.yaml")


@pytest.mark.parametrize("text", ["a: 1", "url: http://a.b/c", "f == 2", "12:30", "noon, 12:30", "a", ":x", 'a: "b:c"'])
def test_other_texts_are_left_alone(text: str) -> None:
    assert (without_space(text), misread(text)) == ("", "")


@pytest.mark.parametrize("text", ["a: b: c", "a: noise: 5 %"])
def test_a_text_with_colons_and_spaces_needs_quotes(text: str) -> None:
    with pytest.raises(ConfigError, match="needs quotes"):
        parse(text, "c.yaml")


def test_of_two_keys_the_first_is_shown() -> None:
    assert misread("theta:8 type:shgo") == "a space belongs behind the colon, as in theta: 8"
    assert misread("x1 = x2 x2 = -x1") == "a colon separates a name from its value, as in x1: x2"
    assert misread("x1 = x2*(x1 == 1) x2: 1") == "a colon separates a name from its value, as in x1: x2*(x1 == 1)"
