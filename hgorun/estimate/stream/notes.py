"""What a run that follows events knows beside its numbers, and how a checkpoint has it: as JSON, also of older ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

from hgorun.estimate.gate.gate import kept_of
from hgorun.estimate.gate.own_steps import LastTaken

Notes: TypeAlias = tuple[Any, ...]  # nothing in it changes any more
Counts: TypeAlias = Sequence[tuple[int, ...]]
InARow: TypeAlias = Sequence[tuple[tuple[int, int], ...]]
"""By output and observer how many samples a gate has left out one after the other, now and at most."""


def told(notes: Notes) -> list[Any]:
    """For a checkpoint."""
    *known, gate, offered, outliers, inputs, own, taken, rows, instants = notes
    kept = None if gate is None else [[kept_of(one) for one in row] for row in gate]
    left = [(j, last.told()) for j, last in own]
    return [*known, kept, offered, outliers, list(inputs.items()), left, taken, rows, instants]


def read(said: Sequence[Any], observers: int, offered: Counts, outliers: Counts) -> Notes:
    """What :func:`told` gave, read back from JSON.

    Parameters
    ----------
    observers : int
        How many there are.
    offered, outliers : sequence of tuple of int
        The counts of the run that goes on: those of older checkpoints, which have none.
    """
    heard, newest, pending, last_sample, gate, *more = said
    counts, inputs = more[:2] or (offered, outliers), more[2:3]
    judged, left_out = (tuple(_of_each(row, observers) for row in rows) for rows in counts)
    known = None if gate is None else [[(one, len(one)) for one in row] for row in gate]
    nothing = [((0, 0),) * observers] * len(heard)
    given = {number: value for pairs in inputs for number, value in pairs}
    return (
        tuple(heard),
        tuple(_of_each(row, observers) for row in newest),
        tuple(pending),
        last_sample,
        known,
        judged,
        left_out,
        given,
        tuple((j, LastTaken.of(last)) for left in more[3:4] for j, last in left),
        tuple(more[4]) if len(more) > 4 else (-math.inf,) * len(heard),
        tuple(tuple((now, most) for now, most in row) for row in (more[5] if len(more) > 5 else nothing)),
        more[6] if len(more) > 6 else 0,
    )


def increased(counts: tuple[int, ...], which: Sequence[int]) -> tuple[int, ...]:
    """Counts of which some are one more."""
    return tuple([count + (j in which) for j, count in enumerate(counts)])


def gone_on(rows: InARow, before: tuple[Counts, Counts], now: tuple[Counts, Counts]) -> InARow:
    """Rows of samples that were left out, when something more was judged.

    Parameters
    ----------
    before, now : tuple of Counts
        How many samples were judged, and how many of them left out.
    """
    if before[1] == now[1] and not any([count for row in rows for count, _ in row]):  # as it is most of the time
        return rows
    outputs = zip(rows, *before, *now, strict=True)
    return [tuple([_gone_on(*one) for one in zip(*of, strict=True)]) for of in outputs]


def _gone_on(row: tuple[int, int], offered: int, left_out: int, now: int, left_out_now: int) -> tuple[int, int]:
    """A row with one more sample, where one was judged: it ends where that is used."""
    if now == offered:
        return row
    count = row[0] + 1 if left_out_now > left_out else 0
    return count, max(count, row[1])


def _of_each(numbers: Any, observers: int) -> tuple[Any, ...]:
    """Those of each observer; older checkpoints have one for all of them."""
    return (numbers,) * observers if isinstance(numbers, int | float) else tuple(numbers)
