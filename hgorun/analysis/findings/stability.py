"""How rarely and how late the outputs may be measured: exact limits of the linear error."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.linear.error_system import ErrorSystem, error_system
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.reasons import NoValue, first_of, outcome, require_innovation
from hgorun.analysis.stability.critical import (
    Limit,
    Timing,
    chain_system,
    critical_delay,
    critical_period,
    declared_limit,
    timing_of,
)
from hgorun.analysis.stability.orbit import on_orbit
from hgorun.analysis.subject import Context, Subject, once
from hgorun.errors import printable
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.recalling import RecallingObserver
from hgorun.result.result import Result

_UNDELAYED = "the observer takes samples without delay"


@once
def _nominal(context: Context) -> Result:
    return nominal(context.run)


def _nominal_of(observer: Subject) -> Result:
    """The nominal run of all observers; one that cannot be carried out takes nothing from the others."""
    together = partial(_nominal, observer.context)
    return first_of(together, partial(nominal, observer.run, observer.label))


@once
def _along_run(observer: Subject) -> ErrorSystem:
    found = error_system(observer.run, observer.label, _nominal_of(observer))
    return on_orbit(found, printable(observer.run.experiment.blocks.time.unit))


def of_this_run(observer: Subject) -> bool:
    """Whether limits are about the growth over a run that neither rests nor comes round: a longer one has others."""
    system = outcome(lambda: _along_run(observer)).found
    return system is not None and not system.constant and system.cycle is None


@once
def on_chain(observer: Subject) -> ErrorSystem:
    """The error on chains of integrators, found once; NoValue where there is none."""
    return chain_system(observer.run, observer.label)


def _limit(
    observer: Subject,
    name: str,
    limit: Callable[[Timing, ErrorSystem], Limit],
    system: Callable[[Subject], ErrorSystem],
) -> Remarked:
    # a limit of the delay is about late samples also where the run has none
    of_delays = limit is critical_delay and not isinstance(observer.observer, CorrectedObserver)
    require_innovation(observer.run, observer.label, even_if_none_are_late=of_delays)
    return _remarked(name, limit(timing_of(observer.run), system(observer)))


def _remarked(name: str, limit: Limit) -> Remarked:
    return Remarked(limit.value, (f"{name}: {limit.where}",) if limit.where else ())


@finding(
    "the sampling period at which the linear error loses stability; if the plant changes it, along the orbit that the "
    "noise-free run comes to, or else over the last two thirds of this run, which is no limit of other runs",
    unit="time",
    group="period",
    places=("json", "table", "compare"),
)
def period_critical(observer: Subject) -> Remarked:
    if isinstance(observer.observer, SampledObserver):
        return _remarked("period_critical", declared_limit(observer.observer.longest_period(observer.form)))
    if isinstance(observer.observer, CorrectedObserver):
        known = observer.observer.longest_period(observer.form)
        if known is not None:
            return _remarked("period_critical", declared_limit(known))
    return _limit(observer, "period_critical", critical_period, _along_run)


@finding(
    "the delay at which the linear error loses stability, with the configured sampling; along an orbit or a run like "
    "`period_critical`",
    unit="time",
    group="delay",
    places=("json", "table", "compare"),
)
def delay_critical(observer: Subject) -> Remarked:
    if isinstance(observer.observer, SampledObserver):
        raise NoValue(_UNDELAYED)
    return _limit(observer, "delay_critical", critical_delay, _along_run)


@finding("the exact `period_critical` for chains of integrators", unit="time", group="period")
def period_critical_chain(observer: Subject) -> Remarked:
    if isinstance(observer.observer, SampledObserver):
        raise NoValue("the observer's own limit does not depend on phi")
    return _limit(observer, "period_critical_chain", critical_period, on_chain)


@finding("the exact `delay_critical` for chains of integrators", unit="time", group="delay")
def delay_critical_chain(observer: Subject) -> Remarked:
    if isinstance(observer.observer, SampledObserver):
        raise NoValue(_UNDELAYED)
    if isinstance(observer.observer, RecallingObserver) and observer.block.recalled:
        return _remarked("delay_critical_chain", declared_limit(observer.observer.longest_delay(observer.form)))
    return _limit(observer, "delay_critical_chain", critical_delay, on_chain)
