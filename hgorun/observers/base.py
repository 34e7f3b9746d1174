"""What an observer is: states, numbers designed from its gains, and equations.

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
from typing import Any, ClassVar, Generic, Self, TypeAlias, TypeGuard

import casadi as ca
import numpy as np
from typing_extensions import TypeVar

from hgorun.observers.equations import Arrival, Flow, PeriodLimit, Role, Sample, SampleSchedule
from hgorun.observers.keys import Keys
from hgorun.registry import Registry
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.forms import Copy, Form, FormFinder
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.states import Symmetric
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

# The class of plants that an observer is for, and the copy of the plant that this class gives it.
FormT = TypeVar("FormT", bound=Form, default=CanonicalForm)
CopyT = TypeVar("CopyT", bound=Copy, default=PlantCopy)


class Observer(Keys, Generic[FormT, CopyT]):
    """Base of all observers; :class:`~hgorun.observers.keys.Keys` are those that every observer block has.

    Derive from :class:`ContinuousObserver`, :class:`SampledObserver`, :class:`HybridObserver` or
    :class:`CorrectedObserver`. The type parameters are the class of plants that the observer is for and the copy
    of the plant that its equations get; left out, they are those of
    :func:`~hgorun.symbolic.observability.canonical_form`.
    """

    kind: ClassVar[str] = "observer"
    reference: ClassVar[str] = ""
    # {key: its source}, of what an observer does only where its block has the key
    key_references: ClassVar[Mapping[str, str]] = {}
    # {key: why it has none}, of keys that observers like it have
    lacks: ClassVar[Mapping[str, str]] = {
        "extend": "it takes the plant neither as chains nor block by block, so that no unknown input can stand behind "
        "them: give the plant a state for it, or take extended",
    }
    # the class of plants: a function that gives a plant's form, and refuses other plants
    form: ClassVar[FormFinder] = canonical_form

    # Parameters are types of methods, which only type checkers ask for, and not of keys. Pydantic would derive a
    # class with all keys for each combination, and build what checks them: a tenth of a short run.
    def __class_getitem__(cls, parameters: object) -> type[Self]:
        return cls

    @abstractmethod
    def design(self, form: FormT) -> Mapping[str, np.ndarray]:
        """The numbers that the equations use, from the gains of the block: ``k`` of the equations.

        Raises
        ------
        Problem
            When the gains do not fit the plant; its path starts at the key of this block.
        """

    def states(self, form: FormT) -> Mapping[str, np.ndarray | Symmetric]:
        """Internal states other than xhat: their names, shapes and default initial values; none by default."""
        return {}

    def roles(self, form: FormT) -> Mapping[str, Role]:
        """What each internal state is, for the theory.

        ``filter``
            It passes the innovation on, and is zero while the estimate is right.
        ``gain``
            The correction is multiplied by it: it follows the plant, and small errors do not move it.
        ``signal``
            It estimates something of the plant beside the state, such as derivatives of the output.

        By default symmetric matrices are gains, and all other states are filters: of a gain that is a number or a
        vector its class has to say so.
        """
        return {name: "gain" if isinstance(value, Symmetric) else "filter" for name, value in self.states(form).items()}

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        """The estimate in the observer's coordinates, shape (n,); by default its state xhat."""
        return s.xhat

    def start(self, xhat: np.ndarray, k: Mapping[str, np.ndarray]) -> np.ndarray:
        """The state xhat (..., n) from which :meth:`estimate` gives these estimates (..., n); by default themselves.

        Parameters
        ----------
        k : mapping of str to ndarray
            The numbers of :meth:`design`.
        """
        return xhat

    def fastest_rate(self, form: FormT) -> float:
        """The largest modulus of the error dynamics' eigenvalues (1/time), for ``step: auto``; 0: unknown."""
        return 0.0

    def error_rate(self, form: FormT) -> float:
        """The rate at which the error itself moves, where gains move faster (1/time); 0: unknown."""
        return self.fastest_rate(form)

    def unestimated(self, form: FormT) -> tuple[str, ...]:
        """States of the plant of which it says nothing; its numbers for them are those that it started from."""
        return ()

    def remarks(self, form: FormT) -> tuple[str, ...]:
        """What should be known of it on this plant although nothing is wrong with its keys."""
        return ()

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        """Keys of a block that works, for a family whose keys have no defaults.

        Parameters
        ----------
        states : tuple of str
            Names of the plant's states.
        """
        return {}


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
