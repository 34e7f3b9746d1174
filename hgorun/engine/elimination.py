"""Sparse Gaussian elimination, symbolically: a matrix is factored once for all numbers.

The states are cut into blocks that need each other; a block is solved after those that it needs, so that nothing of
one observer enters the solution of another, not even NaN. Inside a block the order is Markowitz's: the next pivot is
the diagonal entry whose row and column would fill the fewest places. There is no pivoting by size: it would need the
numbers. For W = 1/(h gamma) - J small steps make the diagonal dominate, and where a step that is too long makes a
pivot vanish the error estimate refuses it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

Sparse = dict[tuple[int, int], ca.SX]


@dataclass(frozen=True)
class Pivot:
    """One step of an elimination.

    Attributes
    ----------
    index : int
    inverse : casadi.SX
        One over the pivot.
    below, behind : tuple of (int, casadi.SX)
        The multipliers of the rows still to come, and what is left of the pivot's row right of it.
    """

    index: int
    inverse: ca.SX
    below: tuple[tuple[int, ca.SX], ...]
    behind: tuple[tuple[int, ca.SX], ...]


@dataclass(frozen=True)
class Factors:
    """A factored matrix.

    Attributes
    ----------
    blocks : tuple of tuple of Pivot
        Solved one after the other.
    before : tuple of (int, int, casadi.SX)
        Row, column and value of the entries that couple a block to those before it.
    """

    blocks: tuple[tuple[Pivot, ...], ...]
    before: tuple[tuple[int, int, ca.SX], ...]

    def entries(self) -> Iterator[ca.SX]:
        """All values, in the order in which :meth:`with_entries` takes them."""
        for block in self.blocks:
            for pivot in block:
                yield pivot.inverse
                yield from (value for _, value in pivot.below)
                yield from (value for _, value in pivot.behind)
        yield from (value for _, _, value in self.before)

    def with_entries(self, values: Iterator[ca.SX]) -> Factors:
        """The same structure with other values."""
        blocks = tuple(
            tuple(
                Pivot(
                    pivot.index,
                    next(values),
                    tuple((row, next(values)) for row, _ in pivot.below),
                    tuple((column, next(values)) for column, _ in pivot.behind),
                )
                for pivot in block
            )
            for block in self.blocks
        )
        return Factors(blocks, tuple((row, column, next(values)) for row, column, _ in self.before))

    def solve(self, right: ca.SX) -> ca.SX:
        """The solution for a right-hand side."""
        b = [right[i] for i in range(right.numel())]
        coupled: dict[int, list[tuple[int, ca.SX]]] = {}
        for row, column, value in self.before:
            coupled.setdefault(row, []).append((column, value))
        for block in self.blocks:
            for pivot in block:
                for column, value in coupled.get(pivot.index, []):
                    b[pivot.index] -= value * b[column]
            for pivot in block:
                for row, multiplier in pivot.below:
                    b[row] -= multiplier * b[pivot.index]
            for pivot in reversed(block):
                for column, value in pivot.behind:
                    b[pivot.index] -= value * b[column]
                b[pivot.index] *= pivot.inverse
        return ca.vertcat(*b)


def factor(matrix: ca.SX) -> Factors:
    """Factor a square sparse matrix whose diagonal is full."""
    rows, columns = matrix.sparsity().get_triplet()
    values: Sparse = dict(zip(zip(rows, columns, strict=True), matrix.nonzeros(), strict=True))
    count, order, offset = matrix.sparsity().T.scc()
    block_of = {order[k]: block for block in range(count) for k in range(offset[block], offset[block + 1])}
    inside: list[Sparse] = [{} for _ in range(count)]
    before = []
    for (row, column), value in values.items():
        if block_of[row] == block_of[column]:
            inside[block_of[row]][row, column] = value
        else:
            before.append((row, column, value))
    return Factors(tuple(tuple(_eliminate(block)) for block in inside), tuple(before))


def _eliminate(entries: Sparse) -> Iterator[Pivot]:
    """The pivots of one block; ``entries`` is used up."""
    left = {row for row, _ in entries}
    in_row = {i: {column for row, column in entries if row == i} for i in left}
    in_column = {i: {row for row, column in entries if column == i} for i in left}
    while left:
        index = min(left, key=lambda i: ((len(in_row[i]) - 1) * (len(in_column[i]) - 1), i))
        left.remove(index)
        inverse = 1 / entries[index, index]
        rows, columns = sorted(in_column.pop(index) - {index}), sorted(in_row.pop(index) - {index})
        behind = tuple((column, entries[index, column]) for column in columns)
        below = tuple((row, entries[row, index] * inverse) for row in rows)
        for row, multiplier in below:
            in_row[row].remove(index)
            for column, value in behind:
                entries[row, column] = entries.get((row, column), ca.SX(0)) - multiplier * value
                in_row[row].add(column)
                in_column[column].add(row)
        for column in columns:
            in_column[column].remove(index)
        yield Pivot(index, inverse, below, behind)
