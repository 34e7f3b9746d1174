"""Patterns that are compiled late find what those of ``re`` find."""

from __future__ import annotations

import re

import pytest

from hgorun.patterns import Pattern


@pytest.mark.parametrize("text", ["", "12 m", "m 12, M 3", "12"])
def test_what_is_found_is_what_re_finds(text: str) -> None:
    late, known = Pattern(r"m?\s?(\d+)", re.IGNORECASE), re.compile(r"m?\s?(\d+)", re.IGNORECASE)
    for found, expected in (
        (late.match(text), known.match(text)),
        (late.match(text, 1), known.match(text, 1)),
        (late.fullmatch(text), known.fullmatch(text)),
        (late.search(text), known.search(text)),
    ):
        assert (found and found.span(1)) == (expected and expected.span(1))
    assert [one[1] for one in late.finditer(text)] == known.findall(text)
    assert late.sub("x", text) == known.sub("x", text)
    assert late.sub(lambda one: one[1] * 2, text) == known.sub(lambda one: one[1] * 2, text)


def test_nothing_is_compiled_before_it_is_used() -> None:
    wrong = Pattern("(")
    with pytest.raises(re.error):
        wrong.search("x")
