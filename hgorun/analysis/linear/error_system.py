"""The error of an observer near the truth, as a linear system with the innovation as its input.

With xi the observer's states that matter to the error and e the innovation,

    xi' = A0 xi + E e,    C xhat = H xi,    alpha' = -c = -(K0 xi + K e)

Between the samples e = s + alpha with s held, so that e' = -c too, and (xi, e) is a closed system,

    (xi, e)' = G (xi, e),    G = [[A0, E], [-K0, -K]]

alpha itself never comes back to zero, and would be an eigenvalue 1 of any period that says nothing: here only
e is left of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.reasons import RECALLS, NoValue, why_lost, why_no_flow
from hgorun.errors import printable
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import SlidingMode
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.error_dynamics.filters_at_rest import not_at_zero, values_of
from hgorun.simulation.error_dynamics.slopes import filter_rates
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.states import StateBlock

_SAME = 1e-7  # relative change below which the systems along a trajectory are one
_MAX_TIMES = 4000  # along a run, at which it is linearised
_NOTHING = 1e-12  # relative size of an influence that is rounding


@dataclass(frozen=True)
class ErrorSystem:
    """Linear systems at times on an even grid; one time where they do not change.

    Attributes
    ----------
    times : ndarray, shape (M,)
    A0, E, H, K0, K : ndarray
        Shapes (M, N, N), (M, N, q), (M, q, N), (M, q, N), (M, q, q).
    where : str
        Which points these are.
    cycle : float, optional
        The time after which the systems come round again: that of the whole grid. None: they end with it.
    """

    times: np.ndarray
    A0: np.ndarray
    E: np.ndarray
    H: np.ndarray
    K0: np.ndarray
    K: np.ndarray
    where: str
    cycle: float | None = None

    def within(self, times: np.ndarray) -> np.ndarray:
        """Times on the grid, at which the systems are those of other times."""
        return times if self.cycle is None else self.times[0] + (times - self.times[0]) % self.cycle

    @property
    def N(self) -> int:
        """Number of states."""
        return int(self.A0.shape[1])

    @property
    def q(self) -> int:
        """Number of outputs."""
        return int(self.E.shape[2])

    @cached_property
    def G(self) -> np.ndarray:
        """The closed systems of (xi, e) between samples, shape (M, N + q, N + q)."""
        return np.block([[self.A0, self.E], [-self.K0, -self.K]])

    @property
    def A(self) -> np.ndarray:
        """With a continuous, undelayed output, shape (M, N, N)."""
        return np.asarray(self.A0 + self.E @ self.H)

    @property
    def constant(self) -> bool:
        """Whether it is one system."""
        return self.times.size == 1

    @cached_property
    def rate(self) -> float:
        """The largest modulus of an eigenvalue of A, at any of the times (1/time)."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A[:: self._stride]))))

    @cached_property
    def fastest(self) -> float:
        """The faster of the flow between samples and of its own change along the trajectory (1/time)."""
        flow = float(np.max(np.abs(np.linalg.eigvals(self.G[:: self._stride]))))
        if self.constant:
            return flow
        steps = np.max(np.abs(np.diff(self.G, axis=0)), axis=0)
        size = np.max(np.abs(self.G), axis=0)
        change = float(np.max(steps / np.where(size > 0, size, 1))) / float(self.times[1] - self.times[0])
        return max(flow, change)

    @property
    def _stride(self) -> int:
        return max(self.times.size // 1000, 1)


def error_system(run: PreparedRun, label: str, result: Result) -> ErrorSystem:
    """The error's linear systems along the last two thirds of a run.

    Parameters
    ----------
    run : PreparedRun
        Prepared from the configuration.
    result : Result
        The run to look along, best :func:`hgorun.analysis.linear.nominal.nominal`; it must have this observer.

    Raises
    ------
    NoValue
        Where the observer has no slopes, or no flow, along this run.
    """
    observer = run.experiment.observers[label]
    if isinstance(observer, SlidingMode | SampledObserver | CorrectedObserver):
        raise NoValue(why_no_flow(observer))
    if next(b for b in run.observers if b.label == label).recalled:
        raise NoValue(RECALLS)
    if label not in result.observers:
        raise NoValue("the nominal run does not have this observer")
    found = result.observers[label]
    third = result.time[0] + (result.time[-1] - result.time[0]) / 3
    chosen = np.flatnonzero(result.time >= third - 1e-9 * (result.time[-1] - result.time[0]))
    chosen = chosen[:: max(chosen.size // _MAX_TIMES, 1)]
    if found.lost:
        raise NoValue(f"in the nominal run, {why_lost(found)}")
    linearisation = Linearisation(run, label)
    times = result.time[chosen]
    xi = _states(linearisation, found, chosen, times)
    linear = linearisation.systems(times, xi)
    A0, E, H, L, K0, K = linear.A0, linear.E, linear.H, linear.L, linear.K0, linear.K
    kept = _that_matter(linearisation, A0, H, L, K0)
    unit = printable(run.experiment.blocks.time.unit)
    where = f"along the run from t = {run.origin + times[0]:.4g} to {run.origin + times[-1]:.4g} {unit}".rstrip()
    system = ErrorSystem(times, A0[:, kept][:, :, kept], E[:, kept], H[:, :, kept], K0[:, :, kept], K, where)
    if not np.all(np.isfinite(system.G)) or not np.all(np.isfinite(system.H)):
        raise NoValue("the observer's equations have no finite slopes along the run")
    return _constant(system, run.origin)


def at_end(run: PreparedRun, label: str, result: Result) -> ErrorSystem:
    """The error's linear system at the last point of a run; NoValue as for :func:`error_system`."""
    where = f"at the point of t = {run.origin + result.time[-1]:.4g}"
    return replace(error_system(run, label, last_points(result, 1)), where=where)


def last_points(result: Result, count: int) -> Result:
    """The observers of a run at its last output points, as far as linearisations ask for them."""
    observers = {name: _last(found, count) for name, found in result.observers.items()}
    return replace(result, time=result.time[-count:], observers=observers)


def _last(found: ObserverResult, count: int) -> ObserverResult:
    internal = {name: np.asarray(value)[-count:] for name, value in found.internal.items()}
    return replace(found, xhat=found.xhat[-count:], internal=internal)


def _states(linearisation: Linearisation, found: ObserverResult, chosen: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The observer's states at points of a run, shape (M, N), filters empty.

    A state that rests elsewhere than at zero is no filter, whatever its role: it is what it is along the run.
    """
    b = linearisation.block
    xi = linearisation.states(found, chosen)
    roles = b.observer.roles(b.form)
    filters = {name: place for name, place in b.states.items() if roles.get(name) == "filter" and place.size}
    if not filters:
        return xi
    kept = _not_filters(linearisation, filters, times, xi)
    for name, place in filters.items():
        if name not in kept:
            xi[:, place.start - b.start :][:, : place.size] = 0.0
    return xi


def _not_filters(
    linearisation: Linearisation, filters: Mapping[str, StateBlock], times: np.ndarray, xi: np.ndarray
) -> set[str]:
    """Of filters those that are none, as the first, the middle and the last point tell."""
    run, b = linearisation.run, linearisation.block
    rates, starts = filter_rates(run, b, filters), b.observer.states(b.form)
    z = np.zeros(run.structure.system.states)
    found: set[str] = set()
    for i in sorted({0, times.size // 2, times.size - 1}):
        z[b.start : b.stop] = xi[i]
        found.update(not_at_zero(filters, starts, z, partial(values_of, rates, float(times[i]), run.numbers.p)))
    return found


def _that_matter(
    linearisation: Linearisation, A0: np.ndarray, H: np.ndarray, L: np.ndarray, K0: np.ndarray
) -> np.ndarray:
    """The states through which an error comes back: not gains, whose deviations act on an error of zero."""
    b = linearisation.block
    places = {
        name: np.arange(s.start, s.start + s.size) - b.start
        for name, s in b.states.items()
        if name != "alpha" and s.size
    }
    size = float(np.max(np.abs(A0[np.isfinite(A0)]), initial=1e-300))
    seen = np.any(np.abs(np.concatenate([H, L, K0], axis=1)) > 0, axis=(0, 1))
    kept = {name for name, at in places.items() if seen[at].any()}
    growing = True
    while growing:
        rows = np.concatenate([places[name] for name in places if name in kept])
        new = {
            name
            for name, at in places.items()
            if name not in kept and np.any(np.abs(A0[:, rows][:, :, at]) > _NOTHING * size)
        }
        kept |= new
        growing = bool(new)
    return np.concatenate([at for name, at in places.items() if name in kept])


def _constant(system: ErrorSystem, origin: float) -> ErrorSystem:
    """One system, where they do not differ, or no longer do in the last tenth of the time."""
    for tail in (0, -max(system.times.size // 10, 2)):
        if all(_still(part[tail:]) for part in (system.G, system.H)):
            last = {name: getattr(system, name)[-1:] for name in ("A0", "E", "H", "K0", "K")}
            where = system.where if tail == 0 else f"at rest, at t = {origin + system.times[-1]:.4g}"
            return replace(system, times=system.times[-1:], where=where, **last)
    return system


def _still(matrices: np.ndarray) -> bool:
    size = np.max(np.abs(matrices), axis=0)
    return bool(np.all(np.ptp(matrices, axis=0) <= _SAME * size + _NOTHING * size.max()))
