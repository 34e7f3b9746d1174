"""What a convergence theorem says of one observer of a run, and the transient that it bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.analysis.convergence import bounds, envelope, time_varying
from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.envelope import Envelope
from hgorun.analysis.convergence.premises import (
    Premises,
    dynamics_of,
    estimate_of,
    fastest_rate_of,
    is_coarse,
    premises_of,
    require_linear,
    truth_of,
    weights,
)
from hgorun.analysis.convergence.time_varying import FilterTheorem, Gramian
from hgorun.analysis.reasons import NoValue, outcome, why_lost
from hgorun.analysis.subject import Subject, once
from hgorun.observers.capabilities import FilterCascade, SettlingGain
from hgorun.observers.riccati import RiccatiGain
from hgorun.result.records.theory import Transient
from hgorun.symbolic.forms import BlockForm, ChainForm

_ROUNDING = 16 * np.finfo(float).eps


@dataclass(frozen=True, kw_only=True)
class Theorem:
    """A theorem with the numbers of a run.

    Attributes
    ----------
    theta_bound : float
        The smallest theta that it asks for.
    delay : Halanay
        The decay with late outputs.
    printed, sharp : (Envelope, ndarray of shape (n, 1))
        Of the scaled error, and what it is to each coordinate's; ``sharp`` with nothing given away.
    equation : str
        Of ``printed``, in Robles Magdaleno 2023.
    nominal_rate : float or None
        Decay without delay, noise and disturbance, where it has a closed form.
    """

    theta_bound: float
    delay: Halanay
    printed: tuple[Envelope, np.ndarray]
    sharp: tuple[Envelope, np.ndarray]
    equation: str
    nominal_rate: float | None = None


@once
def theorem_of(subject: Subject) -> Theorem:
    """The theorem of an observer.

    Raises
    ------
    NoValue
        Where none is known, or its assumptions have no numbers.
    """
    premises = premises_of(subject)
    require_linear(subject)
    if not isinstance(subject.observer, RiccatiGain):
        if isinstance(subject.observer, SettlingGain):
            raise NoValue(
                f"the gain of {subject.observer.type} follows the linearisation along the estimate: its theorem says "
                "that some theta is large enough, not which"
            )
        return _constant_gain(subject, premises)
    gramian = gramian_of(subject)
    if isinstance(subject.observer, FilterCascade):
        raise NoValue("theorems 2.3.1 and 2.4.1 bound a period, not a delay, and give no smallest theta")
    return _time_varying_gain(subject, premises, gramian)


def _constant_gain(subject: Subject, p: Premises) -> Theorem:
    """Theorems 3.3.1 and 3.4.1."""
    dynamics, theta, L, a = dynamics_of(subject), p.theta, p.lipschitz, p.amplitudes
    lyapunov = dynamics.lyapunov
    delay, sharp = delay_of(subject), sharp_delay_of(subject)
    start = np.concatenate(list(p.start.values()))
    scale = 1 / dynamics.scale(theta)[: dynamics.n, None]
    without_delay = "(3.34)" if _filtered(subject) else "(3.22)"
    return Theorem(
        equation="(3.69)" if a.delay > 0 else without_delay,
        theta_bound=bounds.smallest_theta(lyapunov.beta, L.constant),
        delay=delay,
        printed=(envelope.printed(dynamics, delay, start, theta, a), scale),
        sharp=(envelope.of_energy(dynamics, sharp, start, theta, a), weights(dynamics, theta)),
        nominal_rate=lyapunov.beta * theta,
    )


def delay_of(subject: Subject) -> Halanay:
    """Theorem 3.4.1 for an observer of constant gain."""
    require_linear(subject)
    p = premises_of(subject)
    return bounds.delayed(dynamics_of(subject), p.lipschitz, p.theta)


def sharp_delay_of(subject: Subject) -> Halanay:
    """The same proof with nothing given away."""
    require_linear(subject)
    p = premises_of(subject)
    return bounds.delayed_sharply(dynamics_of(subject), p.lipschitz, p.theta)


@once
def gramian_of(subject: Subject) -> Gramian:
    """The range of S(t), of an observer whose gain follows F(u, xhat)."""
    S = time_varying.gramian(subject.found)
    if not S.smallest > 0:
        raise NoValue("S(t) of this run is not positive definite")
    return S


def _links(subject: Subject) -> tuple[float, float]:
    assert isinstance(subject.form, BlockForm)
    return time_varying.largest_links(subject.run, subject.form, subject.result, subject.label)


def _time_varying_gain(subject: Subject, p: Premises, S: Gramian) -> Theorem:
    """Theorem 3.5.1."""
    filtered = _filtered(subject)
    delay = time_varying.delayed(S, filtered, _links(subject)[0], p.lipschitz, p.theta)
    scale = p.theta ** -p.chart.positions.astype(float)
    filters = [values for name, values in p.start.items() if name != "xhat"]
    scaled = np.concatenate([*filters, scale * p.start["xhat"]])
    both = time_varying.envelope(S, filtered, delay, scaled, scale, p.theta, p.amplitudes), 1 / scale[:, None]
    bound = time_varying.smallest_theta(S, p.lipschitz)
    return Theorem(theta_bound=bound, delay=delay, printed=both, sharp=both, equation="(3.105)")


def _filtered(subject: Subject) -> bool:
    """Whether the innovation goes through a filter."""
    return "filter" in subject.observer.roles(subject.form).values()


@once
def filter_theorem_of(subject: Subject) -> FilterTheorem:
    """Theorems 2.3.1 and 2.4.1, of FHGO I.

    Raises
    ------
    NoValue
        For other observers.
    """
    observer = subject.observer
    if not isinstance(observer, FilterCascade) or not isinstance(observer, RiccatiGain):
        raise NoValue("theorem 2.4.1 is for fhgo1")
    p, S = premises_of(subject), gramian_of(subject)
    blocks = int(np.max(p.chart.positions)) + 1
    return time_varying.filter_theorem(S, blocks, float(observer.delta), _links(subject), p.lipschitz, p.theta)


@once
def error_of(subject: Subject) -> np.ndarray:
    """|zhat - z| of the run, shape (Nt, n), in the coordinates of the theory."""
    chart = premises_of(subject).chart
    with np.errstate(all="ignore"):
        return np.asarray(np.abs(estimate_of(subject, chart) - truth_of(subject, chart)))


@dataclass(frozen=True)
class BoundedTransient:
    """Bounds of a theorem over time, shapes (Nt, n), and what the run lacks for them to hold."""

    printed: np.ndarray
    sharp: np.ndarray
    lacking: tuple[str, ...]
    too_coarse: bool


@once
def bounded_transient_of(subject: Subject) -> BoundedTransient:
    """The bounds on the output grid."""
    theorem, p = theorem_of(subject), premises_of(subject)
    since, floor = subject.result.time - subject.run.time.start, _floor(subject)
    printed, sharp = ((scale * course.at(since)[None] + floor).T for course, scale in (theorem.printed, theorem.sharp))
    lacking, coarse = _lacking(subject), is_coarse(subject)
    if coarse and p.lipschitz.region != "saturation" and (p.reach is None or np.any(sharp[0] > p.reach)):
        lacking.append("the output grid is too coarse to show where the slopes of phi matter")
    return BoundedTransient(printed, np.minimum(printed, sharp), tuple(lacking), coarse)


def _floor(subject: Subject) -> np.ndarray:
    """What rounding leaves of the difference of truth and estimate itself, shape (n, 1)."""
    truth = truth_of(subject, premises_of(subject).chart)
    return np.asarray(_ROUNDING * np.max(np.abs(truth), axis=0)[:, None])


def peaking_law_of(subject: Subject) -> dict[str, dict[str, float]]:
    """start exp(-rate (t - t_0)) + rest, by coordinate."""
    (course, scale), p = theorem_of(subject).printed, premises_of(subject)
    rest = (scale * course.at(np.array([np.inf])) + _floor(subject))[:, 0]
    return {
        name: {"start": float(a_i * course.gain * course.start), "rate": course.rate, "rest": float(r_i)}
        for name, a_i, r_i in zip(p.chart.names, scale[:, 0], rest, strict=True)
    }


@once
def transient_of(subject: Subject) -> Transient:
    """The error over time with its bounds; infinite ones where there is no theorem.

    Raises
    ------
    NoValue
        Where there are no coordinates of a theory.
    """
    names, error = premises_of(subject).chart.names, error_of(subject)
    time = subject.run.origin + subject.result.time
    bounded = outcome(lambda: bounded_transient_of(subject)).found
    if bounded is None:
        nothing = np.full_like(error, np.inf)
        return Transient(names, time, error, nothing, nothing, False)
    theorem = theorem_of(subject)
    nominal = None
    if theorem.nominal_rate is not None:
        course, scale = theorem.printed
        decay = np.exp(-theorem.nominal_rate * (time - time[0]))
        nominal = (scale * course.gain * course.start * decay).T
    lacking, equation = bounded.lacking, theorem.equation
    return Transient(names, time, error, bounded.printed, bounded.sharp, not lacking, nominal, equation, lacking)


def _lacking(subject: Subject) -> list[str]:
    """What the theorem assumes and the run does not meet."""
    theorem, p = theorem_of(subject), premises_of(subject)
    run, late = subject.run, p.amplitudes.delay
    found = []
    if p.theta < theorem.theta_bound * (1 - 1e-9):
        found.append(f"theta = {p.theta:.4g} is below theta_bound = {theorem.theta_bound:.4g}")
    if not late < theorem.delay.longest and late > 0:
        found.append(too_late(subject))
    if p.lipschitz.kind == "trajectory":
        found.append("the slopes of phi are known along the trajectories only, not bounded between them")
    found += p.lipschitz.remarks
    if subject.found.lost:
        found.append(why_lost(subject.found))
    if run.plant.block.discretise:
        found.append("the plant is a difference equation")
    if subject.observer.clip_estimate:
        found.append("the estimate is shown clipped, and the theorem is about what is behind it")
    if isinstance(subject.form, ChainForm) and not p.chart.identity and _clipped(subject):
        found.append("the estimate leaves its saturation, which is in x and not in z")
    if not run.adaptive and fastest_rate_of(subject) * run.step > 1:
        found.append(f"steps of {run.step:.3g} are too long for the observer's error to be followed")
    return found


def too_late(subject: Subject) -> str:
    """That the measurement is later than the theorem allows."""
    late, longest = premises_of(subject).amplitudes.delay, theorem_of(subject).delay.longest
    return f"d_M = {late:.4g} is not below delay_bound = {longest:.4g}"


def _clipped(subject: Subject) -> bool:
    """Whether an estimate leaves its bounds on the output grid."""
    xhat, states = subject.found.xhat, subject.result.states
    return any(
        bool(np.any(xhat[:, states.index(name)] < low) or np.any(xhat[:, states.index(name)] > high))
        for name, (low, high) in subject.observer.saturation.items()
    )
