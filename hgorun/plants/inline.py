"""A plant written in the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import casadi as ca
from pydantic import Field, field_validator, model_validator

from hgorun.config.expressions import nearest, parse
from hgorun.config.types import ExpressionText, Name, NonEmpty, describe
from hgorun.errors import Problem
from hgorun.plants.base import Expressions, Plant
from hgorun.symbolic.symbols import Symbols


class InlinePlant(Plant):
    """A model given by its equations: states, dynamics, output."""

    type: str = "inline"
    states: Annotated[tuple[Name, ...], NonEmpty] = Field(description="names of the states")
    dynamics: dict[Name, ExpressionText] = Field(description="state: right-hand side")
    output: dict[str, ExpressionText] = Field(description="expression, list of expressions, or name: expression")

    @field_validator("output", mode="before")
    @classmethod
    def _named(cls, value: Any) -> Any:
        if isinstance(value, (str, int, float)) and not isinstance(value, bool):
            value = [value]
        if isinstance(value, list):
            # an output that is not a name has its place as name
            names = [v if isinstance(v, str) and v.isidentifier() else f"y{i + 1}" for i, v in enumerate(value)]
            if len(set(names)) < len(names):
                raise ValueError(f"outputs must differ, found {', '.join(names)}")
            value = dict(zip(names, value, strict=True))
        if not isinstance(value, dict):
            raise ValueError(f"expected an expression, a list or name: expression, found {describe(value)}")
        if not value:
            raise ValueError("at least one output is needed")
        return value

    @model_validator(mode="after")
    def _complete(self) -> InlinePlant:
        if len(set(self.states)) < len(self.states):
            raise ValueError("states: a name stands twice")
        missing = [s for s in self.states if s not in self.dynamics]
        if missing:
            raise ValueError(f"dynamics: the right-hand side of {', '.join(missing)} is missing")
        return self

    @property
    def state_names(self) -> tuple[str, ...]:
        return self.states

    @property
    def output_names(self) -> tuple[str, ...]:
        return tuple(self.output)

    @property
    def input_names(self) -> tuple[str, ...]:
        return tuple(self.inputs)

    def expressions(self) -> Mapping[tuple[str, ...], str]:
        dynamics: dict[tuple[str, ...], str] = {("dynamics", name): text for name, text in self.dynamics.items()}
        return dynamics | {("output", name): text for name, text in self.output.items()}

    def place_of(self, state: str) -> tuple[str, ...]:
        return ("dynamics", state)

    def require_fit(self) -> None:
        for name, text in self.output.items():
            if not parse(text).names:
                raise Problem(
                    ("plant", "output", name),
                    f"{text} is a number; an output is a state or an expression of states, such as {self.states[0]}",
                )
        for name in self.dynamics:
            if name not in self.states:
                known = ", ".join(self.states)
                raise Problem(
                    ("plant", "dynamics", name),
                    f"unknown name {name!r}; known here: {known}.{nearest(name, self.states)}",
                )

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        values = {**vars(p), **vars(u), **vars(x), "t": t}
        dynamics = [parse(self.dynamics[s], names=values).symbol(values) for s in self.states]
        outputs = [parse(text, names=values).symbol(values) for text in self.output.values()]
        return dynamics, outputs
