"""The map T of a KKL observer and its inverse, as numbers.

T(x) is where the filter z' = Lam z + Gam y has come to when the plant has come to x, from whatever start long before.
For linear plants it is a matrix, a row of Sylvester's equation for each eigenvalue. For others its values come from
integrating the plant backwards, and its inverse is a polynomial fitted to points of a box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from hgorun.errors import Problem
from hgorun.observers.orbits import Escaped, followed
from hgorun.symbolic.evaluate import Floats

if TYPE_CHECKING:
    from scipy.integrate import DOP853

_FORGOTTEN = 20.0  # over the slowest eigenvalue: what is left of the past is exp(-20)
_ACCURACY = 1e-10  # of the backward integration, relative
_CARRIED = 1e-13  # of the estimate until the first sample, relative
_ESCAPED = 1e3  # in widths of the box: an orbit that goes on from there does not come back
_STEPS = 5_000  # before an orbit counts as escaped
_RANK = 1e-12  # relative singular values that count
_SINGULAR = 1e-12  # of T, its rows of size one
_EXACT, _INEXACT = 1e-6, 1e-3  # by how much an inverse may miss T: unnoticed, and at all

Field = Callable[[Floats], tuple[Floats, Floats]]
"""(N, n) -> f, shape (N, n), and h, shape (N, q)."""


def of_linear_plant(A: np.ndarray, C: np.ndarray, eigenvalues: np.ndarray) -> np.ndarray:
    """T of x' = A x with T A = Lam T + Gam C; the same of samples, A from one to the next.

    Parameters
    ----------
    A, C : ndarray, shapes (n, n), (q, n)
    eigenvalues : ndarray, shape (m,)
        Lam is diagonal, these for each output.

    Returns
    -------
    ndarray, shape (q m, n)
        The rows of the first output before those of the second.

    Raises
    ------
    Problem
        Where an eigenvalue is one of the plant, or the plant cannot be observed with these.
    """
    n, rows = len(A), []
    for row in C:
        for value in eigenvalues:
            shifted = (A - value * np.eye(n)).T
            if np.linalg.cond(shifted) > 1 / _SINGULAR:
                raise Problem(("lam",), f"{value:.6g} is an eigenvalue of the plant: choose others")
            rows.append(np.linalg.solve(shifted, row))
    T = np.array(rows)
    size = np.max(np.abs(T), axis=1, keepdims=True)
    if np.linalg.matrix_rank(T / np.where(size > 0, size, 1), tol=_SINGULAR) < n:
        if not _is_observable(A, C):
            raise Problem(("type",), "the state is not a function of z: the plant cannot be observed from its outputs")
        raise _singular(T / size, eigenvalues)
    return T


def left_inverse(T: np.ndarray, eigenvalues: np.ndarray) -> np.ndarray:
    """T^+, or where it has lost the digits of T, whose rows may be of very different sizes, that of even rows.

    Raises
    ------
    Problem
        Where neither of them is an inverse.
    """
    size = np.max(np.abs(T), axis=1, keepdims=True)
    plain = np.linalg.pinv(T)
    if _missed(plain, T) <= _EXACT:  # nearly always
        return np.asarray(plain)
    found = min(plain, np.linalg.pinv(T / size) / size.T, key=lambda inverse: _missed(inverse, T))
    if _missed(found, T) > _INEXACT:
        raise _singular(T / size, eigenvalues)
    return np.asarray(found)


def _missed(inverse: np.ndarray, T: np.ndarray) -> float:
    """How far the product with T is from the identity, the largest entry."""
    return float(np.max(np.abs(inverse @ T - np.eye(T.shape[1]))))


def _singular(T: np.ndarray, eigenvalues: np.ndarray) -> Problem:
    """A plant that can be observed, but not with these numbers."""
    low, high = np.min(eigenvalues), np.max(eigenvalues)
    return Problem(
        ("lam",),
        f"the plant can be observed, but not by these numbers: with {len(eigenvalues)} eigenvalues of z for each "
        f"output, from {low:.4g} to {high:.4g}, its {T.shape[1]} states follow from z with the condition number "
        f"{np.linalg.cond(T):.2g}, which leaves no digits. Take another theta or lam, nearer to the plant's own rates, "
        "or other units of time or of the states",
    )


def _is_observable(A: np.ndarray, C: np.ndarray) -> bool:
    """Whether C, C A, C A^2, ... span all directions: one orthonormal basis, in which no power of A loses digits."""
    basis, new = np.zeros((0, len(A))), C / np.linalg.norm(C, axis=1, keepdims=True).clip(1e-300)
    least = _SINGULAR
    while len(new):
        for _ in range(2):  # once more, for what rounding leaves
            new = new - new @ basis.T @ basis
        _, size, directions = np.linalg.svd(new, full_matrices=False)
        new = directions[size > least]
        basis, new, least = np.vstack([basis, new]), new @ A, _SINGULAR * float(np.linalg.norm(A))
    return len(basis) == len(A)


def of_points(field: Field, x: Floats, eigenvalues: np.ndarray, reach: np.ndarray) -> Floats:
    """T at points x, shape (N, n): the integral of e^(Lam s) Gam h(X(x, -s)) over s > 0; shape (N, q m).

    Parameters
    ----------
    eigenvalues : ndarray, shape (m,)
        Negative.
    reach : ndarray, shape (n,)
        Widths of the box; infinite where the plant is clipped to it.

    Raises
    ------
    Escaped
    """
    count, n = x.shape

    def rate(s: float, flat: Floats) -> Floats:
        f, h = field(flat[: count * n].reshape(count, n))
        return np.concatenate([-f.ravel(), (h[:, :, None] * np.exp(eigenvalues * s)).ravel()])

    outputs = field(x[:1])[1].shape[1]
    if not np.all(np.isfinite(reach)):
        return _of_clipped_points(field, x, eigenvalues, outputs)
    start = np.concatenate([x.ravel(), np.zeros(count * outputs * len(eigenvalues))])
    end = _FORGOTTEN / float(np.min(-eigenvalues))
    for solver in _steps(rate, start, end, x, reach):
        found = solver.y[count * n :]
    return np.reshape(found, (count, -1))


def _of_clipped_points(field: Field, x: Floats, eigenvalues: np.ndarray, outputs: int) -> Floats:
    """The same of a plant that is clipped, whose orbits have kinks where they leave the box."""
    count, n = x.shape

    def rate(s: Floats, y: Floats) -> Floats:
        f, h = field(y[:, :n])
        return np.hstack([-f, (h[:, :, None] * np.exp(eigenvalues * s[:, None])[:, None, :]).reshape(len(y), -1)])

    start = np.hstack([x, np.zeros((count, outputs * len(eigenvalues)))])
    end = np.array([_FORGOTTEN / float(np.min(-eigenvalues))])
    try:
        (found,) = followed(rate, start, end, _ACCURACY, _STEPS)
    except Escaped as escaped:
        raise Escaped(escaped.x[:n], escaped.after) from None
    return found[:, n:]


def of_samples(field: Field, x: Floats, factors: np.ndarray, T: float, reach: np.ndarray) -> Floats:
    """T of samples at points: the sum of Lam^j Gam h(X(x, -(j + 1) T)) over j >= 0; otherwise as :func:`of_points`.

    Parameters
    ----------
    factors : ndarray, shape (m,)
        The eigenvalues of Lam, in (0, 1).
    T : float
        The period.
    """
    count = int(np.ceil(_FORGOTTEN / float(np.min(-np.log(factors)))))
    times: Floats = T * np.arange(1, 1 + count, dtype=float)
    found, weight, taken = np.zeros(1), np.ones(len(factors)), 0
    if not np.all(np.isfinite(reach)):
        for y in followed(lambda s, y: -field(y)[0], x, times, _ACCURACY, _STEPS):
            found, weight = found + field(y)[1][:, :, None] * weight, weight * factors
        return np.reshape(found, (len(x), -1))

    def rate(s: float, flat: Floats) -> Floats:
        return -field(flat.reshape(x.shape))[0].ravel()

    for solver in _steps(rate, x.ravel(), times[-1], x, reach):
        between = solver.dense_output()
        while taken < len(times) and times[taken] <= solver.t:
            found = found + field(between(times[taken]).reshape(x.shape))[1][:, :, None] * weight
            weight, taken = weight * factors, taken + 1
    return np.reshape(found, (len(x), -1))


def carried(field: Field, x: Floats, T: float) -> Floats:
    """The state after a time T, shape (n,).

    Raises
    ------
    Escaped
        Where it does not live that long.
    """
    if T == 0:
        return x
    reach = np.full(x.size, np.inf)
    for solver in _steps(lambda s, x: field(x[None])[0][0], x, T, x[None], reach, _CARRIED):
        found = solver.y
    return np.asarray(found)


def _steps(
    rate: Callable[[float, Floats], Floats],
    start: Floats,
    end: float,
    x: Floats,
    reach: np.ndarray,
    accuracy: float = _ACCURACY,
) -> Iterator[DOP853]:
    """The integration after every step; the states stand first in what is integrated."""
    from scipy.integrate import DOP853

    with np.errstate(all="ignore"):  # what escapes is told
        solver = DOP853(rate, 0.0, start, end, rtol=accuracy, atol=accuracy / 100)
        for _ in range(_STEPS):
            solver.step()
            X = solver.y[: x.size].reshape(x.shape)
            far = ~(np.abs(X - x) <= _ESCAPED * reach)
            if np.any(far):
                raise Escaped(x[int(np.argmax(np.any(far, axis=1)))], float(solver.t))
            if solver.status == "failed":
                break
            yield solver
            if solver.status == "finished":
                return
    raise Escaped(x[0], float(solver.t))


@dataclass(frozen=True, eq=False, repr=False)
class Polynomial:
    """x as a polynomial in w = (z - center)/scale.

    Attributes
    ----------
    W : ndarray, shape (n, number of monomials)
    center, scale : ndarray, shape (M,)
    trained, held_out : ndarray, shape (n,)
        Root mean square of the error at the points that it was fitted to, and at others.
    """

    W: np.ndarray
    center: np.ndarray
    scale: np.ndarray
    trained: np.ndarray
    held_out: np.ndarray


def fitted(z: Floats, x: Floats, others: tuple[Floats, Floats], degree: int, ridge: float) -> Polynomial:
    """Least squares, relative singular values below 1e-12 left out.

    Parameters
    ----------
    z, x : ndarray, shapes (N, M), (N, n)
    others : (ndarray, ndarray)
        z and x of other points.
    ridge : float
        Weight of the squared coefficients, beside a mean square.
    """
    center, scale = z.mean(axis=0), z.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)

    def matrix(z: Floats) -> Floats:
        w = (z - center) / scale
        return np.column_stack([np.prod(w[:, list(one)], axis=1) for one in monomials(z.shape[1], degree)])

    A, b = matrix(z), x
    if ridge > 0:
        A = np.vstack([A, np.sqrt(ridge * len(z)) * np.eye(A.shape[1])])
        b = np.vstack([x, np.zeros((A.shape[1], x.shape[1]))])
    W = np.linalg.lstsq(A, b, rcond=_RANK)[0].T
    errors = [np.sqrt(np.mean((matrix(at) @ W.T - true) ** 2, axis=0)) for at, true in ((z, x), others)]
    return Polynomial(W, center, scale, *errors)


def monomials(count: int, degree: int) -> list[tuple[int, ...]]:
    """Those of so many variables up to a degree: for each the numbers of its factors, none for 1."""
    return [one for power in range(degree + 1) for one in combinations_with_replacement(range(count), power)]


def value(W: ca.SX, w: ca.SX, degree: int) -> ca.SX:
    """The polynomial at w, as symbols."""
    known: dict[tuple[int, ...], ca.SX] = {(): ca.SX(1)}
    for one in monomials(w.numel(), degree):
        if one:
            known[one] = known[one[:-1]] * w[one[-1]]
    return W @ ca.vertcat(*known.values())
