"""What an observer is: what all have in common, and equations.

An observer's file holds its equations and its gain design and nothing else. The class is also the
model of its YAML block: each field is a key, with its admissible range.

What an observer does is the base class that it derives from:

- :class:`ContinuousObserver`: differential equations, between samples driven by the one innovation;
- :class:`SampledObserver`: difference equations, it jumps at the samples and holds in between;
- :class:`HybridObserver`: both, a flow between the samples and a jump at each;
- :class:`CorrectedObserver`: a flow, and a correction at each arrival, whichever outputs it brings;
- :class:`DecidedObserver`: a flow driven by the innovation, and decisions at the ends of steps.

What else theory may ask of it is in :mod:`hgorun.observers.capabilities`. What equations get and give, such as
:class:`Flow`, is imported from here, too.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from inspect import isabstract
from typing import Any, TypeAlias, TypeGuard

import casadi as ca
import numpy as np

from hgorun.observers.common import CopyT, FormT, Observer
from hgorun.observers.equations import Arrival, Flow, PeriodLimit, Role, Sample, SampleSchedule
from hgorun.registry import Registry
from hgorun.symbolic.symbols import Symbols

__all__ = [
    "OBSERVERS",
    "AnyObserver",
    "Arrival",
    "ContinuousObserver",
    "CorrectedObserver",
    "Flow",
    "HybridObserver",
    "Observer",
    "PeriodLimit",
    "Role",
    "Sample",
    "SampleSchedule",
    "SampledObserver",
    "is_observer",
    "observer",
]


class ContinuousObserver(Observer[FormT, CopyT]):
    """Base of the observers that are differential equations."""

    @abstractmethod
    def equations(self, plant: CopyT, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        """The flow.

        Parameters
        ----------
        plant : the form's copy of the plant
            In the coordinates where the observer computes.
        s : Symbols
            ``s.xhat`` and the states declared by :meth:`states`, same shapes.
        e : casadi.SX, shape (q,)
            The innovation C xhat(t-d) - y_d(t) + alpha(t) - alpha(t-d); C xhat - y when the output is
            continuous and not late.
        k : Symbols
            The numbers of :meth:`design`, as run-time arguments of the compiled code.
        """


class SampledObserver(Observer[FormT, CopyT]):
    """Base of the observers that are difference equations at the samples, from the second one on.

    Every output must be sampled, all at the same times and without delay.
    """

    @abstractmethod
    def jump(self, plant: CopyT, before: CopyT, s: Symbols, sample: Sample, k: Symbols) -> Mapping[str, ca.SX]:
        """What the states become when a sample arrives; those left out stay.

        Parameters
        ----------
        plant, before : the form's copies of the plant
            With the inputs at this sample and at the one before.
        s : Symbols
            The states since the sample before.
        sample : Sample
        k : Symbols
            The numbers of :meth:`~Observer.design`.
        """

    @property
    def asks_of_gaps(self) -> bool:
        """Whether it may refuse the times between samples, each for itself."""
        return False

    @property
    def asks_of_numbers(self) -> bool:
        """Whether that depends on the number of the sample, beside the length of the gap: no longer one is refused."""
        return False

    def check_samples(self, form: FormT, samples: SampleSchedule) -> None:
        """Refuse a schedule that the observer's theorem excludes.

        Raises
        ------
        Problem
            With a path inside this block, or starting at ``measurement``.
        """

    def longest_period(self, form: FormT) -> PeriodLimit:
        """The longest constant period at which the error of the plant's Euler model decays."""
        return PeriodLimit(None, "the observer declares no limit")


class HybridObserver(ContinuousObserver[FormT, CopyT], SampledObserver[FormT, CopyT]):
    """Base of the observers that follow a flow between the samples and jump at each of them.

    ``e`` of :meth:`~ContinuousObserver.equations` is the innovation as continuous observers get it; an
    observer that corrects at the samples alone leaves it out. As for :class:`SampledObserver`, every output
    must be sampled, all at the same times and without delay.
    """


class CorrectedObserver(ContinuousObserver[FormT, CopyT]):
    """Base of the observers that follow a flow and are corrected whenever samples arrive.

    Every output must be sampled; at which times, and of which outputs samples are missing, does not matter. The flow
    leaves the innovation out.
    """

    @abstractmethod
    def correct(self, plant: CopyT, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        """What the states become when samples arrive; those left out stay.

        Parameters
        ----------
        plant : the form's copy of the plant
            With the inputs at this time.
        s : Symbols
            The states before.
        arrival : Arrival
        k : Symbols
            The numbers of :meth:`~Observer.design`.
        """

    def check_times(self, form: FormT, times: Mapping[str, np.ndarray], origin: float) -> None:
        """Refuse times that the observer's gain is not for.

        A stream tells the newest sample with the one before it, of each output, as often as one comes.

        Parameters
        ----------
        form : Form
        times : mapping of str to ndarray
            When the samples of every output that it takes in have been taken, ascending.
        origin : float
            From which these are counted, on the clock of the configuration.

        Raises
        ------
        Problem
            With a path inside this block.
        """

    def whole_periods(self, form: FormT) -> float | None:
        """The period of which samples have to be whole multiples apart; None where their times do not matter."""
        return None

    @property
    def asks_of_times(self) -> bool:
        """Whether it may refuse times: a stream asks at every sample then."""
        return type(self).check_times is not CorrectedObserver.check_times

    def longest_period(self, form: FormT) -> PeriodLimit | None:
        """The longest constant period at which the error decays; None where nothing is known of it."""
        return None


class DecidedObserver(ContinuousObserver[FormT, CopyT]):
    """Base of the observers that follow a flow and decide something now and then, such as which gain to take.

    Decisions fall at the end of every step of the solver and after every event (a sample that arrives, a phase that
    begins), on the values there. What was decided holds over the next step: in between nothing is decided, so that
    a condition is noticed up to a step late.
    """

    @abstractmethod
    def decide(self, plant: CopyT, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        """What the states become; those left out stay. Deciding again on the result has to change nothing.

        Arguments are those of :meth:`~ContinuousObserver.equations`, at the end of the step or after the event.
        """

    def longest_step(self, form: FormT) -> float:
        """The longest step with which decisions are not too coarse."""
        return float("inf")


# Any observer, where its class of plants does not matter.
AnyObserver: TypeAlias = "Observer[Any, Any]"
AnySampled: TypeAlias = "SampledObserver[Any, Any]"


def is_observer(thing: object) -> TypeGuard[type[AnyObserver]]:
    """Whether it is an observer's class, with nothing left abstract."""
    return (
        isinstance(thing, type) and issubclass(thing, (ContinuousObserver, SampledObserver)) and not isabstract(thing)
    )


OBSERVERS: Registry[type[AnyObserver]] = Registry(
    "observer",
    package="hgorun.observers",
    group="hgorun.observers",
    accepts=is_observer,
    expected="a class derived from ContinuousObserver, SampledObserver or HybridObserver of hgorun.observers.base "
    "that defines its design and equations",
)
observer = OBSERVERS.register
