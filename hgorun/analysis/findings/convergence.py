"""What the convergence theorems ask for and bound: slopes, gain, delay, transient."""

from __future__ import annotations

from hgorun.analysis.convergence import bounds
from hgorun.analysis.convergence.premises import dynamics_of, premises_of
from hgorun.analysis.convergence.theorem import (
    bounded_transient_of,
    error_of,
    filter_theorem_of,
    gramian_of,
    peaking_law_of,
    sharp_delay_of,
    theorem_of,
    too_late,
)
from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.reasons import NoValue, outcome
from hgorun.analysis.subject import Subject
from hgorun.observers.capabilities import HighGain, SettlingGain
from hgorun.observers.riccati import RiccatiGain


def _coarse(observer: Subject) -> tuple[str, ...]:
    """That the grid may miss the peak, where there is a bound to compare it with."""
    bounded = outcome(lambda: bounded_transient_of(observer)).found
    if bounded is None or not bounded.too_coarse:
        return ()
    return ("the output grid is too coarse for the transient: peaking is what the grid shows of it",)


def _holds(observer: Subject) -> bool:
    """Whether its gain is constant."""
    return not _follows(observer)


def _has_gramian(observer: Subject) -> bool:
    """Whether its theorem is about S(t)."""
    return isinstance(observer.observer, RiccatiGain)


def _follows(observer: Subject) -> bool:
    """Whether its gain follows the plant."""
    return isinstance(observer.observer, SettlingGain)


@finding(r"L_phi of (3.8), (3.16): the largest \|d phi_k/d z_i\|", group="slopes")
def lipschitz(observer: Subject) -> Remarked:
    premises = premises_of(observer)
    return Remarked(premises.lipschitz.value, premises.amplitudes.remarks)


@finding(
    "what `lipschitz` is. `interval over box`: a bound by interval arithmetic; `interval along run`: a bound on the "
    "segments between truth and estimate, if the box has points that are not states; `trajectory`: the largest slope "
    "along the run, not a bound",
    group="slopes",
    places=("json",),
    optional=True,
)
def lipschitz_kind(observer: Subject) -> str:
    return premises_of(observer).lipschitz.kind


@finding(
    "the region of `lipschitz`: the observer's saturation, or the box of the simulated truth and estimate, 5 % wider",
    group="slopes",
    places=("json",),
    optional=True,
)
def lipschitz_region(observer: Subject) -> str:
    return premises_of(observer).lipschitz.region


@finding("the largest slope of phi along the run", group="slopes", optional=True)
def lipschitz_reached(observer: Subject) -> float:
    return premises_of(observer).lipschitz.seen


@finding("the box of `lipschitz`: [low, high] of every coordinate", group="slopes", places=("json",), optional=True)
def lipschitz_box(observer: Subject) -> dict[str, list[float]]:
    return {name: list(sides) for name, sides in premises_of(observer).lipschitz.box.items()}


@finding(
    "the smallest theta that the proof allows: beta theta >= c_1(theta), c_1 the norm of the matrix of slopes scaled "
    "with theta; time-varying gains: theta >= 4 sqrt(chi_S) c_1(theta)",
    group="theta",
)
def theta_bound(observer: Subject) -> float | Remarked:
    bound = theorem_of(observer).theta_bound
    if _follows(observer):
        remark = "theta_bound, delay_bound and chi_S are with the S(t) of this run, which changes with theta"
        return Remarked(bound, (remark,))
    if isinstance(observer.observer, HighGain) and observer.observer.poles_follow:
        remark = "theta_bound is with the poles at the present theta: those of poles_for_period change with theta"
        return Remarked(bound, (remark,))
    return bound


@finding(
    "max(1, n L_phi/beta): `theta_bound` with (3.17)", group="theta", places=("json",), optional=True, applies=_holds
)
def theta_bound_printed(observer: Subject) -> float:
    premises = premises_of(observer)
    return bounds.printed_theta(dynamics_of(observer).lyapunov.beta, premises.lipschitz)


@finding("d_M: the largest age of the newest measurement, sampling included", unit="time", group="delay")
def delay_max(observer: Subject) -> float:
    return premises_of(observer).amplitudes.delay


@finding(
    "the delay that the proof allows: d_M < beta/(chi (L_phi + theta)) (3.68)",
    unit="time",
    group="delay",
    places=("json", "table", "compare"),
)
def delay_bound(observer: Subject) -> float:
    return theorem_of(observer).delay.longest


@finding(
    "`delay_bound` from the same proof with its estimates made sharp; 0 if it needs a larger theta",
    unit="time",
    group="delay",
    places=("json",),
    optional=True,
    applies=_holds,
)
def delay_bound_sharp(observer: Subject) -> float:
    return sharp_delay_of(observer).longest


@finding(
    "the decay rate (3.70) at d_M; beta theta without delay. Guaranteed for theta >= `theta_bound`",
    unit="1/time",
    group="rate",
)
def eta_theta(observer: Subject) -> float:
    rate = theorem_of(observer).delay.rate(premises_of(observer).amplitudes.delay)
    if not rate > 0:
        raise NoValue(too_late(observer))
    return rate


@finding("for fhgo1: the largest sampling period of theorem 2.4.1, with (2.82) corrected", unit="time", group="period")
def tau_bound(observer: Subject) -> float:
    theorem = filter_theorem_of(observer)
    if not theorem.tau > 0:
        raise NoValue(
            f"theorem 2.4.1 requires a larger theta or delta: mu(theta) = {theorem.mu:.4g}, nu = {theorem.nu:.4g}"
        )
    return theorem.tau


@finding(r"the largest \|zhat - z\| of the run, by coordinate", unit="state", group="peaking")
def peaking(observer: Subject) -> Remarked:
    names, largest = premises_of(observer).chart.names, error_of(observer).max(axis=0)
    return Remarked(dict(zip(names, largest, strict=True)), _coarse(observer))


@finding(
    "the theorem's bound on `peaking`; null if the run does not satisfy the theorem's assumptions, with the one that "
    "fails",
    unit="state",
    group="peaking",
)
def peaking_bound(observer: Subject) -> dict[str, float]:
    bounded = bounded_transient_of(observer)
    if bounded.lacking:
        raise NoValue("; ".join(bounded.lacking))
    return dict(zip(premises_of(observer).chart.names, bounded.printed[0], strict=True))


@finding(
    "the bound on the error over time, by coordinate: start exp(-rate (t - t_0)) + rest",
    group="peaking",
    places=("json",),
    optional=True,
)
def peaking_law(observer: Subject) -> dict[str, dict[str, float]]:
    if bounded_transient_of(observer).lacking:
        raise NoValue("the bound does not hold")
    return peaking_law_of(observer)


@finding("time-varying gains: sup lambda_max(S)/inf lambda_min(S) over the run", optional=True, applies=_has_gramian)
def chi_S(observer: Subject) -> float:  # the theorem's letter
    premises_of(observer)  # there is a theorem
    return gramian_of(observer).chi
