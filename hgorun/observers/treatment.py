"""What observers do with samples that come late."""

from __future__ import annotations

from typing import Literal

from hgorun.observers.base import AnyObserver, CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import Punctual
from hgorun.observers.recalling import RecallingObserver
from hgorun.observers.stepped import SteppedObserver


def treatment_of(observer: AnyObserver) -> Literal["innovation", "received", "replay", "drop"]:
    """What an observer does with samples that come late; ``received``: it crosses the delay itself."""
    if isinstance(observer, RecallingObserver):
        return "received"
    if observer.late is not None:
        return observer.late
    return "replay" if isinstance(observer, CorrectedObserver) else "innovation"


def late_to(observer: AnyObserver) -> bool:
    """Whether samples that come late are late to it, which neither leaves them out nor flows again from their time."""
    treatment = treatment_of(observer)
    return treatment != "drop" and (treatment != "replay" or isinstance(observer, SteppedObserver))


def why_punctual(observer: AnyObserver, late: str, *, sampled: bool) -> str | None:
    """What is said where outputs are late, as ``late`` tells, of an observer that takes them without delay only."""
    if not isinstance(observer, Punctual):
        return None
    message = f"{observer.type} takes outputs without delay, but {late}: {observer.because}"
    if isinstance(observer, SampledObserver) or not sampled:
        return message
    if isinstance(observer, SteppedObserver):
        return f"{message}. It can leave late samples out (late: drop)"
    return f"{message}. It can go back to late samples (late: replay) or leave them out (late: drop)"
