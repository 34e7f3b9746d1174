"""What observers do with samples that come late."""

from __future__ import annotations

from typing import Literal

from hgorun.observers.base import AnyObserver, CorrectedObserver
from hgorun.observers.recalling import RecallingObserver


def treatment_of(observer: AnyObserver) -> Literal["innovation", "received", "replay", "drop"]:
    """What an observer does with samples that come late; ``received``: it crosses the delay itself."""
    if isinstance(observer, RecallingObserver):
        return "received"
    if observer.late is not None:
        return observer.late
    return "replay" if isinstance(observer, CorrectedObserver) else "innovation"
