"""Why a piece of theory gives no number: the one exception, the one place that catches it, and shared reasons.

Whatever is asked of the theory returns its value or raises :class:`NoValue`, whose message is the reason, with
the numbers that decide. Nobody but this module catches it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from hgorun.errors import HgorunError, SimulationError
from hgorun.observers.base import AnyObserver, SampledObserver
from hgorun.observers.capabilities import NotLinear, SlidingMode
from hgorun.observers.treatment import treatment_of
from hgorun.result.records.observer import ObserverResult
from hgorun.simulation.prepared import PreparedRun

T = TypeVar("T")
K = TypeVar("K")

JUMPS = "the observer jumps at the samples: there is no flow between them"
NO_SLOPES = "the observer's equations have no derivative along the run"
CORRECTED = "the observer is corrected by samples alone: no flow between them is driven by the innovation"
RECALLS = "the observer looks back at its own past, so its linear error is not a matrix"
SLIDING = "the right-hand side has no slope where the observer's error is zero"
NEEDS_HOLD = "random noise of a continuous output needs hold"


class NoValue(HgorunError):
    """There is no such number for this observer, plant or run; the message says why."""


@dataclass(frozen=True)
class Outcome(Generic[T]):
    """What was found, or why there is nothing.

    Attributes
    ----------
    found : T or None
    reason : str or None
        None where there is a value.
    """

    found: T | None
    reason: str | None = None

    @property
    def value(self) -> T:
        """What was found.

        Raises
        ------
        NoValue
        """
        if self.reason is not None:
            raise NoValue(self.reason)
        return self.found  # type: ignore[return-value]  # None only beside a reason, or where T has it


def why_lost(observer: ObserverResult) -> str:
    """Why an estimate that is lost has no numbers."""
    return f"the observer {observer.status}" if observer.status == "diverged" else "the estimate is not a number"


def require_estimate(observer: ObserverResult) -> None:
    """Raise NoValue where the estimate is lost."""
    if observer.lost:
        raise NoValue(why_lost(observer))


def outcome(function: Callable[[], T]) -> Outcome[T]:
    """Call a function; a run without a result and a singular matrix are reasons, too."""
    try:
        return Outcome(function())
    except (NoValue, SimulationError, np.linalg.LinAlgError) as reason:
        return Outcome(None, str(reason))


def outcomes(keys: Iterable[K], function: Callable[[K], T]) -> tuple[dict[K, T], dict[K, str]]:
    """What a function finds for some keys, and for the others why it finds nothing."""
    every = {key: outcome(lambda key=key: function(key)) for key in keys}  # type: ignore[misc]  # key is bound early
    reasons = {key: one.reason for key, one in every.items() if one.reason is not None}
    return {key: one.value for key, one in every.items() if key not in reasons}, reasons


def first_of(*functions: Callable[[], T]) -> T:
    """The first value that there is.

    Raises
    ------
    NoValue
        With the last reason, when there is none.
    """
    *others, last = functions
    for function in others:
        one = outcome(function)
        if one.reason is None:
            return one.value
    return last()


def require_innovation(run: PreparedRun, label: str, *, even_if_none_are_late: bool = False) -> None:
    """Late samples must enter the common innovation, which linear theory with a delay is about.

    Parameters
    ----------
    run : PreparedRun
    label : str
        Of the observer.
    even_if_none_are_late : bool
        Whether also in a run without late samples, for what is said of other delays than that of the run.

    Raises
    ------
    NoValue
    """
    treatment = treatment_of(run.experiment.observers[label])
    if treatment not in run.treatments and not (even_if_none_are_late and treatment in ("replay", "drop")):
        return
    if treatment == "received":
        raise NoValue(RECALLS)
    raise NoValue(f"late samples do not enter the innovation (late: {treatment}), which theory reckons with")


def why_no_flow(observer: AnyObserver) -> str:
    """Why an observer that samples correct has no linear flow: what it says itself, where it says something."""
    if isinstance(observer, SlidingMode):
        return SLIDING
    own = observer.not_linear if isinstance(observer, NotLinear) else None
    if own is not None:
        return own
    return JUMPS if isinstance(observer, SampledObserver) else CORRECTED


def no_spectrum(*kinds: str) -> str:
    """Why kinds of noise cannot be predicted."""
    return f"noise of type {' and '.join(kinds)} has no spectrum that is known"
