"""Estimates that are carried out piece by piece."""

from __future__ import annotations

from hgorun.engine.again import Again
from hgorun.engine.careful_session import CarefulSession
from hgorun.engine.plan import Plan
from hgorun.engine.session import Session
from hgorun.estimate.prepared import PreparedEstimate


def session_of(prepared: PreparedEstimate, plan: Plan, again: Again | None) -> Session:
    """A run of a whole plan.

    Parameters
    ----------
    again : Again or None
        A flow that loses an observer is made again for it.
    """
    program, start, late = prepared.program(), prepared.start(), prepared.late
    if again is None:
        return Session(program, plan, start, late=late)
    return CarefulSession(program, plan, start, again, late=late)
