"""What the convergence theorems start from, for one observer of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hgorun.analysis.convergence import envelope
from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.charts import Chart, chart_of
from hgorun.analysis.convergence.gains import ErrorDynamics, error_dynamics
from hgorun.analysis.convergence.lipschitz import Lipschitz, lipschitz, slopes_met
from hgorun.analysis.convergence.segments import Trajectories
from hgorun.analysis.convergence.signals import Amplitudes, amplitudes
from hgorun.analysis.reasons import RECALLS, NoValue, Outcome, outcome, require_innovation
from hgorun.analysis.subject import Subject, once
from hgorun.memo import Memo, same
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import HighGain, LocallyLinear, SettlingGain
from hgorun.symbolic.forms import BlockForm, ChainForm

_FINE = 0.5  # of the fastest time constant: the output grid shows a transient whose steps are shorter
_MORE = 1.5  # than the bound on a transient without delay: that with one is a little larger
_DYNAMICS: Memo[ErrorDynamics] = Memo(64)  # by observer and form
_RATES: Memo[float] = Memo(128)


@dataclass(frozen=True, kw_only=True)
class Premises:
    """An observer's coordinates, slopes and disturbances.

    Attributes
    ----------
    theta : float
    chart : Chart
    lipschitz : Lipschitz
    amplitudes : Amplitudes
    reach : ndarray or None
        How far the estimate may go, where the output grid does not show it.
    start : mapping of str to ndarray
        Errors and internal states at the start, flat, by name; the estimate's error is ``xhat``.
    """

    theta: float
    chart: Chart
    lipschitz: Lipschitz
    amplitudes: Amplitudes
    reach: np.ndarray | None
    start: Mapping[str, np.ndarray]


@once
def dynamics_of(subject: Subject) -> ErrorDynamics:
    """The error's matrices at theta = 1, which depend on no run."""
    observer, form = subject.observer, subject.form
    return _DYNAMICS.get((same(observer), same(form)), lambda: error_dynamics(observer, form))


def theta_of(subject: Subject) -> float:
    """The observer's constant theta.

    Raises
    ------
    NoValue
        When it has none.
    """
    if not isinstance(subject.observer, HighGain):
        raise NoValue(f"{subject.observer.type} has no constant theta")
    return float(subject.observer.theta)


@once
def premises_of(subject: Subject) -> Premises:
    """The premises of an observer's theorem.

    Raises
    ------
    NoValue
        Where there is no theorem to start from.
    """
    if isinstance(subject.observer, (CorrectedObserver, SampledObserver)):
        raise NoValue(f"{subject.observer.type} jumps at the samples; the theorems are for flows")
    if subject.block.recalled:
        raise NoValue(RECALLS)
    require_innovation(subject.run, subject.label)
    theta = theta_of(subject)
    chart = chart_of(subject.form, subject.run.plant)
    limited = isinstance(subject.form, BlockForm) or chart.identity
    saturation = {name: (low, high) for name, (low, high) in subject.observer.saturation.items()} if limited else {}
    truth = truth_of(subject, chart)
    a = _amplitudes_of(subject, chart, truth)
    start = _start(subject, chart)
    dynamics = outcome(lambda: dynamics_of(subject)).found
    constant = isinstance(subject.form, ChainForm) and not isinstance(subject.observer, SettlingGain)
    bounded = dynamics is not None and dynamics.lyapunov.hurwitz and constant
    reach = _reach(dynamics, start, theta, a) if dynamics is not None and bounded and is_coarse(subject) else None
    met = np.maximum(_met_by_truth(subject, chart), slopes_met(chart, subject.result, subject.found.xhat))
    trajectories = Trajectories(
        chart=chart,
        time=subject.result.time,
        x=subject.result.x,
        xhat=subject.found.xhat,
        z=truth,
        zhat=estimate_of(subject, chart),
    )
    slopes = lipschitz(subject.run, trajectories, saturation, met, reach)
    return Premises(theta=theta, chart=chart, lipschitz=slopes, amplitudes=a, reach=reach, start=start)


