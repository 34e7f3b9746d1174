"""What a plant is: names, equations, parameters; and how its YAML block becomes a model with numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from inspect import isabstract
from typing import ClassVar, Literal, TypeAlias, TypeGuard

import casadi as ca
from pydantic import Field

from hgorun.config.plugin import Plugin
from hgorun.config.types import ExpressionText, Name, Number
from hgorun.registry import Registry
from hgorun.symbolic.symbols import Symbols

# One expression each of several states, outputs or coordinates.
Expressions: TypeAlias = Sequence[ca.SX | float]


@dataclass(frozen=True)
class Parameter:
    """A parameter: its default value (None: it has to be given), unit and meaning."""

    default: float | None
    unit: str = ""
    meaning: str = ""


@dataclass(frozen=True)
class Input:
    """An input: its unit and meaning."""

    unit: str = ""
    meaning: str = ""


@dataclass(frozen=True, kw_only=True)
class Start:
    """A first configuration of a plant, which ``hgorun init --plant`` writes.

    Attributes
    ----------
    end, unit : float and str
        Of the run, and what time is counted in.
    initial, estimate : mapping of str to float
        The state at the start, and what observers take it for.
    inputs : mapping of str to str
        Expressions of t.
    period : float
        Between two samples.
    noise : float
        Standard deviation.
    observers : mapping of str to mapping
        Keys by label.
    told : mapping of str to mapping
        Keys of other observers, by type, that have to be told of the plant what its equations do not say.
    keys : mapping of str to object
        Further keys of the plant.
    """

    end: float
    unit: str = "s"
    initial: Mapping[str, float]
    estimate: Mapping[str, float]
    inputs: Mapping[str, str] = field(default_factory=dict)
    period: float
    noise: float
    observers: Mapping[str, Mapping[str, object]]
    told: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    keys: Mapping[str, object] = field(default_factory=dict)


_WRITTEN_IN_PLACE = frozenset(("states", "dynamics", "output", "units"))  # keys of a model that its block gives


class Plant(Plugin):
    """A plant; its fields are the keys that every block `plant` has."""

    kind: ClassVar[str] = "plant"
    reference: ClassVar[str] = ""
    valid: ClassVar[str] = ""
    known_parameters: ClassVar[Mapping[str, Parameter]] = {}
    known_inputs: ClassVar[Mapping[str, Input]] = {}
    parameters_as_written: ClassVar[bool] = False  # parameters stand in expressions of the block alone
    units: ClassVar[Mapping[str, str]]  # may be left out; for your own model it is a key
    first: ClassVar[Start | None] = None  # a configuration to begin with
    together = _WRITTEN_IN_PLACE

    type: str = Field(description="name of the plant")
    parameters: dict[Name, ExpressionText] = Field(default_factory=dict, description="name: value")
    inputs: dict[Name, ExpressionText] = Field(default_factory=dict, description="name: expression of t")
    initial: dict[Name, Number] = Field(default_factory=dict, description="initial value of every state")
    discretise: Literal["euler"] | None = Field(
        default=None, description="euler: the plant is stepped by forward differences at the sample times"
    )
    disturbance: dict[Name, ExpressionText] = Field(
        default_factory=dict,
        description="state: expression of t, added to the plant, unknown to the observers",
    )

    @classmethod
    def _inside(cls, key: object, value: object) -> str:
        if key in _WRITTEN_IN_PLACE:
            in_place = ", ".join(sorted(_WRITTEN_IN_PLACE))
            return f" This type has its own: leave out {in_place}, or `type` for a model that is written in place."
        return super()._inside(key, value)

    @property
    @abstractmethod
    def state_names(self) -> tuple[str, ...]:
        """Names of the states."""

    @property
    @abstractmethod
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.known_inputs)

    @abstractmethod
    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        """(dynamics, outputs): the right-hand side of each state and each output, as lists.

        Parameters
        ----------
        t : casadi.SX
        x, u, p : Symbols
            States, inputs and parameters by their names.
        """

    def expressions(self) -> Mapping[tuple[str, ...], str]:
        """Expressions of t, states, inputs and parameters in the block, by their place in it.

        They are checked before :meth:`equations` is called, so that what is wrong in one is reported there.
        """
        return {}

    @property
    def periods(self) -> Mapping[str, float]:
        """The period of every output that is known up to whole periods, such as an angle."""
        return {}

    @property
    def measured_states(self) -> Mapping[str, str]:
        """The state that an output of another name is, by outputs."""
        return {}

    def place_of(self, state: str) -> tuple[str, ...]:
        """Where in the block the right-hand side of a state stands; empty where it is the class's own."""
        return ()

    @classmethod
    def example(cls) -> Mapping[str, object]:
        """Keys of a block that works, where a start of every state between 0.5 and 1 and inputs of 0.1 do not."""
        return {}

    def require_fit(self) -> None:
        """Refuse what the keys alone do not show to be wrong.

        Raises
        ------
        Problem
            Its path starts at ``plant``.
        """


class Invertible(ABC):
    """A plant that knows x as a function of its canonical coordinates z = (h, L_f h, ...), drift alone."""

    @abstractmethod
    def inverse(self, z: ca.SX, p: Symbols) -> Expressions:
        """The states, in their order, from z, shape (n,)."""


class TriangularCoordinates(ABC):
    """A plant that is triangular in coordinates z = T(x) of its own choice."""

    @abstractmethod
    def to_triangular(self, x: Symbols, p: Symbols) -> Expressions:
        """z = T(x)."""

    @abstractmethod
    def from_triangular(self, z: ca.SX, p: Symbols) -> Expressions:
        """The states, in their order, from z, shape (n,)."""


def units_of(plant: Plant | type[Plant]) -> dict[str, str]:
    """Units of inputs, states and outputs, where the plant states them; an output that is a state has its unit."""
    of_inputs = {name: one.unit for name, one in plant.known_inputs.items() if one.unit}
    stated = of_inputs | dict(getattr(plant, "units", {}))
    measured = plant.measured_states if isinstance(plant, Plant) else {}
    return {output: stated[state] for output, state in measured.items() if state in stated} | stated


def is_plant(thing: object) -> TypeGuard[type[Plant]]:
    """Whether it is a plant's class, with nothing left abstract."""
    return isinstance(thing, type) and issubclass(thing, Plant) and not isabstract(thing)


PLANTS: Registry[type[Plant]] = Registry(
    "plant",
    package="hgorun.plants",
    group="hgorun.plants",
    accepts=is_plant,
    expected="a class derived from hgorun.plants.base.Plant that defines its states, outputs and equations",
)
plant = PLANTS.register
