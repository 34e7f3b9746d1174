"""Which of the samples that enter observers at one place do so together: those of one channel one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hgorun.engine.layout import HybridSystem
from hgorun.estimate.gate.entering import Entering


class Turns:
    """The order of samples at one place.

    Parameters
    ----------
    system : HybridSystem
    taken : sequence of float
        When each sample of all outputs had been taken.
    """

    def __init__(self, system: HybridSystem, taken: Sequence[float]) -> None:
        self._corrections, self._taken = system.corrections, taken

    def of(self, entering: Sequence[Entering]) -> list[list[Entering]]:
        """The samples of each turn."""
        turns: list[list[Entering]] = [[]]
        count: dict[object, int] = {}
        for one, again in zip(entering, self.again(entering), strict=True):
            turn = count[one.channel] = count.get(one.channel, 0) + again
            turns += [[] for _ in range(turn + 1 - len(turns))]
            turns[turn].append(one)
        return turns

    def again(self, entering: Sequence[Entering]) -> Iterator[bool]:
        """Whether each sample enters after another one of its channel that does so at the same place.

        Of samples that correct observers, and were taken at different times, only the newest one does.
        """
        before = set[object]()
        for one in entering:
            corrects = any(first <= one.channel < last for _, first, last in self._corrections)
            key = one.channel, self._taken[one.used] if corrects else None
            yield key in before
            before.add(key)
