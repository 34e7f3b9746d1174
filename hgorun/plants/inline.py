"""A plant written in the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import casadi as ca
from pydantic import BeforeValidator, Field, field_validator, model_validator

from hgorun.config.expressions import nearest, parse
from hgorun.config.tokens import DECIMAL_POINT, ends_a_number
from hgorun.config.types import Block, ExpressionText, Name, NonEmpty, Positive, describe, expression
from hgorun.errors import Problem
from hgorun.plants.base import Expressions, Plant
from hgorun.symbolic.symbols import Symbols


class PeriodicOutput(Block):
    """An output that is known up to whole periods, such as the angle that an encoder gives."""

    value: ExpressionText = Field(description="expression of states, inputs, parameters and t")
    period: Positive = Field(description="measurements and innovations lie within half a period of zero")


def _output(value: Any) -> Any:
    """An expression, or a mapping with one."""
    if isinstance(value, dict):
        return PeriodicOutput.model_validate(value)
    return value if isinstance(value, PeriodicOutput) else expression(value)


Output = Annotated[str | PeriodicOutput, BeforeValidator(_output)]


class InlinePlant(Plant):
    """A model given by its equations: states, dynamics, output."""

    parameters_as_written = True

    type: str = "inline"
    states: Annotated[tuple[Name, ...], NonEmpty] = Field(description="names of the states")
    dynamics: dict[Name, ExpressionText] = Field(description="state: right-hand side")
    output: dict[str, Output] = Field(
        description="expression, list of expressions, or name: expression; {value, period} where it is an angle"
    )
    units: dict[Name, str] = Field(  # type: ignore[misc]  # a key here, what the class says elsewhere
        default_factory=dict, description="state, output or input: its unit, for tables, figures and files"
    )

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
        twice = [name for i, name in enumerate(self.states) if name in self.states[:i]]
        if twice:
            raise Problem(("states",), f"the name {twice[0]} is there twice; each state has a name of its own")
        missing = [s for s in self.states if s not in self.dynamics]
        if missing:
            others = [name for name in self.dynamics if name not in self.states]
            instead = f"; {others[0]} is no state: the key is the name of the state itself" if others else ""
            raise Problem(
                ("dynamics",),
                f"the right-hand side of {', '.join(missing)} is missing: write a line `{missing[0]}: ...`{instead}",
            )
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
        return dynamics | {self._place(name): text for name, text in self._values.items()}

    @property
    def periods(self) -> Mapping[str, float]:
        return {name: given.period for name, given in self.output.items() if isinstance(given, PeriodicOutput)}

    @property
    def measured_states(self) -> Mapping[str, str]:
        return {name: text.strip() for name, text in self._values.items() if text.strip() in self.states}

    def _place(self, output: str) -> tuple[str, ...]:
        """Where an output's expression stands in the block."""
        return ("output", output) if isinstance(self.output[output], str) else ("output", output, "value")

    @property
    def _values(self) -> dict[str, str]:
        """The outputs' expressions."""
        return {name: given if isinstance(given, str) else given.value for name, given in self.output.items()}

    def place_of(self, state: str) -> tuple[str, ...]:
        return ("dynamics", state)

    def require_fit(self) -> None:
        measurable = tuple(dict.fromkeys((*self.states, *self.output, *self.inputs)))
        used = frozenset[str]().union(*(parse(text).names for text in self.expressions().values()))
        # of an input that equations use and nothing declares it is not the unit that is wrong
        undeclared = used - self.parameters.keys()
        for name in self.units:
            if name not in measurable and name not in undeclared:
                raise Problem(
                    ("plant", "units", name),
                    f"unknown name {name!r}; known here: {', '.join(measurable)}.{nearest(name, measurable)}",
                )
        following = dict(zip(self._values, list(self._values.values())[1:], strict=False))
        for name, text in self._values.items():
            if not parse(text).names:
                decimal = f"; {DECIMAL_POINT}" if ends_a_number(following.get(name, "")) else ""
                raise Problem(
                    ("plant", *self._place(name)),
                    f"{text} is a number; an output is a state or an expression of states, such as "
                    f"{self.states[0]}{decimal}",
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
        outputs = [parse(text, names=values).symbol(values) for text in self._values.values()]
        return dynamics, outputs
