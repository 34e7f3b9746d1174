"""How members are cut into blocks: so that a block takes seconds, and little memory.

A block is what is lost when something is killed. Where its ends are has no influence on any number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hgorun.config.sweeps import Every
from hgorun.ensemble.blocks.carried import Carried
from hgorun.ensemble.members.ensemble import Ensemble

Range = tuple[int, int]

_FIRST, _MOST, _STEP = 32, 4096, 32  # members of the first block, of any, and what sizes are multiples of
_SECONDS = 2.0  # that a block should take
_BYTES = 2**25  # that a block may take


class Cuts(Iterator[Range]):
    """Ranges of members, one after the other; how long the next one is depends on what the others took.

    Parameters
    ----------
    gaps : sequence of (start, stop)
        The members to be carried out.
    most : int
        Members of a block at most.
    workers : int
        How many blocks are carried out side by side.
    """

    def __init__(self, gaps: Sequence[Range], most: int = _MOST, workers: int = 1) -> None:
        self._gaps = list(gaps)
        self._most, self._workers = max(most, 1), workers
        self._size = min(_FIRST, self._most)

    def __next__(self) -> Range:
        if not self._gaps:
            raise StopIteration
        start, stop = self._gaps[0]
        left = sum(b - a for a, b in self._gaps)
        share = -(-left // (2 * self._workers)) if self._workers > 1 else left
        end = min(stop, start + min(self._size, max(share, _STEP)))
        if stop - end < _STEP // 2 and stop - start <= self._most:
            end = stop  # no crumbs
        self._gaps[0] = (end, stop)
        if end == stop:
            del self._gaps[0]
        return start, end

    def learn(self, carried: Carried) -> None:
        """Take into account what a block has taken."""
        each = max(carried.seconds, 1e-9) / (carried.stop - carried.start)
        fitting = int(min(_SECONDS / each, self._most)) // _STEP * _STEP
        self._size = max(fitting, min(_STEP, self._most))


def most_members(ensemble: Ensemble) -> int:
    """How many members of an ensemble a block may hold."""
    base, kept = ensemble.base, ensemble.keep.trajectories
    m, n = len(base.observers), len(base.plant.model.states)
    each = 8 * m * n * len(ensemble.metrics) + 200 * (m + 1)
    if kept == "all" or isinstance(kept, Every):
        points = base.grid[0].size // base.grid[1] + 1
        each += 8 * points * n * (m + 1) // (1 if kept == "all" else kept.every)
    return max(1, min(_MOST, _BYTES // each))
