"""Newlines are counted, and what is not plain is found, as Python does."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.native.line_ends import newlines_of


@pytest.mark.parametrize("size", [0, 1, 7, 63, 64, 65, 128, 1000])
def test_newlines_of_plain_texts(size: int) -> None:
    random = np.random.default_rng(size)
    text = random.choice(np.array([1, 9, 10, 12, 14, 65, 127], dtype=np.uint8), size).tobytes()
    for one in (text, size * b"\n", size * b"a", text + b"\n"):
        assert newlines_of(one) == (one.count(b"\n"), True)


@pytest.mark.parametrize("other", [b"\0", b"\r", b"\x80", b"\xff", b"\xc3\xa4"])
@pytest.mark.parametrize("place", [0, 1, 62, 63, 64, 127, 128, 150])
def test_what_is_not_plain_is_found_anywhere(other: bytes, place: int) -> None:
    text = place * b"\n" + other + (150 - place) * b"a"
    assert newlines_of(text) == (place, False)
    assert newlines_of(text + 100 * b"\n") == (place + 100, False)
