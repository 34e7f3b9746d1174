"""What the theory says of an observer on the page: its bounds along time, and some numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from hgorun.analysis.convergence.premises import premises_of
from hgorun.analysis.convergence.segments import compile_slopes
from hgorun.analysis.convergence.theorem import transient_of
from hgorun.analysis.finding import FINDINGS, Finding, Remarked
from hgorun.analysis.reasons import NoValue, outcome, outcomes
from hgorun.analysis.subject import Subject
from hgorun.result.records.theory import Transient

AT_ONCE = ("beta", "chi", "theta_bound", "delay_max", "delay_bound", "eta_theta")
"""Findings that take no longer than the bounds along time, from which they follow."""
LATER = ("delay_critical", "period_critical", "noise_rms_predicted")
"""Those that take up to half a second each: limits of the linear error, and the noise of the estimates."""


@dataclass(frozen=True)
class Promise:
    """What is said of an observer.

    Attributes
    ----------
    transient : Transient or None
        Bounds along time, where there is a theorem.
    numbers : mapping of str to str to float
        By finding and by state; the state is empty where a finding is one number.
    reasons : mapping of str to str
        Why a finding has no number.
    reason : str
        Why there are no bounds along time; empty where there are some.
    """

    transient: Transient | None = None
    numbers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    reasons: Mapping[str, str] = field(default_factory=dict)
    reason: str = ""

    def with_more(self, other: Promise) -> Promise:
        """The same with another's findings."""
        return replace(self, numbers={**self.numbers, **other.numbers}, reasons={**self.reasons, **other.reasons})


def promise_of(subject: Subject) -> Promise:
    """Bounds along time and the findings that follow from them."""
    bounded = outcome(lambda: transient_of(subject))
    numbers, reasons = numbers_of(subject, AT_ONCE)
    return Promise(bounded.found, numbers, reasons, bounded.reason or "")


def compile_theory(subject: Subject) -> bool:
    """Compile what takes the theory of an observer most of its time; False: it is compiled, or has no theory."""
    premises = outcome(lambda: premises_of(subject)).found
    return premises is not None and compile_slopes(premises.chart)


def numbers_of(subject: Subject, names: Sequence[str]) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Findings by name and state, and why others have no number."""
    return outcomes(_asked(subject, names), lambda name: _numbers(FINDINGS.find(name), subject))


def titles(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """What a finding is called, and its unit in the units of time and state."""
    return {name: (FINDINGS.find(name).title or name, FINDINGS.find(name).unit) for name in names}


def _asked(subject: Subject, names: Sequence[str]) -> list[str]:
    return [name for name in names if FINDINGS.find(name).applies(subject)]


def _numbers(finding: Finding, subject: Subject) -> dict[str, float]:
    found = finding(subject)
    value = found.value if isinstance(found, Remarked) else found
    if isinstance(value, Mapping):
        return {state: float(number) for state, number in value.items()}
    if isinstance(value, (int, float)):
        return {"": float(value)}
    raise NoValue("it is not a number")
