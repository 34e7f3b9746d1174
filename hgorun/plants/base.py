"""What a plant is: names, equations, parameters; and how its YAML block becomes a model with numbers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import isabstract
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, TypeGuard

import casadi as ca
from pydantic import Field

from hgorun.config.types import Block, ExpressionText, Name, Number
from hgorun.registry import Registry


@dataclass(frozen=True)
class Quantity:
    """A parameter, input or state: default value, unit and meaning."""

    default: float | None = None
    unit: str = ""
    meaning: str = ""


class Plant(Block):
    """Base of all plants; its fields are the keys that every plant block has."""

    reference: ClassVar[str] = ""
    valid: ClassVar[str] = ""
    known_parameters: ClassVar[Mapping[str, Quantity]] = {}
    known_inputs: ClassVar[Mapping[str, Quantity]] = {}
    units: ClassVar[Mapping[str, str]] = {}

    type: str = Field(description="name of the plant")
    parameters: dict[Name, ExpressionText] = Field(default_factory=dict, description="name: value")
    inputs: dict[Name, ExpressionText] = Field(default_factory=dict, description="name: expression of t")
    initial: dict[Name, Number] = Field(default_factory=dict, description="initial state, every state named")
    discretise: Literal["euler"] | None = Field(
        default=None, description="euler: the plant is stepped by forward differences at the sample times"
    )
    disturbance: dict[Name, ExpressionText] = Field(
        default_factory=dict,
        description="state: expression of t, added to the plant, unknown to the observers",
    )

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
    def equations(self, t: ca.SX, x: SimpleNamespace, u: SimpleNamespace, p: SimpleNamespace) -> tuple[Any, Any]:
        """(dynamics, outputs): the right-hand side of each state and each output, as lists."""

    @property
    def triangular_coordinates(
        self,
    ) -> tuple[Callable[[ca.SX, ca.SX], ca.SX], Callable[[ca.SX, ca.SX], ca.SX]] | None:
        """(T, T^-1), functions of (x, p) and (z, p): the coordinates where the model is triangular, if not x."""
        return None

    @property
    def inverse(self) -> Callable[[ca.SX, ca.SX], ca.SX] | None:
        """x from canonical coordinates z and the parameter vector, where it is known."""
        return None


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
