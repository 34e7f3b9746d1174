"""What Lee, Choi, Khalil 2016 ask of the observers by forward differences and by stochastic approximation.

q(k+1) = (I + a_k A_0) q(k) + a_k H_0 G(k), with a_k = a(k)/eps = alpha b(k) and |G(k)| = |x_1 + v| <= g. (A.4),
bounded iterates, is shown with V = q^T P q; Remark 1 asks for P > 0 with

    (36)    A_k^T P A_k - P = a_k (A_0^T P + P A_0 + a_k A_0^T P A_0) < 0,    A_k = I + a_k A_0

As A_0^T P A_0 >= 0, a P that serves the longest step a_0 serves all shorter ones, so that (36) has one P for
all k if and only if the spectral radius of I + a_0 A_0 is below 1: a_0 < min(-2 Re(lambda)/|lambda|^2) over the
eigenvalues of A_0. The paper prints one c > 0 on the right, -c I; the left side is of the order of a_k, so that
c has to depend on k: c(k) = c a_k. (32) prints B G(k) and p for H_0 G(k) and P. (21) prints b(k) < 1, and the
paper's own example has b(0) = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.analysis.papers.region import along, evaluated
from hgorun.analysis.reasons import NoValue
from hgorun.config.expressions import parse
from hgorun.observers.forward_differences import ForwardDifferences, eigenvalues
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun

_FAR = 2.0**99  # a sample's number that stands for infinity
_CENTRED = 5e-13  # a mean no larger is rounding
_LOGARITHMS = 0.05  # of an exponent: what factors log(k) make of it there


@dataclass(frozen=True)
class Condition:
    """An assumption: whether it holds (None: cannot be told), and why."""

    holds: bool | None
    why: str


@dataclass(frozen=True, kw_only=True)
class LeeConditions:
    """The theorem's numbers and assumptions.

    Attributes
    ----------
    alpha : float
        The longest step over eps: alpha b(0) of (21), a_0 above.
    alpha_exact : float
        (36) has a solution below it, and none above.
    alpha_sufficient : float
        c_1/M_p of (33)-(34) with Q = I: 1/(|A_0|^2 |P|), sufficient.
    radius : float
        Spectral radius of I + a_0 A_0.
    P : ndarray, shape (n, n), or None
        A solution of (36) for every k, with the left side -a_0 I at k = 0.
    contraction : float or None
        Of |q|_P in the longest step; 1 - contraction(a) falls no slower than in proportion to a.
    gain : float or None
        BIBS: sup |q| <= growth |q(0)| + gain sup |G|.
    growth : float or None
    bound : float or None
        sup |q| so for this run's q(0) and G.
    measured : float or None
        sup |q| of the run.
    lipschitz : float
        (A.1): the largest norm of the slope of h, (26), along the run.
    exponent : float
        p of a(k) ~ k^-p.
    A1, A2, A3, A4 : Condition
    """

    alpha: float
    alpha_exact: float
    alpha_sufficient: float
    radius: float
    P: np.ndarray | None
    contraction: float | None
    gain: float | None
    growth: float | None
    bound: float | None
    measured: float | None
    lipschitz: float
    exponent: float
    A1: Condition
    A2: Condition
    A3: Condition
    A4: Condition


def lee_conditions(run: PreparedRun, label: str, result: Result) -> LeeConditions:
    """Conditions of the paper for `hgo_fd` and `hgo_sa`; NoValue for other observers."""
    from scipy.linalg import solve_continuous_lyapunov

    observer = run.experiment.observers[label]
    if not isinstance(observer, ForwardDifferences):
        raise NoValue("the conditions are for hgo_fd and hgo_sa")
    n, eps = run.plant.model.n, observer.eps
    H_0 = observer.H_0(n)
    A_0 = np.eye(n, k=1) - np.outer(H_0, np.eye(n)[0])
    poles = eigenvalues(H_0)
    samples = run.channels[0].samples
    steps = np.diff(samples.arrival[samples.used])
    exponent = _exponent(run)
    a_0 = float(np.max(steps, initial=0.0)) / eps
    radius = float(np.max(np.abs(1 + a_0 * poles)))
    small = solve_continuous_lyapunov(A_0.T, -np.eye(n))
    sufficient = 1 / float(np.linalg.norm(A_0, 2) ** 2 * np.linalg.norm(small, 2))
    D = eps ** np.arange(n)
    xhat = result.observers[label].xhat
    y = result.measurements.y
    q_0 = D * (xhat[0] if np.all(np.isfinite(xhat[0])) else 0.0)
    g = float(np.nanmax(np.abs(y))) if y.size else 0.0
    bibs = _bibs(A_0, H_0, a_0) if radius < 1 and a_0 > 0 else None
    finite = xhat[np.all(np.isfinite(xhat), axis=1)]
    return LeeConditions(
        alpha=a_0,
        alpha_exact=float(np.min(-2 * poles.real / np.abs(poles) ** 2)),
        alpha_sufficient=sufficient,
        radius=radius,
        P=bibs[0] if bibs else None,
        contraction=bibs[1] if bibs else None,
        gain=bibs[2] if bibs else None,
        growth=bibs[3] if bibs else None,
        bound=bibs[3] * float(np.linalg.norm(q_0)) + bibs[2] * g if bibs else None,
        measured=float(np.max(np.linalg.norm(D * finite, axis=1))) if len(finite) else None,
        lipschitz=_lipschitz(run, result, A_0, H_0, eps),
        exponent=exponent,
        A1=Condition(True, "the slope of h is bounded along the run; elsewhere phi must be Lipschitz"),
        A2=_steps_condition(exponent),
        A3=_noise_condition(run),
        A4=_bounded(radius, result),
    )


def _bibs(A_0: np.ndarray, H_0: np.ndarray, a_0: float) -> tuple[np.ndarray, float, float, float]:
    """(P, contraction, gain, growth).

    In the norm |q|_P = sqrt(q^T P q): |q(k+1)|_P <= kappa(a_k) |q(k)|_P + a_k |H_0|_P g. kappa is convex in a
    and 1 at a = 0, so a/(1 - kappa(a)) is largest at the longest step, and |q|_P never leaves the ball of
    radius max(|q(0)|_P, a_0 |H_0|_P g / (1 - kappa(a_0))), however the steps fall.
    """
    from scipy.linalg import solve_discrete_lyapunov

    closed = np.eye(len(A_0)) + a_0 * A_0
    P = solve_discrete_lyapunov(closed.T, a_0 * np.eye(len(A_0)))
    R = np.linalg.cholesky(P).T
    kappa = float(np.linalg.norm(R @ closed @ np.linalg.inv(R), 2))
    values = np.linalg.eigvalsh(P)
    gain = a_0 * float(np.linalg.norm(R @ H_0)) / (1 - kappa) / float(np.sqrt(values[0]))
    return P, kappa, gain, float(np.sqrt(values[-1] / values[0]))


def _exponent(run: PreparedRun) -> float:
    """p of a(k) ~ k^-p; 0 for samples that are not given by an expression of k."""
    text = run.channels[0].stretches[0].steps
    if text is None:
        return 0.0
    k = ca.SX.sym("k")
    steps = ca.Function("a", [k], [parse(text, names=("k",)).symbol({"k": k})])
    early, late = float(steps(_FAR)), float(steps(2 * _FAR))
    return float(np.log2(early / late)) if late > 0 else float("inf")


def _steps_condition(p: float) -> Condition:
    """(A.2): the sum of a(k) diverges, that of a(k)^2 converges."""
    falls = f"a(k) falls like k^-{p:.3g}"
    if p < 1e-6:
        return Condition(False, "the steps do not fall: the sum of a(k)^2 diverges, the noise does not average out")
    if p < 0.5 + 1e-6:
        return Condition(False, f"{falls}: the sum of a(k)^2 diverges, the noise does not average out")
    if p > 1 + _LOGARITHMS:
        return Condition(False, f"{falls}: the sum of a(k) converges, the estimate stops before it has converged")
    return Condition(True, f"{falls}: the sum of a(k) diverges, that of a(k)^2 converges")


def _noise_condition(run: PreparedRun) -> Condition:
    """(A.3) and assumption 2: independent, zero mean, finite variance, bounded."""
    items = [item for noise in run.channels[0].noise for item in noise.items]
    if not items:
        return Condition(True, "there is no noise")
    random = [item for noise in run.channels[0].noise for item in noise.random]
    if len(random) < len(items):
        return Condition(False, "a part of the noise is a function of time: it is not a martingale difference")
    if any(item.hold is not None for item in random):
        return Condition(False, "the noise is held: samples of one hold are not independent")
    spectra = [item.spectrum() for item in random]
    if None in spectra:
        return Condition(False, "nothing says that the draws of the noise are independent")
    if any(abs(draws.mean) > _CENTRED for spectrum in spectra if spectrum for draws in spectrum.draws):
        return Condition(False, "the noise has a mean")
    unbounded = [item.type.capitalize() for item in random if not item.bounded]
    if unbounded:
        return Condition(
            True, f"independent samples of zero mean; {unbounded[0]}, so not bounded, as assumption 2 requires"
        )
    return Condition(True, "independent, bounded samples of zero mean")


def _bounded(radius: float, result: Result) -> Condition:
    """(A.4), for the observer driven by the plant of this run."""
    if not radius < 1:
        return Condition(False, f"I + a_0 A_0 has the spectral radius {radius:.6g} for the longest step")
    largest = float(np.max(np.abs(result.y)))
    return Condition(True, f"(36) has a solution, and |x_1| <= {largest:.4g} along the run")


def _lipschitz(run: PreparedRun, result: Result, A_0: np.ndarray, H_0: np.ndarray, eps: float) -> float:
    """The largest norm of [[df/dx, 0], [H_0 C/eps, A_0/eps]] along the run."""
    model = run.plant.model
    slopes = evaluated(run, ca.jacobian(model.dynamics, model.x), model.x, along(result.time, result.x))
    n = len(A_0)
    full = np.zeros((len(slopes), 2 * n, 2 * n))
    full[:, :n, :n] = slopes
    full[:, n:, 0] = H_0 / eps
    full[:, n:, n:] = A_0 / eps
    return float(np.max(np.linalg.norm(full, 2, axis=(1, 2))))
