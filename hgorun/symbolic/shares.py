"""How n states may be shared among the chains of several outputs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

_LIMIT = 300  # ways that are tried


def chain_lengths(outputs: tuple[str, ...], n: int) -> Iterator[tuple[int, ...]]:
    """Ways to share n among the outputs, the most even first, at least one each; the first few hundred.

    Of equally even ones those come first that give more to the outputs that come first in the alphabet.
    """
    count = len(outputs)
    if count == 1:
        yield (n,)
        return
    places = sorted(range(count), key=lambda i: outputs[i])
    by_spread = (
        tuple(share[places.index(i)] for i in range(count))
        for spread in range(n - count + 1)
        for share in sorted(
            {
                share
                for low in range(1, n // count + 1)
                for share in islice(_shares(n, count, low, low + spread), _LIMIT)
                if max(share) - min(share) == spread
            },
            key=lambda share: (sorted(share), [-k for k in share]),
        )
    )
    yield from islice(by_spread, _LIMIT)


def unevenness(lengths: tuple[int, ...]) -> tuple[int, list[int]]:
    """By which ways to share are sorted: their longest less their shortest, then all of them."""
    return max(lengths) - min(lengths), sorted(lengths)


def _shares(n: int, parts: int, low: int, high: int) -> Iterator[tuple[int, ...]]:
    """Ordered ways to write n as a sum of parts from low to high."""
    if parts == 0:
        yield ()
        return
    for first in range(max(low, n - (parts - 1) * high), min(high, n - (parts - 1) * low) + 1):
        for rest in _shares(n - first, parts - 1, low, high):
            yield first, *rest
