"""Theory of the observers whose gain follows F(u, xhat): bounds with the matrix S of the simulated run.

V = zbar^T S zbar with S' = -theta (S + S F + F^T S - C^T C) has

    V' <= -theta V + 2 zbar^T S Phi~ <= -(theta - 2 sqrt(chi) c_1) V,    chi = sup lambda_max(S)/inf lambda_min(S)

so that sqrt V decays at theta/2 - sqrt(chi) c_1, at theta/4 or more once theta >= 4 sqrt(chi) c_1. Theorem 3.5.1 of
Robles Magdaleno 2023 claims theta: (3.113) has lost Phi~, and (3.115) the 1/2 of (sqrt V)' = V'/(2 sqrt V). How large
and small S gets depends on what the input excites; it is read off the run.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.analysis.convergence import bounds
from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.envelope import Envelope
from hgorun.analysis.convergence.extremes import largest_norm, outermost
from hgorun.analysis.convergence.lipschitz import Lipschitz
from hgorun.analysis.convergence.signals import Amplitudes
from hgorun.memo import Memo, same
from hgorun.observers.riccati import stationary
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.evaluate import evaluate
from hgorun.symbolic.forms import BlockForm
from hgorun.symbolic.triangular import superdiagonal

_KEPT = 0.25  # of theta: what of the decay of sqrt V is left for theta >= theta_bound
_LINKS: Memo[ca.Function] = Memo(64)


@dataclass(frozen=True)
class Gramian:
    """The range of S in a run: lambda_min and lambda_max over all time, and S at the start."""

    smallest: float
    largest: float
    first: np.ndarray

    @property
    def chi(self) -> float:
        """Its conditioning number in the theorem."""
        return self.largest / self.smallest


def gramian(observer: ObserverResult) -> Gramian:
    """S of an observer with time-varying gain, from P, from U and P, or as it is integrated."""
    if not {"S", "U"} & observer.internal.keys():  # S is P^-1
        P = np.asarray(observer.internal["P"])
        low, high = outermost(P[_sound(P)])
        if low > 0:
            return Gramian(1 / high, 1 / low, np.linalg.inv(P[0]))
    S = _matrices(observer)
    return Gramian(*outermost(S[_sound(S)]), S[0])


def _sound(stack: np.ndarray) -> slice | np.ndarray:
    """Which of many matrices are of numbers: all of them without a copy, where that is so."""
    known = np.isfinite(stack)
    return slice(None) if known.all() else np.all(known, axis=(1, 2))


def _matrices(observer: ObserverResult) -> np.ndarray:
    """S at every point of the output grid, shape (Nt, N, N), the filter first."""
    internal = observer.internal
    if "S" in internal:
        return np.asarray(internal["S"])
    P = np.asarray(internal["P"])
    sound = _sound(P)
    inverse = np.full_like(P, np.nan)
    inverse[sound] = np.linalg.inv(P[sound])
    if "U" not in internal:
        return inverse
    n = P.shape[1]
    U = np.asarray(internal["U"]).reshape(len(P), -1, n)
    S_1 = stationary(U.shape[1])
    cross = -S_1 @ U  # U = -S_1^-1 S_2, P^-1 = S_3 - S_2^T S_1^-1 S_2
    corner = inverse + np.transpose(U, (0, 2, 1)) @ S_1 @ U
    whole = np.broadcast_to(S_1, (len(P), *S_1.shape))
    return np.block([[whole, cross], [np.transpose(cross, (0, 2, 1)), corner]])


def largest_links(run: PreparedRun, form: BlockForm, result: Result, label: str) -> tuple[float, float]:
    """(F_1, F_M): the largest norm of F's first block row, and of F, along the estimate."""
    m = form.model
    f = _LINKS.get(same(form), lambda: _links_of(form))
    xhat = result.observers[label].xhat
    (values,) = evaluate(f, result.time[:, None], xhat, result.u, run.plant.parameters)
    stack = values.reshape(-1, m.n, m.n)
    stack = stack[_sound(stack)]
    return largest_norm(stack[:, list(form.measured)]), largest_norm(stack)


def _links_of(form: BlockForm) -> ca.Function:
    """F, of the plant's time, states, inputs and parameters."""
    m = form.model
    F = superdiagonal(m, form.block)(m.t, m.x, m.u, m.p)
    in_plant = ca.substitute(F, m.x, form.coordinates(False))
    return ca.Function("F", [m.t, form.plant.x, m.u, m.p], [ca.densify(in_plant)])


