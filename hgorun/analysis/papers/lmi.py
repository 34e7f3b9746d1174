"""The matrix inequalities behind a dynamic gain, decided with a certificate either way.

(9) of Meiners, Adamy 2025: is there a Q with

    M_1 = -Q (A - l c) - (A - l c)^T Q - a Q >= 0,    M_2 = Q - q I >= 0,    M_3 = I - Q >= 0,
    M_4 = b Q - Q Delta - Delta Q >= 0,               M_5 = b Q + Q Delta + Delta Q >= 0 ?

A Q shows that there is. That there is none is shown by Z_1..Z_5 >= 0 for which sum <Z_i, M_i(Q)> does not
depend on Q and is negative, tr Z_3 - q tr Z_2 < 0: it would have to be >= 0. Both are checked in rational
arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

_MAX_ROUNDS = 400
_GAP = 1e-6  # between the best Q and the bound for all Q
_INSIDE = 1e-10  # added to Z: its eigenvalues stay >= 0 when the sums are made exact

Exact = list[list[Fraction]]


@dataclass(frozen=True)
class Certificate:
    """What is known of the inequalities.

    Attributes
    ----------
    feasible : bool or None
        None: too close to the border to tell.
    Q : ndarray, shape (n, n), or None
        The matrix with the largest smallest eigenvalue of all M_i.
    Z : tuple of five ndarray, shape (n, n), or None
        The proof that there is no Q.
    margin : float
        That eigenvalue, or where Z is given a bound from above for every Q.
    exact : bool
        Whether rational arithmetic confirms it, with the constants as they are written in decimals.
    """

    feasible: bool | None
    Q: np.ndarray | None
    Z: tuple[np.ndarray, ...] | None
    margin: float
    exact: bool


def certificate(l: Sequence[float], a: float, b: float, q: float) -> Certificate:  # noqa: E741  # the paper's letter
    """Decide (9) for these constants.

    Cutting planes: M(Q) >= s means v^T M(Q) v >= s for all unit vectors v. The linear programme over the v
    found so far bounds the s that any Q can reach from above, and the weights of its dual solution, with Z_i
    the weighted sum of v v^T, are the proof.
    """
    from scipy.optimize import linprog

    n = len(l)
    pairs = [(i, j) for i in range(n) for j in range(i, n)]
    basis = [_symmetric_unit(n, i, j) for i, j in pairs]
    zero = np.zeros((n, n))
    constant = conditions(zero, l, a, b, q, np.eye(n))
    slopes = [conditions(E, l, a, b, q, zero) for E in basis]
    first = [*np.eye(n), *(_unit(np.eye(n)[i] + f * np.eye(n)[j]) for i, j in pairs if i < j for f in (1, -1))]
    cuts = [(k, v) for k in range(5) for v in first]
    rows: list[list[float]] = []
    bounds: list[float] = []
    owners: list[tuple[int, np.ndarray]] = []
    best, best_Q = -np.inf, zero
    for _ in range(_MAX_ROUNDS):
        for k, v in cuts:
            rows.append([*(-float(v @ S[k] @ v) for S in slopes), 1.0])
            bounds.append(float(v @ constant[k] @ v))
            owners.append((k, v))
        found = linprog([*np.zeros(len(pairs)), -1.0], rows, bounds, bounds=(None, None), method="highs")
        if not found.success:
            break
        Q, s = _assemble(found.x[:-1], basis), float(found.x[-1])
        spectra = [np.linalg.eigh(M) for M in conditions(Q, l, a, b, q, np.eye(n))]
        reached = min(float(values[0]) for values, _ in spectra)
        if reached > best:
            best, best_Q = reached, Q
        if s - best < _GAP:
            break
        cuts = [(k, v) for k, (values, V) in enumerate(spectra) for v in V.T[values < s - 0.1 * _GAP]]
    if best > 0:
        return Certificate(True, best_Q, None, best, feasible_exactly(best_Q, l, a, b, q))
    if not found.success or s >= 0:
        return Certificate(None, None, None, best, False)
    weights = np.maximum(-np.asarray(found.ineqlin.marginals), 0.0)
    Z = [_INSIDE * np.eye(n) for _ in range(5)]
    for weight, (k, v) in zip(weights, owners, strict=True):
        Z[k] = Z[k] + weight * np.outer(v, v)
    return Certificate(False, None, tuple(Z), s, infeasible_exactly(Z, l, a, b, q))


def conditions(
    Q: np.ndarray,
    l: Sequence[float],  # noqa: E741  # the paper's letter
    a: float,
    b: float,
    q: float,
    eye: np.ndarray,
) -> list[np.ndarray]:
    """M_1..M_5, each linear in (Q, eye), shape (n, n)."""
    n = len(l)
    closed = np.eye(n, k=1) - np.outer(l, np.eye(n)[0])
    Delta = np.diag(np.arange(n, dtype=float))
    turned = Q @ Delta + Delta @ Q
    return [-(Q @ closed + closed.T @ Q) - a * Q, Q - q * eye, eye - Q, b * Q - turned, b * Q + turned]


def feasible_exactly(Q: np.ndarray, l: Sequence[float], a: float, b: float, q: float) -> bool:  # noqa: E741  # the paper's letter
    """Whether Q, taken as rational numbers, satisfies (9)."""
    n = len(l)
    A, B, q_ = _decimal(a), _decimal(b), _decimal(q)
    exact = _rational(Q)
    closed = _closed(l)
    turned = [[(i + j) * exact[i][j] for j in range(n)] for i in range(n)]
    product = _product(exact, closed)
    one = _identity(n)
    return all(
        _positive_semidefinite(M)
        for M in (
            [[-product[i][j] - product[j][i] - A * exact[i][j] for j in range(n)] for i in range(n)],
            [[exact[i][j] - q_ * one[i][j] for j in range(n)] for i in range(n)],
            [[one[i][j] - exact[i][j] for j in range(n)] for i in range(n)],
            [[B * exact[i][j] - turned[i][j] for j in range(n)] for i in range(n)],
            [[B * exact[i][j] + turned[i][j] for j in range(n)] for i in range(n)],
        )
    )


def infeasible_exactly(
    Z: Sequence[np.ndarray],
    l: Sequence[float],  # noqa: E741  # the paper's letter
    a: float,
    b: float,
    q: float,
) -> bool:
    """Whether Z proves that no Q satisfies (9), in rational arithmetic.

    sum <Z_i, M_i(Q)> = <R, Q> + tr Z_3 - q tr Z_2 with R zero but for rounding; as M_3 has -Q, R is added to
    Z_3, and Z_3 has to remain positive semidefinite.
    """
    n = len(l)
    A, B = _decimal(a), _decimal(b)
    exact = [_rational(block) for block in Z]
    product = _product(_closed(l), exact[0])
    span = range(n)
    R = [
        [
            -(product[i][j] + product[j][i])
            - A * exact[0][i][j]
            + exact[1][i][j]
            - exact[2][i][j]
            + (B - i - j) * exact[3][i][j]
            + (B + i + j) * exact[4][i][j]
            for j in span
        ]
        for i in span
    ]
    exact[2] = [[exact[2][i][j] + R[i][j] for j in span] for i in span]
    total = sum((exact[2][i][i] - _decimal(q) * exact[1][i][i] for i in span), Fraction(0))
    return total < 0 and all(_positive_semidefinite(block) for block in exact)


def _symmetric_unit(n: int, i: int, j: int) -> np.ndarray:
    E = np.zeros((n, n))
    E[i, j] = E[j, i] = 1.0
    return E


def _unit(v: np.ndarray) -> np.ndarray:
    return np.asarray(v / np.linalg.norm(v))


def _assemble(x: np.ndarray, basis: Sequence[np.ndarray]) -> np.ndarray:
    return np.asarray(np.tensordot(x, np.array(basis), axes=1))


def _decimal(value: float) -> Fraction:
    """The number as it is written: 0.15 is 3/20."""
    return Fraction(repr(float(value)))


def _rational(M: np.ndarray) -> Exact:
    """The symmetric part."""
    n = len(M)
    return [[(Fraction(float(M[i, j])) + Fraction(float(M[j, i]))) / 2 for j in range(n)] for i in range(n)]


def _identity(n: int) -> Exact:
    return [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]


def _closed(l: Sequence[float]) -> Exact:  # noqa: E741  # the paper's letter
    """A - l c."""
    n = len(l)
    return [
        [Fraction(int(j == i + 1)) - (_decimal(l[i]) if j == 0 else Fraction(0)) for j in range(n)] for i in range(n)
    ]


def _product(X: Exact, Y: Exact) -> Exact:
    n = len(X)
    return [[sum((X[i][k] * Y[k][j] for k in range(n)), Fraction(0)) for j in range(n)] for i in range(n)]


def _positive_semidefinite(M: Exact) -> bool:
    """By elimination: no negative pivot, and a pivot of zero has a row of zeros."""
    rest = [row[:] for row in M]
    n = len(rest)
    for k in range(n):
        pivot = rest[k][k]
        if pivot < 0 or (pivot == 0 and any(rest[k][j] != 0 for j in range(k + 1, n))):
            return False
        if pivot > 0:
            for i in range(k + 1, n):
                factor = rest[i][k] / pivot
                for j in range(k + 1, n):
                    rest[i][j] -= factor * rest[k][j]
    return True
