"""What an observer is: states, numbers designed from its gains, and equations.

An observer's file holds its equations and its gain design and nothing else. The class is also the
model of its YAML block: each field is a key, with its admissible range.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import isabstract
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, TypeGuard

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Block, Interval, Name, Number
from hgorun.registry import Registry
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.states import Symmetric


@dataclass(frozen=True)
class Flow:
    """The right-hand sides of an observer between measurements.

    Attributes
    ----------
    derivatives : mapping of str to casadi.SX
        d/dt of ``xhat`` and of every state that the observer declares.
    correction : casadi.SX, shape (q,)
        c: for each output the term that the equation of its measured state subtracts. The innovation's
        alpha' = -c removes the observer's own correction from the delayed comparison.
    """

    derivatives: Mapping[str, ca.SX]
    correction: ca.SX


@dataclass(frozen=True)
class SampleSchedule:
    """When a discrete-time observer will be called.

    Attributes
    ----------
    intervals : ndarray
        The times between the samples.
    steps : str or None
        The expression of k that gives them, where the configuration has one.
    path : tuple
        Where the sampling stands in the configuration.
    """

    intervals: np.ndarray
    steps: str | None
    path: tuple[str | int, ...]


class Observer(Block):
    """Base of all observers; its fields are the keys that every observer block has."""

    reference: ClassVar[str] = ""
    # the class of plants: a function (plant, at, parameters) -> Form that refuses others
    form: ClassVar[Callable[..., Any]] = staticmethod(canonical_form)

    # a discrete-time observer: it jumps at the samples and holds in between
    discrete: ClassVar[bool] = False

    type: str = Field(description="name of the observer family")
    initial: dict[Name, Number] = Field(
        default_factory=dict, description="initial estimate in the plant's coordinates; omitted states 0"
    )
    internal: dict[Name, Any] = Field(
        default_factory=dict, description="initial internal states: a number stands for that multiple of ones"
    )
    saturation: dict[Name, Interval] = Field(
        default_factory=dict, description="state: [low, high], applied to the arguments of F and phi"
    )
    coordinates: Literal["original", "canonical"] = Field(
        default="original", description="where the observer computes; results are always in the plant's"
    )

    @abstractmethod
    def design(self, form: Any) -> dict[str, np.ndarray]:
        """The numbers that the equations use, from the gains of the block.

        Raises
        ------
        Problem
            When the gains do not fit the plant; its path starts at the key of this block.
        """

    @abstractmethod
    def states(self, form: Any) -> dict[str, np.ndarray | Symmetric]:
        """Internal states other than xhat: their names, shapes and default initial values."""

    @abstractmethod
    def equations(self, plant: Any, s: SimpleNamespace, e: ca.SX, k: SimpleNamespace) -> Flow:
        """The flow.

        Parameters
        ----------
        plant : PlantCopy or another form's copy
            The observer's copy of the plant in the coordinates where it computes.
        s : namespace of casadi.SX
            ``s.xhat`` and the states declared by :meth:`states`, same shapes.
        e : casadi.SX, shape (q,)
            The innovation C xhat(t-d) - y_d(t) + alpha(t) - alpha(t-d); C xhat - y when the output is
            continuous and not late.
        k : namespace of casadi.SX
            The numbers of :meth:`design`, as run-time arguments of the compiled code.
        """

    def jump(
        self, plant: Any, before: Any, s: SimpleNamespace, sample: SimpleNamespace, k: SimpleNamespace
    ) -> Mapping[str, ca.SX]:
        """What the states become when a sample arrives, for discrete-time observers.

        Parameters
        ----------
        plant, before : copies of the plant
            With the inputs at this sample and at the one before.
        s : namespace of casadi.SX
            The states since the sample before.
        sample : namespace
            ``y`` and ``previous``, this sample and the one before, shape (q,); ``interval``, the time
            between them.
        k : namespace of casadi.SX
        """
        raise NotImplementedError

    def check_samples(self, form: Any, samples: SampleSchedule) -> None:
        """Refuse a schedule that the observer's theorem excludes; for discrete-time observers.

        Raises
        ------
        Problem
            With a path inside this block, or starting at ``measurement``.
        """

    def fastest_rate(self, form: Any) -> float:
        """The largest modulus of the error dynamics' eigenvalues (1/time), for ``step: auto``; 0: unknown."""
        return 0.0


class DiscreteObserver(Observer):
    """Base of the observers that are difference equations at the samples, from the second one on.

    Every output must be sampled, all at the same times and without delay.
    """

    discrete: ClassVar[bool] = True

    def equations(self, plant: Any, s: SimpleNamespace, e: ca.SX, k: SimpleNamespace) -> Flow:
        """Nothing moves between samples."""
        still = {name: ca.SX.zeros(*value.shape) for name, value in vars(s).items() if name != "alpha"}
        return Flow(still, ca.SX.zeros(e.shape))

    @abstractmethod
    def jump(
        self, plant: Any, before: Any, s: SimpleNamespace, sample: SimpleNamespace, k: SimpleNamespace
    ) -> Mapping[str, ca.SX]: ...


def is_observer(thing: object) -> TypeGuard[type[Observer]]:
    """Whether it is an observer's class, with nothing left abstract."""
    return isinstance(thing, type) and issubclass(thing, Observer) and not isabstract(thing)


OBSERVERS: Registry[type[Observer]] = Registry(
    "observer",
    package="hgorun.observers",
    group="hgorun.observers",
    accepts=is_observer,
    expected="a class derived from hgorun.observers.base.Observer that defines its design, states and equations",
)
observer = OBSERVERS.register
