"""Blocks of instructions: what is computed in one vector, and what on lanes of its own."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hgorun.native.ir import Block


def noting(seen: list[tuple[int, tuple[str, ...]]]) -> Callable[..., str]:
    """A function of two arguments that notes on how many lanes it is computed, and of what."""

    def function(block: Block, *arguments: str) -> str:
        seen.append((block.lanes, arguments))
        return block.add(*arguments)

    return function


@pytest.mark.parametrize(("calls", "width"), [(2, 2), (3, 4), (4, 4), (5, 8)])
def test_calls_of_scalars_are_one_call_of_a_vector(calls: int, width: int) -> None:
    block, seen = Block(1, set()), list[tuple[int, tuple[str, ...]]]()
    found = block.side_by_side(noting(seen), [(f"%a{i}", f"%b{i}") for i in range(calls)])
    assert [lanes for lanes, _ in seen] == [width]
    assert len(set(found)) == calls
    assert sum("extractelement" in line for line in block.lines) == calls
    assert sum("fadd" in line for line in block.lines) == 1


@pytest.mark.parametrize(("lanes", "calls"), [(1, 1), (2, 1), (2, 3), (4, 2)])
def test_a_single_call_and_calls_of_vectors_stand_alone(lanes: int, calls: int) -> None:
    block, seen = Block(lanes, set()), list[tuple[int, tuple[str, ...]]]()
    arguments = [(f"%a{i}", f"%b{i}") for i in range(calls)]
    found = block.side_by_side(noting(seen), arguments)
    assert seen == [(lanes, one) for one in arguments]
    assert len(found) == calls
    assert not any("element" in line for line in block.lines)
