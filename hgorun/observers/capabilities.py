"""What theory may ask of an observer beside its equations, one small base class each.

An observer derives from those that it has; the analysis asks for them by type, never for a family::

    class Mine(HighGain, ContinuousObserver[CanonicalForm, PlantCopy]): ...

Each is a part of a YAML block: the keys that it declares can be declared again, with a description of their
own.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np
from pydantic import Field, PrivateAttr

from hgorun.config.types import Block, Positive
from hgorun.symbolic.forms import Form
from hgorun.symbolic.sensors import Sensor
from hgorun.symbolic.symbols import Symbols


class Speed(Block):
    """One key sets the speed of small errors: the larger it is, the faster they are.

    Where an observer diverges since it is too fast for its samples, delays or steps, that is what is told of.
    """

    @property
    @abstractmethod
    def speed_key(self) -> str | None:
        """Its name; None where it is not given, and others are in its place."""

    @property
    def speed_keys(self) -> tuple[str, ...]:
        """Those that set the speed of errors of some size, that of the fastest first; ``speed_key`` by default."""
        return () if self.speed_key is None else (self.speed_key,)

    def speed_of(self, key: str) -> float:
        """What such a key is, also where it follows from others."""
        return float(getattr(self, key))

    def at_speed(self, key: str, value: float) -> Self:
        """A copy whose small errors are as fast as those that a key with this value sets the speed of."""
        return self.model_copy(update={key: value})


class HighGain(Speed):
    """One number theta that sets the speed of the error: its eigenvalues are in proportion to it.

    What it gives: poles, beta, chi and the bounds on theta and delay (on plants that are chains), the smallest
    theta found by trying, exponents of the noise in theta.
    """

    theta: Positive = Field(description="high gain theta > 0")

    @property
    def speed_key(self) -> str | None:
        return "theta"

    def nominal_poles(self, order: int) -> np.ndarray:
        """Eigenvalues of the error's matrix at theta = 1 that the design asks for, shape (order,).

        They are compared with the matrix itself and taken where they are right, since eigenvalues that are
        found numerically lose digits where several are equal.
        """
        return np.full(order, -1.0)

    @property
    def poles_follow(self) -> bool:
        """Whether they change with theta: limits at one theta then tell nothing of those at another."""
        return False

    def with_theta(self, theta: float) -> Self:
        """A copy with another theta and the same eigenvalues at theta = 1."""
        return self.model_copy(update={"theta": theta})

    @property
    def settling_rate(self) -> float:
        """The rate at which the slowest of error and gain come to rest on chains of integrators (1/time).

        A gain that takes longer than the error has to say so here, for limits on chains.
        """
        return self.theta


class FollowingGain(Block):
    """A gain that follows a differential equation along the estimate, and comes to rest where that stands still."""


class GainOfErrors(Block):
    """A gain that depends on how large errors are, or have been.

    As it starts it is that of large errors where a key of its own sets their speed, or else the whole gain.
    """

    @property
    def unhindered(self) -> float:
        """An innovation so small that it changes no slope but the gain's own, which is the whole one there."""
        return 0.0


@dataclass(frozen=True, eq=False, repr=False)
class OneGain:
    """An observer of one gain whose errors those of another observer are like, while it has this gain.

    Attributes
    ----------
    block : mapping
        Of the configuration.
    key : str
        What the gain is called in the other observer.
    part : float
        What the key is there, over what sets the speed here.
    while_so : str
        When the errors are alike, as the end of a sentence.
    """

    block: Mapping[str, object]
    key: str
    part: float
    while_so: str


class SeveralGains(Block):
    """Gains that are chosen by how large errors are, each that of an observer of its own."""

    @abstractmethod
    def alone(self) -> list[OneGain]:
        """Those observers, the fastest first: where the errors of one grow, it may be lost."""


class SettlingGain(FollowingGain):
    """A gain that follows a differential equation, and comes to rest on chains of integrators."""

    @abstractmethod
    def settled(self, form: Form) -> dict[str, np.ndarray]:
        """Its matrices at rest, states by name; the form is that of chains of integrators, phi = 0."""


