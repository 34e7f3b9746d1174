"""Members that are looked at together: which of them are side by side."""

from __future__ import annotations

import pytest

from hgorun.ensemble.side_by_side.suspects import side_by_side


@pytest.mark.parametrize("ends", [[1.0] * 9, [0.1, 1.0, 0.1, 0.1, 0.1], [0.5], [0.2, 0.3, 0.9, 0.1, 0.8, 0.7], []])
@pytest.mark.parametrize("cost", [1.5, 2.0, 3.0])
def test_those_that_take_longest_are_alone_where_that_takes_less_time(ends: list[float], cost: float) -> None:
    lanes = 4

    def time(chosen: tuple[int, ...]) -> float:
        longest = sorted((ends[i] for i in chosen), reverse=True)[::lanes]
        return cost * sum(longest) + sum(end for i, end in enumerate(ends) if i not in chosen)

    chosen = tuple(side_by_side(dict(enumerate(ends)), lanes, cost))
    order = sorted(range(len(ends)), key=lambda i: -ends[i])
    assert time(chosen) == pytest.approx(min(time(tuple(order[k:])) for k in range(len(ends) + 1)))
