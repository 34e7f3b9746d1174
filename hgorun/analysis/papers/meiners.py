"""What the theorems of Meiners, Adamy 2025 ask of a configuration, and what of it holds.

For `direct` the proof of theorem 1 takes V = eps^T S eps with (A - l c)^T S + S (A - l c) <= -lambda I and finds

    L V <= -k |eps|^2 + (1 - w)^2 c,    k = theta lambda - 2 |S| L,
    c = trace(S Theta^-1 Gamma W W^T Gamma^T Theta^-1)

for a reconstruction x^d = x + W B, B Brownian. (17) is negative near zero error when k > 0 and mu is small:
mu < 2 k / (L_h^2 theta^2 c) as in the proof, where theta stands for theta^2, and exactly when mu is below
1.2277 times that, since (1 - exp(-s))^2 / s has the maximum 0.40726. For `dynamic_gain` and `direct_dynamic`
(9) is decided by :mod:`hgorun.analysis.papers.lmi`; then k = a q, and mu(theta) = mu_0/theta^(2b) with
mu_0 < 2 k / c(theta).

W is not part of a configuration. The bounds on mu are for W = I, and are to be divided by w^2 for W = w I.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import casadi as ca
import numpy as np

from hgorun.analysis.linear.coordinates import transformed
from hgorun.analysis.papers.lmi import Certificate, certificate
from hgorun.analysis.papers.region import Points, along, box, evaluated
from hgorun.analysis.reasons import NoValue
from hgorun.config.expressions import parse
from hgorun.observers.capabilities import HighGain
from hgorun.observers.output_injection import OutputInjection
from hgorun.observers.praly_gain import DynamicGain
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.lower_triangular import LowerTriangularForm

SHARP = 1.2277  # the exact bound on mu over that of the proof: min of s/(2 (1 - exp(-s))^2)


@dataclass(frozen=True, kw_only=True)
class SlopeBound:
    """(6): gamma(y) bounds |dg_i/dx_j|, j = 2..i, in the coordinates where the observer computes.

    Attributes
    ----------
    holds : bool
        Along the run.
    ratio, excess : float
        The largest slope over gamma there, and the largest difference; ``inf`` where gamma is 0.
    slope, gamma : float
        At that point.
    at : float
        Its time.
    what : str
        Which derivative.
    box_ratio : float
        The largest ratio at points of the box that the run and its estimate span.
    at_end : float
        The ratio at the end of the run.
    """

    holds: bool
    ratio: float
    excess: float
    slope: float
    gamma: float
    at: float
    what: str
    box_ratio: float
    at_end: float


@dataclass(frozen=True, kw_only=True)
class Theorem1:
    """The numbers of theorem 1 along the run.

    Attributes
    ----------
    S : ndarray, shape (n, n)
    decay : float
        lambda of (15), for all slopes of the run.
    L, L_h : float
        Lipschitz constants of the f_i in x_1..x_i, times sqrt(n), and of h.
    k : float
        Positive: the theorem applies.
    mu : float
        As configured.
    mu_proof, mu_exact : float or None
        Bounds on mu for W = I; None without reconstruction or where k <= 0.
    """

    S: np.ndarray
    decay: float
    L: float
    L_h: float
    k: float
    mu: float
    mu_proof: float | None
    mu_exact: float | None


@dataclass(frozen=True, kw_only=True)
class Theorem2:
    """The numbers of theorem 2.

    Attributes
    ----------
    inequality : Certificate
        Of (9).
    slopes : SlopeBound
        (6).
    k : float or None
        a times the smallest eigenvalue of Q.
    phi_above_a : bool or None
        None without reconstruction.
    mu_0 : float or None
        As configured.
    mu_0_proof, mu_0_exact : float or None
        Bounds for W = I and every theta >= 1 of the run.
    """

    inequality: Certificate
    slopes: SlopeBound
    k: float | None
    phi_above_a: bool | None
    mu_0: float | None
    mu_0_proof: float | None
    mu_0_exact: float | None


def meiners_conditions(run: PreparedRun, label: str, result: Result) -> Theorem1 | Theorem2:
    """The theorem of this observer; NoValue for observers of other papers."""
    observer = run.experiment.observers[label]
    if isinstance(observer, DynamicGain):
        return _theorem_2(run, label, observer, result)
    if isinstance(observer, OutputInjection) and isinstance(observer, HighGain):
        return _theorem_1(run, label, observer, observer.theta, result)
    raise NoValue("the theorems are for direct, dynamic_gain and direct_dynamic")


def slope_bound(run: PreparedRun, label: str, result: Result) -> SlopeBound:
    """(6) along a run, for an observer with a dynamic gain."""
    observer = run.experiment.observers[label]
    assert isinstance(observer, DynamicGain)
    form = _form(run, label)
    model, order = form.model, form.order
    J = ca.jacobian(model.dynamics, model.x)
    places = [(order[i], order[j]) for i in range(model.n) for j in range(1, i + 1)]
    y = model.x[order[0]]
    gamma = ca.SX(parse(observer.gamma, names=("y",)).symbol({"y": y}))
    expression = ca.vertcat(*[ca.fabs(J[i, j]) for i, j in places], gamma)

    def look(points: Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        values = evaluated(run, expression, model.x, points)[:, :, 0]
        slopes, bound = values[:, :-1], values[:, -1]
        largest = slopes.max(axis=1, initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(largest > 0, largest / np.maximum(bound, 0.0), 0.0)
        return slopes, bound, ratio

    x = transformed(form, result.x, run.plant.parameters)
    path = along(result.time, x)
    slopes, bound, ratio = look(path)
    worst = int(np.argmax(ratio))
    estimate = transformed(form, result.observers[label].xhat, run.plant.parameters)
    both = np.concatenate([x, estimate[np.all(np.isfinite(estimate), axis=1)]])
    _, _, in_box = look(box(result.time, both.min(axis=0), both.max(axis=0)))
    which = int(np.argmax(slopes[worst])) if places else 0
    what = f"d g_{places[which][0] + 1} / d {model.states[places[which][1]]}" if places else "none"
    if places:
        i = order.index(places[which][0])
        what = f"d g_{i + 1} / d x_{order.index(places[which][1]) + 1}"
    largest = float(slopes[worst].max(initial=0.0))
    return SlopeBound(
        holds=bool(ratio[worst] <= 1),
        ratio=float(ratio[worst]),
        excess=float(np.max(slopes.max(axis=1, initial=0.0) - bound)),
        slope=largest,
        gamma=float(bound[worst]),
        at=float(path.t[worst]),
        what=what,
        box_ratio=float(np.nanmax(in_box)),
        at_end=float(look(Points(result.time[-1:], x[-1:]))[2][0]),
    )


def _theorem_1(run: PreparedRun, label: str, observer: OutputInjection, theta: float, result: Result) -> Theorem1:
    from scipy.linalg import solve_continuous_lyapunov

    form = _form(run, label)
    model, order, n = form.model, list(form.order), form.n
    J = ca.jacobian(model.dynamics, model.x)[order, order]
    c = ca.jacobian(model.output, model.x)[0, order[0]]
    points = along(result.time, transformed(form, result.x, run.plant.parameters))
    slopes = evaluated(run, J, model.x, points)
    head = evaluated(run, c, model.x, points)[:, 0, 0]
    l = observer.injection(form)  # noqa: E741  # the paper's letter
    # A - l c with the slopes of each point, states in the order x_1..x_n
    closed = np.zeros_like(slopes)
    for i in range(n - 1):
        closed[:, i, i + 1] = slopes[:, i, i + 1]
    closed[:, :, 0] -= head[:, None] * l
    mean = closed.mean(axis=0)
    if np.max(np.linalg.eigvals(mean).real) >= 0:
        raise NoValue("A - l c is not Hurwitz with the run's mean slopes")
    S = solve_continuous_lyapunov(mean.T, -np.eye(n))
    decay = -float(np.max(np.linalg.eigvalsh(closed.swapaxes(1, 2) @ S + S @ closed)))
    lower = np.tril(np.ones((n, n), dtype=bool))
    L = float(np.sqrt(n) * np.max(np.linalg.norm(np.where(lower, slopes, 0.0), axis=2)))
    L_h = float(np.max(np.abs(head)))
    k = theta * decay - 2 * float(np.linalg.norm(S, 2)) * L
    proof, blend = None, observer.blend
    if blend is not None and k > 0:
        powers = theta ** np.arange(1, n + 1)
        Gamma = np.outer(powers * l, np.eye(n)[0] * head.mean()) + blend.phi / 2 * np.eye(n)
        proof = 2 * k / (L_h**2 * theta**2 * _noise(S, Gamma, 1 / powers))
    return Theorem1(
        S=S,
        decay=decay,
        L=L,
        L_h=L_h,
        k=k,
        mu=0.0 if blend is None else blend.mu,
        mu_proof=proof,
        mu_exact=None if proof is None else SHARP * proof,
    )


def _theorem_2(run: PreparedRun, label: str, observer: DynamicGain, result: Result) -> Theorem2:
    form = _form(run, label)
    n = form.n
    inequality = certificate(observer.injection(form).tolist(), observer.a, observer.b, observer.q)
    slopes = slope_bound(run, label, result)
    k = None if inequality.Q is None else observer.a * float(np.linalg.eigvalsh(inequality.Q)[0])
    blend = observer.blend
    if blend is None:
        return Theorem2(
            inequality=inequality, slopes=slopes, k=k, phi_above_a=None, mu_0=None, mu_0_proof=None, mu_0_exact=None
        )
    proof = None
    if inequality.Q is not None and k is not None:
        thetas = np.asarray(result.observers[label].internal["theta"], dtype=float).ravel()
        thetas = thetas[np.isfinite(thetas)]
        largest = max(
            _noise(
                inequality.Q,
                np.eye(n, k=1) + theta * blend.phi / 2 * np.eye(n),
                theta ** (1 - np.arange(1, n + 1) - observer.b),
            )
            for theta in np.linspace(max(thetas.min(), 1.0), max(thetas.max(), 1.0), 50)
        )
        proof = 2 * k / largest
    return Theorem2(
        inequality=inequality,
        slopes=slopes,
        k=k,
        phi_above_a=bool(blend.phi > observer.a),
        mu_0=blend.mu,
        mu_0_proof=proof,
        mu_0_exact=None if proof is None else SHARP * proof,
    )


def _noise(S: np.ndarray, Gamma: np.ndarray, scale: np.ndarray) -> float:
    """c = trace(S D Gamma Gamma^T D) for W = I, D = diag(scale)."""
    G = scale[:, None] * Gamma
    return float(np.trace(S @ G @ G.T))


def _form(run: PreparedRun, label: str) -> LowerTriangularForm:
    return cast(LowerTriangularForm, run.forms[label])  # what every OutputInjection is for
