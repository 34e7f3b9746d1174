"""What can be done with an analysis: limits and margins, which observer, which gain to change; in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hgorun.analysis.excitation.branches import on_another_branch
from hgorun.analysis.findings.stability import of_this_run, on_chain
from hgorun.analysis.reasons import NoValue, outcome
from hgorun.analysis.report import Analysis, Findings
from hgorun.analysis.stability.critical import Timing, critical_together, timing_of
from hgorun.analysis.subject import Subject
from hgorun.observers.base import AnyObserver, CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import FilterOrder, HighGain, Punctual
from hgorun.observers.eso import LinearExtendedStateObserver
from hgorun.observers.hold import Shrinking
from hgorun.observers.kalman import KalmanFilter
from hgorun.simulation.outcome.left_out import uncorrected
from hgorun.tables.layout import number, wrapped
from hgorun.tables.typeset import printable

_NEAR = 2.0  # times what there is: a limit that is nearer leaves little room
_MOST = 0.5  # of the mean square of an error: then noise is most of it
_PROVED = "bounds of a theorem hold for"
_UNPROVED = "no theorem bounds the error of this run: proofs usually ask for 1e2 to 1e6 times more than is needed"
_LINEAR = "; the limits above are those of the linear error"
_LIMITS = "period_critical", "delay_critical"


def advice(analysis: Analysis) -> list[str]:
    """Lines for a terminal: an observer after the other, then all of them side by side."""
    result = analysis.result
    unit = printable(result.units.get("time", ""))
    lines = wrapped(": ".join(part for part in (printable(analysis.name), printable(result.title)) if part))
    if not analysis.observers:
        return [*lines, "", "no observers"]
    try:
        timing = timing_of(analysis.context.run)
    except NoValue:
        timing = None
    for label, found in analysis.observers.items():
        lines += ["", printable(label)]
        for words in _of_observer(analysis, label, found, timing, unit):
            lines += wrapped(words, "  ", then="      ")
    lines.append("")
    for words in (*_compared(analysis), *_proved(analysis.observers)):
        lines += wrapped(words)
    return lines


def _of_observer(analysis: Analysis, label: str, found: Findings, timing: Timing | None, unit: str) -> Iterator[str]:
    """Sentences about one observer."""
    observer = analysis.result.observers[label]
    if observer.status != "ok":
        yield f"its estimate is {observer.verdict.text(unit)}; what follows is of an observer that has not diverged"
    if outputs := uncorrected(analysis.context.run, label):
        yield (
            f"no correction arrives: samples of {', '.join(map(printable, outputs))} are late, and it leaves late ones "
            "out (late: drop), so that its estimate is that of the model alone, whatever its gains are"
        )
        yield f"to change: {_taking_late(analysis.context.subjects[label].observer)}"
        return
    rate = _rate(found)
    if rate is not None:
        decays = f"without nonlinearity its error decays like exp(-{number(rate)} t), t in {unit}" if rate > 0 else ""
        yield decays or "without nonlinearity its error grows: choose poles with negative real parts"
    of_run = _has_limits(found) and of_this_run(analysis.context.subjects[label])
    yield from _limits(found, timing, unit, of_run=of_run)
    yield from _errors(analysis, label, found)
    yield from _change(analysis, label, found, timing)


def _taking_late(observer: AnyObserver) -> str:
    """How samples that are late would correct an observer."""
    if isinstance(observer, SampledObserver | Punctual):
        return "measure without delay, or take an observer that uses late samples, such as shgo"
    return "late: replay" if isinstance(observer, CorrectedObserver) else "late: innovation or late: replay"


def _rate(found: Findings) -> float | None:
    """The decay rate of the slowest pole, at the theta that is configured."""
    poles, theta = found.values.get("poles"), found.values.get("theta")
    if not isinstance(poles, np.ndarray) or not poles.size:
        return None
    return float(-np.max(poles.real)) * (float(theta) if isinstance(theta, (int, float)) else 1.0)


def _limits(found: Findings, timing: Timing | None, unit: str, *, of_run: bool) -> Iterator[str]:
    """How long period and delay may become, beside what they are where there is one of each."""
    why = {found.reasons.get(key) for key in _LIMITS}
    if len(why) == 1 and not _has_limits(found):
        yield f"no limit of the period or the delay is computed, since {why.pop() or 'none is known'}"
        return
    if timing is None:
        for key in _LIMITS:
            yield f"{key.removesuffix('_critical')}: {_limit(found, key, None, unit, of_run=of_run)}"
        return
    but = f"{timing.regular}, " if timing.regular else ""
    period = "no sampling" if timing.period is None else f"period {_time(timing.period, unit)}"
    yield f"{period}: {_limit(found, 'period_critical', timing.period, unit, but, of_run=of_run)}"
    delay = f"delay {_time(timing.delay, unit)}" if timing.delay else "no delay"
    yield f"{delay}: {_limit(found, 'delay_critical', timing.delay, unit, but, of_run=of_run)}"


def _has_limits(found: Findings) -> bool:
    return any(found.values.get(k) is not None for key in _LIMITS for k in (key, f"{key}_chain"))


def _time(value: float, unit: str) -> str:
    return f"{number(value)} {unit}".rstrip()


def _limit(found: Findings, key: str, now: float | None, unit: str, but: str = "", *, of_run: bool) -> str:
    """The limit of a period or a delay.

    ``but``: what of the sampling it leaves out, with a comma; ``of_run``: whether another run has another one.
    """
    limit = found.values.get(key)
    if isinstance(limit, (int, float)):
        at = _time(float(limit), unit)
        there = f"{but}the linear error loses stability at {at}"
        if of_run:
            there = f"{but}over this run, which is neither at rest nor periodic, the linear error grows from {at} on"
        if now and limit > now:
            there += f", {number(limit / now)} times as long"
        said = f"too long: {there}" if now and limit <= now else there
        return f"{said}; over a longer run that may be another" if of_run else said
    chain = found.values.get(f"{key}_chain")
    also = f"; on a chain without nonlinearity up to {_time(chain, unit)}" if isinstance(chain, float) else ""
    return f"{found.reasons.get(key, 'no limit is known')}{also}"


def _errors(analysis: Analysis, label: str, found: Findings) -> Iterator[str]:
    """What noise does to the estimates, and what part of the error that is."""
    noise = found.values.get("noise_rms_measured")
    if not isinstance(noise, Mapping) or not noise or not any(noise.values()):
        return
    shares = _shares(analysis, label, noise)
    cells = [f"{state} {number(float(noise[state]))} ({100 * share:.0f} %)" for state, share in shares.items()]
    if cells:
        yield f"noise in the estimates, rms, and its part of the mean square error: {', '.join(cells)}"


def _shares(analysis: Analysis, label: str, noise: Mapping[str, Any]) -> dict[str, float]:
    """The part of the mean square error that noise is, by state."""
    rmse = analysis.result.metrics()[label].get("rmse", {})
    return {
        state: min(float(noise[state]) ** 2 / value**2, 1.0)
        for state, value in rmse.items()
        if state in noise and np.isfinite(value) and value > 0
    }


def _change(analysis: Analysis, label: str, found: Findings, timing: Timing | None) -> Iterator[str]:
    """Which gain to change, and how far it can go."""
    theta = found.values.get("theta")
    noise = found.values.get("noise_rms_measured")
    subject = analysis.context.subjects[label]
    key = "omega_o" if isinstance(subject.observer, LinearExtendedStateObserver) else "theta"
    if isinstance(subject.observer, KalmanFilter):
        yield "to change: Q against R, larger for a faster estimate, smaller for less noise"
    if not isinstance(theta, (int, float)):
        return
    if on_another_branch(subject):
        yield (
            "to change: its initial estimate, for one nearer to the truth. Between the two J is singular: no gain "
            "brings the estimate across, as what is measured looks the same on both sides"
        )
        return
    if _unstable(found, timing):
        yield f"to change: measure more often and sooner, or a smaller {key}: the error grows as it is"
        return
    if analysis.result.observers[label].lost:
        yield f"to change: a smaller {key}, or an initial estimate nearer to the truth: as it is, the estimate diverges"
        return
    shares = _shares(analysis, label, noise) if isinstance(noise, Mapping) else {}
    follow = isinstance(subject.observer, HighGain) and subject.observer.poles_follow
    room = None if follow else _room(subject, found, timing)
    filtered = "; a larger r may" if isinstance(subject.observer, FilterOrder) else ""
    if shares and min(shares.values()) >= _MOST:
        yield f"to change: most of its error is noise: a smaller {key} lowers it{filtered}"
    elif shares and max(shares.values()) < _MOST and room is not None and room < _NEAR:
        yield f"to change: little of its error is noise, but {key} has little room: measure more often and sooner first"
    elif shares and max(shares.values()) < _MOST:
        yield f"to change: little of its error is noise: a larger {key} lowers what is left"
    else:
        yield f"to change: {key}, larger for a faster decay, smaller for less noise"
    if room is not None:
        yield _bound(key, float(theta), room, "" if timing is None else timing.regular)


def _bound(key: str, theta: float, room: float, regular: str = "") -> str:
    """How far a gain is from what a chain of integrators stands: a bound, and no advice to go there."""
    most, like_this = f"{key} = {number(theta * room)}", "a chain measured like this"
    if regular:
        like_this += f", but {regular},"
    if room < 1:
        return (
            f"limit: {like_this} is stable up to {most} only, less than {number(theta)}: the limits "
            "above are those of this run, and hold near it"
        )
    near = ", which is near" if room < _NEAR else ""
    said = f"limit: {like_this} is stable up to {most}, {number(room)} times the present one{near}"
    return f"{said}; longer gaps lower it" if regular else said


def _unstable(found: Findings, timing: Timing | None) -> bool:
    """Whether the period or the delay is beyond the limit of the linear error."""
    if timing is None:
        return False
    pairs = ((found.values.get("period_critical"), timing.period), (found.values.get("delay_critical"), timing.delay))
    return any(isinstance(limit, (int, float)) and now is not None and limit <= now for limit, now in pairs)


def _room(subject: Subject, found: Findings, timing: Timing | None) -> float | None:
    """How many times theta may grow: of chains, the limit of all times together is in proportion to 1/theta."""
    if timing is None:
        return None
    pairs = ((timing.period, "period_critical_chain"), (timing.delay, "delay_critical_chain"))
    limits = ((now, found.values.get(key)) for now, key in pairs)
    rooms = [limit / now for now, limit in limits if now and isinstance(limit, (int, float))]
    if subject.block.recalled:  # with a larger theta it may take more copies
        return None
    shrinks = isinstance(subject.observer.hold, Shrinking)
    # each of the two limits is that beside the other time, and beside a rate of the hold, as they are
    if rooms and timing.period and (timing.delay or shrinks):
        together = outcome(lambda: critical_together(timing, on_chain(subject), shrinks=shrinks)).found
        return None if together is None else together.value / timing.period
    return min(rooms, default=None)


def _compared(analysis: Analysis) -> Iterator[str]:
    """Which observer is best, by state, where there are several that keep their estimates."""
    metrics = {
        label: of for label, of in analysis.result.metrics().items() if analysis.result.observers[label].status == "ok"
    }
    if len(metrics) < 2:
        return
    for name, words in (("rmse", "least error in the steady window"), ("peak", "lowest peak in the transient window")):
        best = []
        for state in analysis.result.states:
            values = {label: of[name][state] for label, of in metrics.items() if state in of.get(name, {})}
            if len(set(map(number, values.values()))) > 1:
                label = min(values, key=lambda one, own=values: own[one])  # type: ignore[misc]  # the loop's values, now
                best.append(f"{state} {printable(label)} ({number(values[label])})")
        if best:
            yield f"{words}: {', '.join(best)}"


def _proved(observers: Mapping[str, Findings]) -> Iterator[str]:
    """Whose error a theorem bounds."""
    held: Sequence[str] = [label for label, found in observers.items() if found.values.get("peaking_bound")]
    if held:
        yield f"{_PROVED} {', '.join(map(printable, held))}"
    else:
        yield _UNPROVED + (_LINEAR if any(map(_has_limits, observers.values())) else "")
