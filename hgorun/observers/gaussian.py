"""Means and covariances: how a linearised flow moves them, and what a sample makes of them."""

from __future__ import annotations

import casadi as ca


def spread_along(F: ca.SX, P: ca.SX, Q: ca.SX) -> ca.SX:
    """F P + P F^T + Q: P' where nothing is measured."""
    return F @ P + P @ F.T + Q


def linear_update(
    P: ca.SX, innovation: ca.SX, H: ca.SX, R: ca.SX, fresh: ca.SX, *, joseph: bool = True
) -> tuple[ca.SX, ca.SX]:
    """What samples of linear outputs add to the mean, shape (n,), and what becomes of P.

    All of them enter at one estimate and one P; since their noise is independent, that is carried out one after the
    other, with the remaining innovation of the linearised output, and needs no inverse.

    Parameters
    ----------
    P : casadi.SX, shape (n, n)
    innovation : casadi.SX, shape (q,)
        y - h(xhat).
    H : casadi.SX, shape (q, n)
    R : casadi.SX, shape (q,)
        Variance of each sample.
    fresh : casadi.SX, shape (q,)
        1 for the outputs that have a new sample, 0 for the others.
    joseph : bool
        P+ = (I - K H) P (I - K H)^T + K R K^T, which stays positive definite whatever rounding makes of K; otherwise
        the shorter P - K H P, for which R need not be a variance.
    """
    shift, unit = ca.SX.zeros(P.size1()), ca.SX.eye(P.size1())
    for i in range(H.size1()):
        h = H[i, :]
        K = fresh[i] * (P @ h.T / (h @ P @ h.T + R[i]))
        shift += K @ (innovation[i] - h @ shift)
        P = (unit - K @ h) @ P @ (unit - K @ h).T + K @ R[i] @ K.T if joseph else P - K @ (h @ P)
        P = (P + P.T) / 2
    return shift, P


def conditioned(mean: ca.SX, covariance: ca.SX, y: ca.SX, fresh: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The first n of n + q jointly normal numbers, once some of the last q are known: mean (n,), covariance (n, n).

    mean + P_xy S^-1 (y - yhat) and P - P_xy S^-1 P_xy^T, the numbers taken one after the other, which needs no
    inverse and leaves out those that are not fresh.

    Parameters
    ----------
    mean : casadi.SX, shape (n + q,)
    covariance : casadi.SX, shape (n + q, n + q)
    y, fresh : casadi.SX, shape (q,)
        What the last q are, and 1 for those that are known, 0 for the others.
    """
    n = mean.numel() - y.numel()
    for i in range(y.numel()):
        column = covariance[:, n + i]
        gain = fresh[i] * (column / covariance[n + i, n + i])
        mean = mean + gain * (y[i] - mean[n + i])
        covariance = covariance - gain @ column.T
    P = covariance[:n, :n]
    return mean[:n], (P + P.T) / 2