def smallest_theta(S: Gramian, lipschitz: Lipschitz) -> float:
    """The smallest theta >= 1 with theta >= 4 sqrt(chi) c_1(theta); S is this run's, and changes with theta."""
    return bounds.smallest_theta(float(1 / (4 * np.sqrt(S.chi))), lipschitz.constant)


def delayed(S: Gramian, filtered: bool, first_link: float, lipschitz: Lipschitz, theta: float) -> Halanay:
    """d_M < 1/(chi_S (L_phi + theta)) (3.104), as far as it is proved.

    The proof gives a = theta/4 (above) and b = push theta (theta F_1 + L_phi), F_1 the first link, which (3.111)
    lacks; push is sqrt(chi) behind a filter and 1/lambda_min(S) for the standard observer, whose correction
    enters as S^-1 C^T. Where the printed bound is the smaller one it stays.
    """
    push = float(np.sqrt(S.chi)) if filtered else 1 / S.smallest
    motion = theta * first_link + lipschitz.of_outputs
    proved = Halanay(_KEPT * theta, push * theta * motion)
    printed = 1 / (S.chi * (lipschitz.of_outputs + theta))
    return proved if proved.longest <= printed else Halanay(proved.a, proved.a / printed)


def envelope(
    S: Gramian, filtered: bool, delay: Halanay, scaled: np.ndarray, scale: np.ndarray, theta: float, a: Amplitudes
) -> Envelope:
    """(3.105) for sqrt V, which bounds |zbar| with 1/sqrt(lambda_min(S)).

    Parameters
    ----------
    scaled : ndarray
        zbar(t_0), the filter first.
    scale : ndarray, shape (n,)
        theta^(1-i).
    """
    start = float(np.sqrt(max(scaled @ S.first @ scaled, 0.0)))
    push = np.sqrt(S.largest) if filtered else 1 / np.sqrt(S.smallest)
    pushed = float(np.linalg.norm(scale * (a.disturbance + a.rounding)))
    drive = theta * float(push) * a.noise + float(np.sqrt(S.largest)) * pushed
    return Envelope(1 / float(np.sqrt(S.smallest)), delay.rate(a.delay), start, drive)


@dataclass(frozen=True)
class FilterTheorem:
    """Theorems 2.3.1 and 2.4.1 of Robles Magdaleno 2023, for FHGO I, in the numbers of a run.

    Attributes
    ----------
    mu, nu : float
        (2.58), (2.67): the decay of V = V_1 + V_2 is nu mu theta; without a positive one there is no theorem.
    tau : float
        tau_M < nu mu/(2 delta beta_f sqrt(alpha) (theta F_M + L_phi)) (2.82).
    """

    mu: float
    nu: float
    tau: float


def filter_theorem(
    S: Gramian, blocks: int, delta: float, links: tuple[float, float], lipschitz: Lipschitz, theta: float
) -> FilterTheorem:
    """The constants of the theorem.

    (2.82) prints the inverse of a_theta/b_theta. Its b_theta lacks theta delta, with which the term gammabar
    enters (2.80) and which is dropped after (2.81): a bound without it would grow with theta. (2.65) and (2.67)
    print c_1/delta for the c_1/sqrt(delta) of (2.63), and the text after (2.59) delta >= 2 sqrt(n) K_M/kappa for the
    4 sqrt(n) K_M/kappa that its inequality is. alpha(theta)/rho* of (2.40) is 1/inf lambda_min(S), sup
    lambda_max(S) is lambda_M of (2.71), at least 1; c holds the Lipschitz constants of F(u, x) x, too.
    """
    first, whole = links
    c = lipschitz.constant(1.0)
    smallest, largest = S.smallest, S.largest
    K = 1 / smallest  # |P C^T| <= lambda_max(P)
    U = np.sqrt(blocks)
    mu = 1 - 2 * c * np.sqrt(S.chi) / theta
    kappa = 2 - 2 * np.cos(np.pi / (blocks + 1))
    c_1 = 2 * K * np.sqrt(largest)
    c_2 = 2 * U * (c / theta + whole + K) / np.sqrt(smallest)
    if mu <= 0 or delta * kappa <= 4 * U * K:  # the step after (2.59) needs half of the filter's decay
        return FilterTheorem(float(mu), -np.inf, 0.0)
    nu = 1 - np.sqrt(2 / (kappa * mu * delta)) * (c_1 + c_2)
    push = theta * delta * np.sqrt(max(largest, 1.0) / smallest) * (theta * first + lipschitz.of_outputs)
    return FilterTheorem(float(mu), float(nu), float(max(nu, 0.0) * theta * min(mu, delta * kappa / 2) / 2 / push))
