"""Orthogonal polynomials on the samples of a window, for fits by least squares."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

TINY = 1e-60  # in place of zero, where that would divide
_RANK = 1e-24  # of the square of a column: what rounding leaves where samples are at fewer times than coefficients


@dataclass(frozen=True)
class Projection:
    """One column of the modified Gram-Schmidt process.

    Attributes
    ----------
    slopes : list of casadi.SX
        R_jj, R_j(j+1), ... of the columns from this one on.
    size : casadi.SX
        What of y is along this column, orthogonal to those before.
    left : casadi.SX
        What is left of y.
    independent : casadi.SX
        Whether the columns up to this one are.
    """

    slopes: list[ca.SX]
    size: ca.SX
    left: ca.SX
    independent: ca.SX


def projections(columns: list[ca.SX], y: ca.SX) -> Iterator[Projection]:
    """Column by column.

    The first one is 1 for every sample that there is: more columns than samples are never independent, even if numbers
    of single precision leave more of them than ``_RANK``.
    """
    columns, independent, count = list(columns), ca.SX(1), ca.sum1(columns[0])
    for j in range(len(columns)):
        left = ca.dot(columns[j], columns[j])
        independent = ca.logic_and(independent, ca.logic_and(left > _RANK, count > j))
        slopes = [ca.sqrt(ca.fmax(left, TINY))]
        unit = columns[j] / slopes[0]
        size = ca.dot(unit, y)
        y = y - size * unit
        for i in range(j + 1, len(columns)):
            slopes.append(ca.dot(unit, columns[i]))
            columns[i] = columns[i] - slopes[-1] * unit
        yield Projection(slopes, size, y, independent)