class FilterOrder(Block):
    """A filter of order r on the innovation."""

    r: int = Field(default=1, ge=0, le=20, strict=True, description="order of the filter, r >= 0")


class FilterCascade(Block):
    """As many first-order filters of bandwidth delta theta as the plant has blocks."""

    delta: Positive = Field(description="bandwidth of the filters over theta, delta > 0")


NO_MODEL = {"extend": "it knows no model of the plant, so that nothing is missing in one"}
"""What observers without a model lack."""


class Differentiator(Block):
    """The observer does without the plant's equations: what it does not know of them stays in its error.

    Without this, an observer that starts at the truth has to stay there while nothing disturbs it.
    """


class Averaged(Block):
    """The estimate follows the mean of the plant's field over points around it, not the field itself.

    On a nonlinear plant, where the mean over the points is another one, it does not stay at the truth.
    """


class SlidingMode(Block):
    """The right-hand side is discontinuous where the error is zero: there is no linearisation."""


class Switching(Block):
    """Equations that an explicit method integrates across a discontinuity in every step, back and forth.

    How far an estimate chatters depends on the step, which belongs to the definition of the run: no step can be found
    by error control, and a run with other steps does not tell the error.
    """

    @property
    def switches(self) -> bool:
        """Whether it does with the keys that are given."""
        return True


class GivenGain(Block):
    """Gains that may be given as they are, in place of poles."""

    @property
    @abstractmethod
    def given_gain(self) -> str | None:
        """The key under which they are given; None where they are not."""

    @abstractmethod
    def characteristics(self, form: Any) -> list[np.ndarray]:
        """Characteristic polynomials of the error at theta = 1: of every chain without the plant's slopes.

        With slopes where the class of plants has them in the links from state to state: one for each of them.
        """


class LocallyLinear(Block):
    """A correction that is linear in the innovation near the truth only.

    Linear theory is about small errors then, and the bounds of theorems for linear corrections do not hold.
    """

    @property
    @abstractmethod
    def nonlinear(self) -> str | None:
        """Where it is not linear, in words; None: nowhere, with the keys that are given."""

    @abstractmethod
    def beyond(self, plant: Any, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        """1 where it is not linear, 0 elsewhere: an entry for each saturation, zone or the like.

        Parameters
        ----------
        plant : the form's copy of the plant
        s : Symbols
            The observer's states, ``s.xhat`` among them.
        e : casadi.SX, shape (q,)
            The innovation.
        k : Symbols
            The numbers of the design.
        """


class NotLinear(Block):
    """Equations that no linear system describes, however small the error is."""

    @property
    @abstractmethod
    def not_linear(self) -> str | None:
        """Why, in words; None: there is one, with the keys that are given."""


class Punctual(Block):
    """Outputs have to come without delay."""

    because: ClassVar[str] = "without a model nothing brings what it follows to the present"
    """Why."""


class BySampling(Block):
    """The observer has other equations, and is of another class, where all outputs are sampled."""

    @abstractmethod
    def of_samples(self) -> Any:
        """The block, as an observer of samples."""


class ByLateness(Block):
    """The observer has other equations, and is of another class, where continuous outputs are late."""

    @abstractmethod
    def of_late(self) -> Any:
        """The block, as an observer of late outputs."""


class RecallsInputs(Block):
    """Equations that ask what the inputs have been at times before: these have to be functions of time."""


class NotExported(Block):
    """Equations that are not written as code of their own."""

    @property
    @abstractmethod
    def not_exported(self) -> str:
        """Why, in words."""


class NoiseInformed(Block):
    """The design depends on the noise of the sensors, which stands in another block of the configuration."""

    _sensors: tuple[Sensor, ...] = PrivateAttr(default=())

    def informed(self, sensors: Sequence[Sensor]) -> Self:
        """The block with what is known of the sensors, in the order of the outputs; asked for before the design."""
        copied = self.model_copy()
        copied._sensors = tuple(sensors)
        return copied
