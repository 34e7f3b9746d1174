"""How an observer goes on as if a sample that has just arrived had not, in a file and in a stream."""

from __future__ import annotations

from typing import Protocol

from hgorun.engine.layout import HybridSystem
from hgorun.symbolic.evaluate import Floats


class Running(Protocol):
    """A run that can be looked at between events."""

    @property
    def z(self) -> Floats:
        """All states."""
        ...

    @property
    def w(self) -> Floats:
        """What is held."""
        ...


def jumps_by_several(system: HybridSystem, start: int) -> bool:
    """Whether the observer that begins there is corrected by all samples that arrive at once, of several outputs."""
    return any(system.jumps[number][0] == start and last - first > 1 for number, first, last in system.corrections)


def leave_out(system: HybridSystem, live: Running, output: int, j: int, z: Floats, w: Floats) -> None:
    """Let an observer go on as if a sample that has just arrived had not.

    Its innovation stays what it was; what it has jumped to is taken back.

    Parameters
    ----------
    j : int
        The observer's number.
    z, w : ndarray
        The states, and what is held, without the sample.
    """
    layout = system.held
    place, y = layout.s(output, j), layout.output(output)
    if system.has_alpha:
        alpha = system.alpha[output][j]
        before = w[place] + z[alpha] - w[y]
        live.w[place] = before + live.w[y] - live.z[alpha]
    start, stop, _ = system.blocks[j]
    live.z[start:stop] = z[start:stop]
