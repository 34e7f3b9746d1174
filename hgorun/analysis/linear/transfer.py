"""From measurement noise to the estimate, linearised: frequency response, H2 and H-infinity norm."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.linear import Linear
from hgorun.analysis.reasons import NoValue

_DECADES, _PER_DECADE = 2, 40  # beyond the slowest and fastest eigenvalue, and how finely, in the search for peaks
_DOUBLINGS = 60  # of the number of steps that a covariance is summed over
_REFINEMENTS = 60  # of the golden section: 0.618^60 = 3e-13


def relevant(linear: Linear) -> Linear:
    """The states that noise reaches and that reach the estimate; the others have zeros in between.

    A gain's Riccati matrix, for one, follows the estimate but acts on it only where the innovation is not zero.
    """
    return restricted(linear, relevant_states(linear))


def restricted(linear: Linear, keep: np.ndarray) -> Linear:
    """The system of some of its states."""
    return Linear(
        linear.A0[..., keep[:, None], keep],
        linear.E[..., keep, :],
        linear.H[..., keep],
        linear.L[..., keep],
        linear.K0[..., keep],
        linear.K,
    )


def relevant_states(linear: Linear) -> np.ndarray:
    """Places of the states that :func:`relevant` keeps; a slope that is not a number acts, too."""
    full = {name: np.abs(value).reshape(-1, *value.shape[-2:]).max(axis=0) for name, value in vars(linear).items()}
    states, outputs = full["E"].shape
    # who acts on whom, column on row, among the states and the innovations
    acts = np.zeros((states + outputs, states + outputs), dtype=bool)
    acts[:states, :states], acts[:states, states:] = full["A0"] != 0, full["E"] != 0
    acts[states:, :states], acts[states:, states:] = (full["H"] != 0) | (full["K0"] != 0), full["K"] != 0
    noise = np.arange(states + outputs) >= states
    estimate = np.append((full["L"] != 0).any(axis=0), np.zeros(outputs, dtype=bool))
    return np.flatnonzero((_closure(acts, noise) & _closure(acts.T, estimate))[:states])


def _closure(acts: np.ndarray, found: np.ndarray) -> np.ndarray:
    while True:
        more = found | (acts @ found)
        if np.array_equal(more, found):
            return found
        found = more


def require_hurwitz(linear: Linear) -> None:
    """Refuse what has no steady state.

    Raises
    ------
    NoValue
    """
    if not np.all(np.isfinite(linear.A)):
        raise NoValue("the observer's equations have no derivative at this point")
    poles = np.linalg.eigvals(linear.A)
    worst = poles[np.argmax(poles.real)] if poles.size else -1.0
    # a pole of multiplicity m is only known to eps^(1/m)
    if not worst.real < -1e-9 * np.max(np.abs(poles), initial=1e-300):
        raise NoValue(f"the linearisation is not Hurwitz: it has an eigenvalue at {worst:.4g}")


def steady_part(linear: Linear) -> Linear:
    """:func:`relevant` of a linearisation that has a steady state.

    Raises
    ------
    NoValue
        When it is not Hurwitz.
    """
    linear = relevant(linear)
    require_hurwitz(linear)
    return linear


def response(linear: Linear, omega: np.ndarray, delay: float = 0.0) -> np.ndarray:
    """Frequency response from the noise of each output to each state of the estimate.

    With the innovation e = C xhat(t-d) - y_d + alpha - alpha(t-d) and alpha' = -c, in deviations,

        j omega xi = A0 xi + E e,    e = z H xi - rho (K0 xi + K e) - v,    z = exp(-j omega d),
        rho = (1 - z)/(j omega)

    so that for d = 0 it is L (j omega I - A)^-1 B.

    Parameters
    ----------
    linear : Linear
        At one point.
    omega : ndarray, shape (W,)
        Angular frequencies, rad per time unit.
    delay : float
        A constant delay of a continuous output.

    Returns
    -------
    ndarray of complex, shape (W, n, q)
    """
    omega = np.asarray(omega, dtype=float)
    w = omega[:, None, None]
    z = np.exp(-1j * w * delay)
    rho = delay * np.exp(-0.5j * w * delay) * np.sinc(0.5 * w * delay / np.pi)
    gain = linear.E @ np.linalg.inv(np.eye(linear.K.shape[0]) + rho * linear.K)
    closed = 1j * w * np.eye(linear.A0.shape[0]) - linear.A0 - gain @ (z * linear.H - rho * linear.K0)
    return np.asarray(linear.L @ np.linalg.solve(closed, -gain))


def h2(linear: Linear) -> np.ndarray:
    """Standard deviation of each state of the estimate under white noise of unit density on each output.

    The H2 norm: sqrt of the diagonal of L P L^T, A P + P A^T + B B^T = 0.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    NoValue
        When the linearisation is not Hurwitz.
    """
    from scipy.linalg import solve_continuous_lyapunov

    linear = steady_part(linear)
    if not linear.A.size:  # no noise reaches any state
        return np.zeros(len(linear.L))
    P = solve_continuous_lyapunov(linear.A, -linear.B @ linear.B.T)
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", linear.L, P, linear.L), 0)))


def hinf(linear: Linear) -> tuple[np.ndarray, np.ndarray]:
    """The largest amplification of a sinusoid, for each state of the estimate and output, and where it is.

    Searched on a logarithmic grid that holds zero and every eigenfrequency, and refined by golden section
    around every local maximum of it.

    Returns
    -------
    tuple of ndarray, shapes (n, q)
        The norm, and the frequency at which it is attained (0 for a monotonous response).

    Raises
    ------
    NoValue
        When the linearisation is not Hurwitz.
    """
    linear = steady_part(linear)
    poles = np.linalg.eigvals(linear.A)
    if not poles.size:
        return (np.zeros((linear.L.shape[0], linear.E.shape[1])),) * 2
    size = np.abs(poles)
    low, high = (np.log10(s) for s in (size.min(), size.max()))
    count = int(np.ceil((high - low + 2 * _DECADES) * _PER_DECADE)) + 1
    grid = np.logspace(low - _DECADES, high + _DECADES, count)
    peaks = np.sqrt(np.maximum(poles.imag**2 - poles.real**2, 0))
    grid = np.unique(np.concatenate([[0.0], grid, size, np.abs(poles.imag), peaks]))
    values = np.abs(response(linear, grid))
    norm, where = np.empty(values.shape[1:]), np.empty(values.shape[1:])
    for i, j in np.ndindex(norm.shape):
        column = values[:, i, j]
        inner = np.flatnonzero((column[1:-1] >= column[:-2]) & (column[1:-1] >= column[2:])) + 1
        near = np.unique(np.append(inner[np.argsort(-column[inner])[:5]], np.argmax(column)))
        best = [_refined(linear, i, j, grid[max(k - 1, 0)], grid[min(k + 1, grid.size - 1)]) for k in near]
        best.append((column.max(), grid[np.argmax(column)]))
        norm[i, j], where[i, j] = max(best)
    return norm, where


def _refined(linear: Linear, i: int, j: int, low: float, high: float) -> tuple[float, float]:
    """The largest |G_ij| between two frequencies, by golden section."""
    part = 0.5 * (np.sqrt(5) - 1)

    def value(w: float) -> float:
        return float(np.abs(response(linear, np.array([w]))[0, i, j]))

    a, b = high - part * (high - low), low + part * (high - low)
    f_a, f_b = value(a), value(b)
    for _ in range(_REFINEMENTS):
        if f_a > f_b:
            high, b, f_b = b, a, f_a
            a = high - part * (high - low)
            f_a = value(a)
        else:
            low, a, f_a = a, b, f_b
            b = low + part * (high - low)
            f_b = value(b)
    return max((f_a, a), (f_b, b))


def discrete_covariance(F: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """P = F P F^T + Q of a stable F, the sum of F^k Q F^kT, by doubling: states of any scale."""
    P, power = np.asarray(Q, dtype=float), np.asarray(F, dtype=float)
    for _ in range(_DOUBLINGS):
        more = power @ P @ power.T
        P, power = P + more, power @ power
        if not np.any(np.abs(more) > 1e-15 * np.sqrt(np.outer(np.diag(P), np.diag(P)))):
            break
    return P