def truth_of(subject: Subject, chart: Chart) -> np.ndarray:
    """z of the simulated truth, shape (Nt, n): found once for all observers of a chart."""
    known, key = subject.context.known, (truth_of, chart)
    if key not in known:
        known[key] = Outcome(chart.image(subject.result.x))
    return np.asarray(known[key].value)


def estimate_of(subject: Subject, chart: Chart) -> np.ndarray:
    """z of the estimate, shape (Nt, n): found once."""
    key = (estimate_of, chart)
    if key not in subject.known:
        with np.errstate(all="ignore"):
            subject.known[key] = Outcome(chart.image(subject.found.xhat))
    return np.asarray(subject.known[key].value)


def _met_by_truth(subject: Subject, chart: Chart) -> np.ndarray:
    """The largest slopes on the simulated truth, shape (n, n): found once for all observers of a chart."""
    known, key = subject.context.known, (_met_by_truth, chart)
    if key not in known:
        known[key] = Outcome(slopes_met(chart, subject.result, subject.result.x))
    return np.asarray(known[key].value)


def _amplitudes_of(subject: Subject, chart: Chart, truth: np.ndarray) -> Amplitudes:
    """Of noise and disturbance: found once for all observers of a chart."""
    known, key = subject.context.known, (_amplitudes_of, chart)
    if key not in known:
        known[key] = Outcome(amplitudes(subject.run, chart, subject.result, truth))
    found = known[key].value
    assert isinstance(found, Amplitudes)
    return found


def require_linear(subject: Subject) -> None:
    """The theorems are for corrections that are linear in the innovation.

    Raises
    ------
    NoValue
    """
    if isinstance(subject.observer, LocallyLinear) and subject.observer.nonlinear is not None:
        raise NoValue(f"the theorems are for corrections linear in the innovation: here {subject.observer.nonlinear}")


def _start(subject: Subject, chart: Chart) -> dict[str, np.ndarray]:
    error = chart.image(subject.found.xhat[:1]) - chart.image(subject.run.plant.initial[None])
    start = {"xhat": error[0]}
    roles = subject.observer.roles(subject.form)
    for name, state in subject.block.states.items():
        if name not in ("xhat", "alpha") and roles.get(name) != "gain" and state.size:
            start[name] = np.ravel(state.numbers(np.asarray(subject.found.internal[name][0])))
    return start


def is_coarse(subject: Subject) -> bool:
    """Whether a transient fits between two points of the output grid."""
    time = subject.result.time
    return bool(time.size < 2 or (time[1] - time[0]) * _error_rate_of(subject) > _FINE)


def _error_rate_of(subject: Subject) -> float:
    observer, form = subject.observer, subject.form
    return _RATES.get(("error", same(observer), same(form)), lambda: observer.error_rate(form))


def fastest_rate_of(subject: Subject) -> float:
    """How fast an observer's equations are, which depends on no run."""
    observer, form = subject.observer, subject.form
    return _RATES.get(("fastest", same(observer), same(form)), lambda: observer.fastest_rate(form))


def _reach(dynamics: ErrorDynamics, start: Mapping[str, np.ndarray], theta: float, a: Amplitudes) -> np.ndarray:
    """How far the theorem lets an estimate go, whatever the Lipschitz constant with which it holds; 50 % more."""
    rate = Halanay(dynamics.lyapunov.beta * theta, 0.0)
    first = np.concatenate(list(start.values()))
    energy = envelope.of_energy(dynamics, rate, first, theta, replace(a, delay=0.0))
    return np.asarray(_MORE * (weights(dynamics, theta) * energy.at(np.zeros(1))).ravel())


def weights(dynamics: ErrorDynamics, theta: float) -> np.ndarray:
    """theta^(i-1) sqrt((P^-1)_ii): what sqrt V is to the i-th error, shape (n, 1)."""
    return np.asarray((dynamics.weights / dynamics.scale(theta))[: dynamics.n, None])
