"""Tables in which samples arrive otherwise: some of them not at all, or one after the other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, NOTHING, REBASE, RECORD, RETAKE, SET, TAKE
from hgorun.engine.plan import Integers, Plan


def without(actions: Integers, samples: Collection[tuple[int, int]], flags: Collection[int]) -> Integers:
    """Rows of the action table in which some samples are noted only.

    Parameters
    ----------
    samples : collection of (channel, slot)
    flags : collection of int
        The places in w that say that they arrive.
    """
    found = actions.copy()
    for row in found:
        op, place = (int(word) for word in row[:2])
        if op == ARRIVE and _sample_of(row) in samples:
            row[0] = RECORD
        elif (op == SET and place in flags) or (op == REBASE and _sample_of(row) in samples):
            row[0] = NOTHING
    return found


def in_turns(actions: Integers, turns: Sequence[Collection[tuple[int, int]]], flags: range) -> Iterator[Integers]:
    """Rows of the action table so that some samples arrive one after the other, each with what it makes jump.

    All else happens with the first: what is set, what observers of one sample do, and samples that are in no turn.

    Parameters
    ----------
    turns : sequence of collection of (channel, slot)
        The samples of every turn.
    flags : range
        The places in w that say that samples arrive: set before every jump, and reset behind it.
    """
    of = {sample: number for number, samples in enumerate(turns) for sample in samples}
    turn, count, arrived = np.zeros(len(actions), dtype=int), Counter[tuple[int, int]](), set[int]()
    for k, row in enumerate(actions):
        op, place = (int(word) for word in row[:2])
        if op in (ARRIVE, RECORD, REBASE) or (op in (TAKE, RETAKE) and place in arrived):
            turn[k] = of.get(_sample_of(row), 0)
            arrived.add(place)
        elif op == JUMP or (op == SET and place in flags):
            turn[k] = count[op, place] // (1 if op == JUMP else 2)
            count[op, place] += 1
    for number in range(len(turns)):
        found = actions.copy()
        found[turn != number, 0] = NOTHING
        yield found


def _sample_of(row: Integers) -> tuple[int, int]:
    """The channel and the slot of the sample that is taken, arrives, or whose arrival counts alpha anew."""
    _, channel, slot, _, _ = row.tolist()
    return channel, slot


def with_stops(plan: Plan, at: Integers) -> tuple[Plan, np.ndarray]:
    """A plan in which what happens at some events is a segment of its own, without steps.

    Parameters
    ----------
    plan : Plan
        With the segments of the whole run.
    at : ndarray of int, shape (N,)
        The segments that begin with these events, ascending.

    Returns
    -------
    Plan
    ndarray of int, shape (N,)
        The segments without steps, each of which happens at one of the events.
    """
    here, counts = plan.spans[at], plan.counts.copy()
    events = np.column_stack([here[:, 0], here[:, 0], here[:, 2], here[:, 2]])
    alone = counts[at]
    alone[:, 0], alone[:, 1], alone[:, 2], alone[:, 6] = 1, 0, 0, 0
    counts[at, 4] = counts[at, 5]
    stops = at + np.arange(at.size)
    return (
        replace(plan, spans=np.insert(plan.spans, at, events, axis=0), counts=np.insert(counts, at, alone, axis=0)),
        stops,
    )
