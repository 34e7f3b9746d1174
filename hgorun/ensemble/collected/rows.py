"""Members one after the other, whatever the blocks were in which they were carried out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.found import Block

_NAMES = ("observers", "states")


def part(block: Block, which: slice) -> Block:
    """Some of the members of a block."""
    return _each([block], lambda arrays: arrays[0][which])


def joined(blocks: Sequence[Block]) -> Block:
    """The members of several blocks as one."""
    return blocks[0] if len(blocks) == 1 else _each(blocks, np.concatenate)


def _each(blocks: Sequence[Block], of: Callable[[list[NDArray[np.generic]]], NDArray[np.generic]]) -> Block:
    """A block whose arrays are made of those of others."""
    first = blocks[0]
    arrays: dict[str, Any] = {
        field.name: of([getattr(block, field.name) for block in blocks])
        for field in fields(Block)
        if field.name not in (*_NAMES, "metrics")
    }
    metrics: dict[str, Any] = {name: of([block.metrics[name] for block in blocks]) for name in first.metrics}
    return Block(observers=first.observers, states=first.states, metrics=metrics, **arrays)


def batches(blocks: Iterable[Block], size: int) -> Iterator[Block]:
    """The same members in blocks of one size, but for the last: what is made of them does not tell how they came."""
    waiting: list[Block] = []
    count = 0
    for block in blocks:
        at = 0
        while at < len(block):
            taken = min(size - count, len(block) - at)
            waiting.append(part(block, slice(at, at + taken)))
            at, count = at + taken, count + taken
            if count == size:
                yield joined(waiting)
                waiting, count = [], 0
    if waiting:
        yield joined(waiting)


def rectangles(shape: Sequence[int], start: int, stop: int) -> Iterator[tuple[tuple[slice, ...], int, int]]:
    """A range of places in an array of some shape, counted row after row, as rectangles.

    Yields
    ------
    (slices, start, stop)
        A rectangle, and which of the places it holds.
    """
    if start >= stop:
        return
    if len(shape) == 1:
        yield (slice(start, stop),), start, stop
        return
    inner = int(np.prod(shape[1:], dtype=np.int64))
    rows = range(-(-start // inner), stop // inner)  # that are whole
    if not rows:
        ends = sorted({start, min(stop, rows.start * inner), stop})
        parts = list(pairwise(ends))
    else:
        parts = [(start, rows.start * inner), (rows.stop * inner, stop)]
        everything = tuple(slice(0, length) for length in shape[1:])
        yield (slice(rows.start, rows.stop), *everything), rows.start * inner, rows.stop * inner
    for a, b in parts:
        row = a // inner
        for slices, first, last in rectangles(shape[1:], a - row * inner, b - row * inner):
            yield (slice(row, row + 1), *slices), first + row * inner, last + row * inner
