"""A watched block is an instance of its class like any other, and nothing that is read of it goes unnoticed."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cached_property, singledispatch
from typing import ClassVar

import pytest
from pydantic import PrivateAttr

from hgorun.config.reads import Reads, frozen
from hgorun.config.types import Block


class Base(Block):
    gain: float = 1.0

    def scaled(self) -> float:
        return self.gain


class Mine(Base):
    FACTOR: ClassVar[float] = 3.0
    theta: float = 2.0
    unused: float = 5.0
    _kept: float = PrivateAttr(default=7.0)

    @property
    def squared(self) -> float:
        return self.theta**2

    @cached_property
    def halved(self) -> float:
        return self.theta / 2

    def scaled(self) -> float:
        return super().scaled() * self.FACTOR


@singledispatch
def kind(_: object) -> str:
    return "another"


@kind.register
def _(_: Mine) -> str:
    return "mine"


EVERYTHING = set(Mine.model_fields)


@pytest.mark.parametrize(
    ("read", "value", "keys"),
    [
        (lambda m: m.theta, 2.0, {"theta"}),
        (lambda m: m.squared, 4.0, {"theta"}),
        (lambda m: m.halved, 1.0, EVERYTHING),
        (lambda m: m.scaled(), 3.0, {"gain"}),
        (lambda m: type(m).FACTOR, 3.0, set()),
        (lambda m: m.__class__, Mine, set()),
        (lambda m: type(m).__name__, "Mine", set()),
        (lambda m: list(type(m).model_fields), list(Mine.model_fields), set()),
        (lambda m: isinstance(m, Mine) and isinstance(m, Base), True, set()),
        (kind, "mine", set()),
        (lambda m: getattr(m, "nothing", None), None, set()),
        (lambda m: m.model_dump()["theta"], 2.0, EVERYTHING),
        (lambda m: dict(m), {"gain": 1.0, "theta": 2.0, "unused": 5.0}, EVERYTHING),
        (lambda m: vars(m)["theta"], 2.0, EVERYTHING),
        (repr, "Mine(gain=1.0, theta=2.0, unused=5.0)", EVERYTHING),
        (lambda m: m.model_copy(update={"theta": 3.0}).theta, 3.0, EVERYTHING),
        (lambda m: m == Mine(), True, EVERYTHING),
        (lambda m: m._kept, 7.0, EVERYTHING),
    ],
)
def test_what_is_read_is_right_and_is_noticed(read: Callable[[Mine], object], value: object, keys: set[str]) -> None:
    reads = Reads(Mine())
    assert read(reads.watched) == value
    assert reads.keys & EVERYTHING == keys


def test_what_was_kept_on_the_block_before_may_follow_from_any_key() -> None:
    block = Mine()
    assert block.halved == 1.0
    reads = Reads(block)
    assert reads.watched.halved == 1.0
    assert reads.keys == EVERYTHING


def test_what_is_kept_on_the_watched_block_is_found_there_and_nowhere_else() -> None:
    block = Mine()
    watched = Reads(block).watched
    object.__setattr__(watched, "_kept_by_force", 1)
    assert vars(watched)["_kept_by_force"] == 1
    assert "_kept_by_force" not in vars(block)


def test_reads_hold_for_blocks_with_the_same_values_where_it_was_read() -> None:
    reads = Reads(Mine())
    assert reads.watched.squared == 4.0
    assert reads.hold_for(Mine(unused=6.0))
    assert not reads.hold_for(Mine(theta=3.0))
    assert not reads.hold_for(Base())


def test_which_keys_were_given_can_matter_too() -> None:
    reads = Reads(Mine())
    assert reads.watched.model_fields_set == set()
    assert not reads.hold_for(Mine(theta=2.0))


@pytest.mark.parametrize("value", [{"a": [1, {"b": (2.5,)}], "c": "x"}, [[], {}], 3.0, "text", None])
def test_values_as_a_key(value: object) -> None:
    """Equal values have equal keys, and lists and tuples, as YAML and blocks have them, do not differ."""
    assert hash(frozen(value)) == hash(frozen(copy.deepcopy(value)))
    assert frozen(value) == frozen(copy.deepcopy(value))
    assert frozen([1, {"a": [2]}]) == frozen((1, {"a": (2,)})) != frozen((1, {"a": (3,)}))
