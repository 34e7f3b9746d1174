"""Things that are made in a thread."""

import threading
from collections.abc import Iterator

import pytest

from hgorun.ahead import ahead


def _counted(made: list[int], stop: int) -> Iterator[int]:
    for k in range(stop):
        made.append(k)
        yield k


def test_things_come_in_their_order() -> None:
    with ahead(_counted([], 50), 3) as things:
        assert list(things) == list(range(50))


def test_few_are_made_before_they_are_asked_for_and_none_afterwards() -> None:
    made: list[int] = []
    with ahead(_counted(made, 1000), 2) as things:
        assert next(things) == 0
    assert len(made) <= 10
    assert not any(thread.name == "making things ahead" for thread in threading.enumerate())


def test_what_is_raised_comes_behind_what_was_made() -> None:
    def failing() -> Iterator[int]:
        yield 1
        raise KeyError("two")

    with ahead(failing()) as things:
        assert next(things) == 1
        with pytest.raises(KeyError, match="two"):
            next(things)
