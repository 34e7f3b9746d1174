"""How rarely an output may be sampled, and how late it may come: exact limits of the linearised error.

With the one innovation for continuous, sampled and late outputs, the error near the truth is a linear hybrid
system; see :mod:`hgorun.analysis.linear.error_system`. It is stable while the spectral radius of its monodromy matrix,
over a period of sampling, is below 1. The published bounds, Robles Magdaleno 2023 (2.78), (3.68), are sufficient and
smaller by factors of hundreds: for three integrators and theta = 1 these limits are 2.896 for the period of
the standard observer and 0.927 for its delay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hgorun.analysis.linear.delay_margin import delay_margin
from hgorun.analysis.linear.error_system import ErrorSystem, at_end
from hgorun.analysis.linear.gain_at_rest import require_rest
from hgorun.analysis.linear.nominal import chain
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.stability.growth import MAX_PERIODS, growth
from hgorun.errors import printable
from hgorun.measurement.availability import Stretch
from hgorun.observers.base import PeriodLimit
from hgorun.simulation.prepared import PreparedRun

_RATIO_CONSTANT, _RATIO_VARYING = 1.04, 1.12  # of neighbouring values in a search for a first crossing
_SHORTEST, _LONGEST = 1e-2, 3e2  # of 1/rate, where the search starts and ends
_PRECISION = 1e-4, 2e-3  # relative, of a limit, for one system and along a trajectory
_MAX_WAITING = 100  # samples on their way at a time
_MOST_CYCLES = 3.0  # of an orbit: the longest time that is tried
_COARSE, _FINE = 4, 16  # samples a delay that stand for a continuous output along a trajectory


@dataclass(frozen=True)
class Limit:
    """A limit of stability in the run's time unit.

    Attributes
    ----------
    value : float
    where : str
        Of which linear system it is the limit, and what was assumed.
    """

    value: float
    where: str = ""


@dataclass(frozen=True)
class Timing:
    """What the measurement does at the end of a run.

    Attributes
    ----------
    period : float or None
        None: continuous.
    delay : float
    phase, regular, uneven, late : str
        What was assumed, empty where it is what the run has: the last of several phases, samples as regular as they
        are meant, a period for uneven ones, a constant delay for one that changes.
    """

    period: float | None
    delay: float
    phase: str = ""
    regular: str = ""
    uneven: str = ""
    late: str = ""
    unit: str = ""

    def told(self, time: float, digits: int = 3) -> str:
        """A time with its unit."""
        return f"{time:.{digits}g} {self.unit}".rstrip()


def chain_system(run: PreparedRun, label: str) -> ErrorSystem:
    """The error on chains of integrators, phi = 0, gains at rest: its limits are exact.

    Raises
    ------
    NoValue
        For observers and plants without such chains, and gains that do not come to rest.
    """
    alone, result = chain(run, label)
    require_rest(alone, label, result)
    return replace(at_end(alone, label, result), where="chains of integrators, phi = 0")


def timing_of(run: PreparedRun) -> Timing:
    """Period and delay of the outputs.

    Of several phases the last. A delay that changes counts with its largest value, samples at uneven times
    with the longest time between two.

    Raises
    ------
    NoValue
        When there is no one period and delay.
    """
    last = [stretches[-1] for stretches in run.experiment.stretches]
    described = [_describe(run, i, stretch) for i, stretch in enumerate(last)]
    if any(d.period != described[0].period or d.delay != described[0].delay for d in described[1:]):
        raise NoValue("the outputs differ in their sampling or delay")
    if len(run.experiment.stretches[0]) > 1:
        return replace(described[0], phase="the last phase")
    return described[0]


def _describe(run: PreparedRun, i: int, stretch: Stretch) -> Timing:
    regular = uneven = ""
    if stretch.continuous:
        period, times = None, np.linspace(stretch.start, stretch.end, 2001)
    else:
        samples = run.channels[i].samples
        times = samples.arrival[samples.arrival >= stretch.start]
        period = stretch.period
        if period is None:
            period = float(np.max(np.diff(times), initial=0.0)) or None
            uneven = "the longest time between two samples taken for the period"
        elif stretch.regular is None:
            regular = "without jitter and dropout"
    delay = float(np.max(stretch.delay_at(times), initial=0.0)) if times.size else 0.0
    unit = printable(run.experiment.blocks.time.unit)
    found = Timing(period, delay, regular=regular, uneven=uneven, unit=unit)
    if stretch.delay_is_constant:
        return found
    return replace(found, late=f"with the longest delay, {found.told(delay, 4)}, throughout")


def critical_period(timing: Timing, system: ErrorSystem) -> Limit:
    """The shortest period of sampling at which the error no longer decays, at this theta and delay.

    Where the linear system changes along a run, that of the growth over the last two thirds of it: the spectral
    radius of the product of all monodromy matrices.

    Parameters
    ----------
    timing : Timing
        What :func:`timing_of` says of the run.
    system : ErrorSystem
        Best along a run of :func:`hgorun.analysis.linear.nominal.nominal`, or :func:`chain_system`.

    Raises
    ------
    NoValue
        When it is stable, or unstable, at every period, or does not move at all.
    """
    _must_move(system)
    delay = timing.delay
    where = _told(system.where, timing.phase if delay else "", timing.regular, timing.late)
    shortest = max(_SHORTEST / system.rate, delay / _MAX_WAITING)
    longest = _LONGEST / system.rate
    if not system.constant:
        shortest = max(shortest, 0.2 / system.rate, _span(system) / MAX_PERIODS)
        longest = min(longest, _longest(system))
    if shortest > longest:
        raise NoValue(
            f"the delay of {timing.told(delay, 4)} needs periods beyond the longest that is tried, "
            f"{timing.told(longest)}"
        )
    if timing.period is not None and growth(system, shortest, delay) >= 0:  # down to the one in use, if it can be tried
        shortest = max(min(shortest, timing.period), delay / _MAX_WAITING)
        shortest = max(shortest, 0.0 if system.constant else _span(system) / MAX_PERIODS)
    sought = _Sought("period", timing, shortest, longest, where)
    return _search(sought, system, lambda T: growth(system, T, delay))


def critical_delay(timing: Timing, system: ErrorSystem) -> Limit:
    """The smallest constant delay at which the error no longer decays, at this theta and sampling.

    Parameters and errors as for :func:`critical_period`.
    """
    _must_move(system)
    period = timing.period
    where = _told(system.where, timing.phase if period else "", timing.regular, timing.uneven)
    if period is None and system.constant:
        return Limit(delay_margin(system.A0[0], system.E[0], system.H[0], system.K0[0], system.K[0]), where)
    shortest, longest = _SHORTEST / system.rate, _LONGEST / system.rate
    if not system.constant:
        shortest = max(0.2 / system.rate, _FINE * _span(system) / MAX_PERIODS if period is None else 0.0)
        longest = min(longest, _longest(system))
    if period is None:
        where += f"; {_FINE} samples a delay stand for the continuous output"
        # held samples d/n apart that are d - d/(2 n) old on arrival are d old in the mean
        coarse, fine = (lambda d, n=n: growth(system, d / n, d - d / (2 * n)) for n in (_COARSE, _FINE))
        return _search(_Sought("delay", timing, shortest, longest, where), system, coarse, fine)
    if growth(system, period, 0.0) >= 0:
        raise NoValue(f"unstable at the period {timing.told(period, 4)} even without delay")
    longest = min(longest, _MAX_WAITING * period)
    sought = _Sought("delay", timing, shortest, longest, where)
    return _search(sought, system, lambda d: growth(system, period, d))


def critical_together(timing: Timing, system: ErrorSystem, *, shrinks: bool = False) -> Limit:
    """The shortest period at which the error no longer decays, of samples with a delay in proportion to their period.

    Of chains of integrators that is what a larger theta comes to: times count in units of 1/theta.

    Parameters and errors as for :func:`critical_period`; the timing has a period, and the system is constant.
    ``shrinks``: the innovation shrinks between samples, with a rate that does not grow with theta: in units of 1/theta
    it is the smaller, the larger theta is.
    """
    assert timing.period is not None
    _must_move(system)
    waiting = timing.delay / timing.period
    shortest, longest = _SHORTEST / system.rate / max(1.0, waiting), _LONGEST / system.rate
    sought = _Sought("period", timing, shortest, longest, system.where)
    now = timing.period

    def rate(period: float) -> float:
        scaled = replace(system, K=system.K * (now / period)) if shrinks else system
        return growth(scaled, period, waiting * period)

    return _search(sought, system, rate)


def _span(system: ErrorSystem) -> float:
    """How long the systems are known, or two cycles of an orbit."""
    return float(system.times[-1] - system.times[0]) if system.cycle is None else 2 * system.cycle


def _longest(system: ErrorSystem) -> float:
    """The longest time that is tried: a few must fit in a run; along an orbit, only steps between them become many."""
    return _span(system) / 4 if system.cycle is None else _MOST_CYCLES * system.cycle


def _told(*remarks: str) -> str:
    return "; ".join(remark for remark in remarks if remark)


def _must_move(system: ErrorSystem) -> None:
    """The rate is what the times of a search are measured in."""
    if system.rate == 0:
        raise NoValue("the linearised error does not move: no eigenvalue differs from zero")


@dataclass(frozen=True)
class _Sought:
    """A limit that is sought.

    Attributes
    ----------
    what : str
        ``period`` or ``delay``.
    timing : Timing
    shortest, longest : float
        Between which times.
    where : str
        Of what system it is the limit, in words.
    """

    what: str
    timing: Timing
    shortest: float
    longest: float
    where: str

    @property
    def used(self) -> float | None:
        """The time in use."""
        return self.timing.period if self.what == "period" else self.timing.delay

    def always_stable(self, up_to: float) -> NoValue:
        """That there is no limit up to a time."""
        return NoValue(f"stable at every {self.what} up to {self.timing.told(up_to)}")


def _search(
    sought: _Sought,
    system: ErrorSystem,
    rate: Callable[[float], float],
    fine: Callable[[float], float] | None = None,
) -> Limit:
    """The first zero of a growth rate: geometric steps, then bisection of what is dearer and better."""
    ratio = _RATIO_CONSTANT if system.constant else _RATIO_VARYING
    precision = _PRECISION[0 if system.constant else 1]
    shortest, longest = sought.shortest, sought.longest
    low = shortest
    if rate(low) >= 0:
        used, told = sought.used, sought.timing.told
        shorter = used is not None and 0 < used < low * (1 - 1e-9)
        untold = f"; the one in use, {told(used, 4)}, is shorter, and is not tried" if used and shorter else ""
        raise NoValue(f"unstable already at the shortest {sought.what} that is tried, {told(low)}{untold}")
    high = low * ratio
    while rate(high) < 0:
        low, high = high, high * ratio
        if low > longest:
            raise sought.always_stable(low)
    rate = fine or rate
    while low > shortest and rate(low) >= 0:
        low, high = low / ratio, low
    while rate(high) < 0:
        low, high = high, high * ratio
        if low > longest:
            raise sought.always_stable(low)
    while high - low > precision * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rate(middle) < 0 else (low, middle)
    return Limit(0.5 * (low + high), sought.where)


def declared_limit(declared: PeriodLimit) -> Limit:
    """The limit that an observer declares itself.

    Raises
    ------
    NoValue
        Where there is none.
    """
    value, where = declared
    if value is None:
        raise NoValue(where)
    return Limit(value, where)
