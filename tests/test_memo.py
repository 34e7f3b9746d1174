"""The bounded memory, and keys that are things themselves."""

from __future__ import annotations

from functools import partial

import pytest

from hgorun.memo import Memo, same


class Alike:
    """Equal to everything, and without a hash."""

    __hash__ = None  # type: ignore[assignment]  # what CasADi's symbols are like

    def __eq__(self, other: object) -> bool:
        return True


def test_a_thing_is_the_same_as_itself_only() -> None:
    one, other = Alike(), Alike()
    assert one == other
    assert same(one) == same(one)
    assert hash(same(one)) == hash(same(one))
    assert same(one) != same(other)
    assert len({same(one), same(other), same(one)}) == 2


def test_the_value_used_least_recently_goes_first() -> None:
    memo: Memo[int] = Memo(2)
    for key in (1, 2, 1, 3):
        memo.get(key, partial(int, key))
    assert memo.get(1, lambda: 100) == 1
    assert memo.get(2, lambda: 200) == 200


def test_a_value_is_kept_in_place_of_the_one_before() -> None:
    memo: Memo[int] = Memo(1, lambda value: value < 10)
    for value in (1, 2, 30):
        memo.put("key", value)
    assert memo.get("key", lambda: 100) == 2
    memo.put("other", 3)
    assert "key" not in memo


def test_what_raises_or_is_too_large_is_not_kept() -> None:
    memo: Memo[int] = Memo(2, lambda value: value < 10)

    def missing() -> int:
        raise KeyError("of the value, not of the key")

    with pytest.raises(KeyError, match="of the value"):
        memo.get("a", missing)
    assert memo.get("a", lambda: 20) == 20
    assert memo.get("a", lambda: 3) == 3
    assert memo.get("a", lambda: 4) == 3
    memo.clear()
    assert memo.get("a", lambda: 5) == 5
