"""Where the engine's numbers lie: every place belongs to one thing."""

from __future__ import annotations

import pytest

from hgorun.engine.layout import CONTEXT, WORD, Held


@pytest.mark.parametrize(("outputs", "observers", "inputs"), [(1, 0, 0), (1, 3, 0), (2, 1, 2), (3, 2, 1)])
def test_w_is_filled_without_gaps_and_nothing_shares_a_place(outputs: int, observers: int, inputs: int) -> None:
    held = Held(outputs, observers, inputs)
    places = [held.interval]
    for i in range(outputs):
        places += [held.noise(i), held.previous(i), held.output(i), *(held.s(i, j) for j in range(observers))]
        # what is copied as a row: an output, then every observer's s
        assert [held.s(i, j) - held.output(i) for j in range(observers)] == list(range(1, observers + 1))
    places += [place for k in range(inputs) for place in held.input(k)]
    assert sorted(places) == list(range(held.size))


def test_every_word_of_the_context_has_its_own_place() -> None:
    assert [WORD[name] for name in CONTEXT] == list(range(len(CONTEXT)))
