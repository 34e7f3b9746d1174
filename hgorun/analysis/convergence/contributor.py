"""What the convergence theorems promise for each observer of a run, and the transient that they bound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hgorun.analysis.convergence import bounds, peaking, time_varying
from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.gains import MU, ErrorDynamics, error_dynamics
from hgorun.analysis.convergence.peaking import Course
from hgorun.analysis.convergence.setting import Setting, coarse, setting_of, weights
from hgorun.analysis.findings import Context, Findings
from hgorun.observers.riccati import RiccatiGain
from hgorun.result.theory import Transient
from hgorun.simulation.observer_block import ObserverBlock
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.triangular import TriangularForm
from hgorun.analysis.reasons import NoValue

_GAIN = ("poles", "hurwitz", "beta", "chi")
_BOUNDS = (
    "lipschitz",
    "theta_bound",
    "delay_max",
    "delay_bound",
    "eta_theta",
    "peaking",
    "peaking_bound",
)
_ROUNDING = 16 * np.finfo(float).eps


def promises(context: Context) -> Mapping[str, Findings]:
    """Poles, beta, chi, Lipschitz constant, the bounds on theta and delay, the transient and its bound."""
    return {label: _of(context, block) for label, block in context.blocks.items()}


def _of(context: Context, block: ObserverBlock) -> Findings:
    found = Findings()
    dynamics = None
    try:
        dynamics = error_dynamics(block.observer, block.form)
    except NoValue as reason:
        found.withhold(str(reason), *_GAIN)
    else:
        _gains(found, dynamics)
    if hasattr(block.observer, "theta"):
        found.give(theta=float(block.observer.theta))
    try:
        setting = setting_of(context, block, dynamics)
    except NoValue as reason:
        found.withhold(str(reason), *_BOUNDS)
        return found
    found.remarks += setting.amplitudes.remarks
    L = setting.lipschitz
    found.give(
        lipschitz=L.value,
        lipschitz_kind=L.kind,
        lipschitz_region=L.region,
        lipschitz_reached=L.seen,
        lipschitz_box={name: list(sides) for name, sides in L.box.items()},
        delay_max=setting.amplitudes.delay,
    )
    try:
        if isinstance(block.observer, RiccatiGain):
            _follow(found, setting)
        elif dynamics is not None:
            _hold(found, setting, dynamics)
        else:
            raise NoValue(found.reasons["beta"])
    except NoValue as reason:
        _unbounded(found, setting)
        found.withhold(str(reason), "theta_bound", "delay_bound", "eta_theta", "peaking_bound")
    return found


def _gains(found: Findings, dynamics: ErrorDynamics) -> None:
    certificate = dynamics.certificate
    found.give(poles=certificate.poles, hurwitz=certificate.hurwitz)
    try:
        found.give(beta=certificate.beta, chi=certificate.chi, mu=MU, P=certificate.P)
    except NoValue as reason:
        found.withhold(str(reason), "beta", "chi")


def _hold(found: Findings, s: Setting, dynamics: ErrorDynamics) -> None:
    """Observers of constant gain: Theorems 3.3.1 and 3.4.1."""
    certificate, theta, L = dynamics.certificate, s.theta, s.lipschitz
    beta = certificate.beta
    limit = bounds.smallest_theta(beta, L.constant)
    delay = bounds.delayed(dynamics, certificate, L, theta)
    sharp = bounds.delayed_sharply(dynamics, certificate, L, theta)
    found.give(
        theta_bound=limit,
        theta_bound_printed=bounds.printed_theta(beta, L),
        delay_bound=delay.longest,
        delay_bound_sharp=sharp.longest,
    )
    start = np.concatenate(list(s.start.values()))
    a = s.amplitudes
    scale = 1 / dynamics.scale(theta)[: dynamics.n, None]
    printed = peaking.course(dynamics, certificate, delay, start, theta, a)
    energy = peaking.sharp_course(dynamics, certificate, sharp, start, theta, a)
    _promise(found, s, limit, delay, (printed, scale), (energy, weights(dynamics, theta)))
    assert found.transient is not None
    decay = np.exp(-beta * theta * (found.transient.time - found.transient.time[0]))
    found.transient = replace(found.transient, nominal=(scale * printed.gain * printed.start * decay).T)


def _follow(found: Findings, s: Setting) -> None:
    """Observers with a gain that follows F(u, xhat): Theorems 3.5.1 and 2.3.1, 2.4.1."""
    form, theta, L = s.block.form, s.theta, s.lipschitz
    assert isinstance(form, TriangularForm)
    observer = s.context.result.observers[s.block.label]
    S = time_varying.gramian(observer)
    if not S.smallest > 0:
        raise NoValue("S(t) of this run is not positive definite")
    found.give(chi_S=S.chi)
    links = time_varying.largest_links(s.context.run, form, s.context.result, s.block.label)
    if hasattr(s.block.observer, "delta"):
        _filter(found, s, S, links)
        return
    filtered = "eta" in s.block.states
    limit = time_varying.smallest_theta(S, L)
    delay = time_varying.delayed(S, filtered, links[0], L, theta)
    found.give(theta_bound=limit, delay_bound=delay.longest)
    found.remarks.append("theta_bound, delay_bound and chi_S are with the S(t) of this run, which changes with theta")
    start, scale = s.start, theta ** -s.chart.positions.astype(float)
    filters = [values for name, values in start.items() if name != "xhat"]
    scaled = np.concatenate([*filters, scale * start["xhat"]])
    course = time_varying.course(S, filtered, delay, scaled, scale, theta, s.amplitudes)
    _promise(found, s, limit, delay, (course, 1 / scale[:, None]), (course, 1 / scale[:, None]))


def _filter(found: Findings, s: Setting, S: time_varying.Gramian, links: tuple[float, float]) -> None:
    """FHGO I."""
    delta = float(s.block.observer.delta)  # type: ignore[attr-defined]
    blocks = int(np.max(s.chart.positions)) + 1
    theorem = time_varying.filter_theorem(S, blocks, delta, links, s.lipschitz, s.theta)
    _unbounded(found, s)
    other = "theorems 2.3.1 and 2.4.1 are of a period, not of a delay, and name no smallest theta"
    found.withhold(other, "theta_bound", "delay_bound", "eta_theta", "peaking_bound")
    if theorem.tau > 0:
        found.give(tau_bound=theorem.tau)
    else:
        why = f"theorem 2.4.1 asks for a larger theta or delta: mu(theta) = {theorem.mu:.4g}, nu = {theorem.nu:.4g}"
        found.withhold(why, "tau_bound")


def _measured(s: Setting) -> tuple[dict[str, float], np.ndarray]:
    """The peak of |zhat - z|, and all of it, shape (Nt, n)."""
    result = s.context.result
    with np.errstate(all="ignore"):
        error = np.abs(s.chart.image(result.observers[s.block.label].xhat) - s.chart.image(result.x))
    return dict(zip(s.chart.names, np.max(error, axis=0), strict=True)), error


def _unbounded(found: Findings, s: Setting) -> None:
    """The error alone."""
    peaks, error = _measured(s)
    found.give(peaking=peaks)
    nothing = np.full_like(error, np.inf)
    found.transient = Transient(s.chart.names, s.context.result.time, error, nothing, nothing, False)


def _promise(
    found: Findings,
    s: Setting,
    limit: float,
    delay: Halanay,
    printed: tuple[Course, np.ndarray],
    sharp: tuple[Course, np.ndarray],
) -> None:
    """Bounds on the output grid beside the error, and whether the run meets what they assume."""
    result, a = s.context.result, s.amplitudes
    since = result.time - s.context.run.time.start
    floor = _ROUNDING * np.max(np.abs(s.chart.image(result.x)), axis=0)[:, None]  # of the difference itself
    both = [(scale * course.at(since)[None] + floor).T for course, scale in (printed, sharp)]
    peaks, error = _measured(s)
    lacking = _lacking(s, limit, delay)
    if coarse(s.context, s.block):
        found.remarks.append("the output grid is too coarse for the transient: peaking is what the grid shows of it")
        if s.lipschitz.region != "saturation" and (s.reach is None or np.any(both[1][0] > s.reach)):
            lacking.append("the output grid is too coarse to show where the slopes of phi matter")
    rate = delay.rate(a.delay)
    found.give(peaking=peaks)
    if rate > 0:
        found.give(eta_theta=rate)
    else:
        found.withhold(f"d_M = {a.delay:.4g} is not below delay_bound = {delay.longest:.4g}", "eta_theta")
    if lacking:
        found.withhold("; ".join(lacking), "peaking_bound")
    else:
        course, scale = printed
        law = [
            {"start": float(a_i * course.gain * course.start), "rate": course.rate, "rest": float(rest)}
            for a_i, rest in zip(scale[:, 0], (scale * course.at(np.array([np.inf])) + floor)[:, 0], strict=True)
        ]
        found.give(
            peaking_bound=dict(zip(s.chart.names, both[0][0], strict=True)),
            peaking_law=dict(zip(s.chart.names, law, strict=True)),
        )
    found.transient = Transient(s.chart.names, result.time, error, both[0], np.minimum(*both), not lacking)


def _lacking(s: Setting, limit: float, delay: Halanay) -> list[str]:
    """What the theorem assumes and the run does not meet."""
    run, result, a, observer = s.context.run, s.context.result, s.amplitudes, s.block.observer
    found = []
    if s.theta < limit * (1 - 1e-9):
        found.append(f"theta = {s.theta:.4g} is below theta_bound = {limit:.4g}")
    if not a.delay < delay.longest and a.delay > 0:
        found.append(f"d_M = {a.delay:.4g} is not below delay_bound = {delay.longest:.4g}")
    if s.lipschitz.kind == "trajectory":
        found.append("the slopes of phi are known along the trajectories only, not bounded between them")
    found += s.lipschitz.remarks
    if result.observers[s.block.label].diverged_at is not None:
        found.append("the observer diverged")
    if run.plant.block.discretise:
        found.append("the plant is a difference equation")
    if isinstance(s.block.form, CanonicalForm) and not s.chart.own and _clipped(s):
        found.append("the estimate leaves its saturation, which is in x and not in z")
    if not run.adaptive and observer.fastest_rate(s.block.form) * run.step > 1:
        found.append(f"steps of {run.step:.3g} are too long for the observer's error to be followed")
    return found


def _clipped(s: Setting) -> bool:
    """Whether an estimate leaves its bounds on the output grid."""
    result = s.context.result
    xhat = result.observers[s.block.label].xhat
    return any(
        bool(np.any(xhat[:, result.states.index(name)] < low) or np.any(xhat[:, result.states.index(name)] > high))
        for name, (low, high) in s.block.observer.saturation.items()
    )
