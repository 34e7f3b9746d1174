"""Samples of one output that were taken at one time, and correct observers one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, RECORD, SET, TAKE, HybridSystem
from hgorun.pieces import distinct
from hgorun.simulation.timeline.kinds import Kind
from hgorun.simulation.timeline.replay import ROUND


def rounds_of(take: np.ndarray, arrive: np.ndarray, used: np.ndarray) -> np.ndarray | None:
    """In which round each sample of an output corrects: -1 where it does not, since a newer one arrives with it.

    None where there is one round only.

    Parameters
    ----------
    take, arrive : ndarray of int, shape (N,)
        The events at which they are taken and arrive; ascending, the latter first.
    used : ndarray of bool, shape (N,)
        False for those that come after newer ones.
    """
    if np.all(arrive[1:] > arrive[:-1]):
        return None
    first, end = (np.searchsorted(arrive, arrive, side=side) for side in ("left", "right"))
    corrects = used & (take == take[end - 1])
    before = np.cumsum(corrects) - corrects
    found = np.where(corrects, before - before[first], -1)
    return found if found.max(initial=0) > 0 else None


def in_rounds(output: int, base: int, take: np.ndarray, arrive: np.ndarray, rounds: np.ndarray) -> Iterator[Kind]:
    """What takes samples, and lets them arrive: each is compared with what the one before it has left.

    Parameters
    ----------
    base : int
        The slot of the first one.
    """
    for number in range(int(rounds.max()) + 1):
        which = np.flatnonzero(rounds == number if number else rounds <= 0)
        yield Kind.of(take[which], number * ROUND, TAKE, output, base + which)
        what = np.where(rounds[which] < 0, RECORD, ARRIVE).astype(np.int8)
        yield Kind.of(arrive[which], number * ROUND + 1, what, output, base + which)


def corrections(arrivals: Sequence[Sequence[np.ndarray]], system: HybridSystem, first: int) -> Iterator[Kind]:
    """What corrects observers by the outputs that a sample arrives of.

    Parameters
    ----------
    arrivals : sequence of sequence of ndarray
        Of every output that is not replayed, the events at which its samples arrive in each round.
    first : int
        Place among all that is set of the flags: a sample arrives just now, or does not.
    """
    if len(arrivals) == 1 == system.outputs:  # then it is the one that arrives, whenever there is a correction
        yield Kind.of(arrivals[0][0][:1], 2, SET, system.held.fresh(0), first)
    else:
        for i, of_rounds in enumerate(arrivals):
            for number, event in enumerate(of_rounds):
                yield Kind.of(event, number * ROUND + 2, SET, system.held.fresh(i), first)
                yield Kind.of(event, number * ROUND + 4, SET, system.held.fresh(i), first + 1)
    for jump, start, stop in system.corrections:
        if stop <= len(arrivals):
            own = arrivals[start:stop]
            for number in range(max(map(len, own))):
                events = np.concatenate([of_rounds[number] for of_rounds in own if number < len(of_rounds)])
                yield Kind.of(distinct(events), number * ROUND + 3, JUMP, jump)
