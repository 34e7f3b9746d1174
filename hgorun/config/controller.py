"""The block ``controller`` of a configuration: inputs that are a function of the estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from hgorun.config.expressions import nearest, parse
from hgorun.config.types import Block, ExpressionText, Interval, Name, Number, Positive, expression, number
from hgorun.errors import Problem

DRIVEN = "controller"
"""What stands in ``plant.inputs`` for an input that the controller drives."""


def _cost(value: Any) -> Any:
    """An expression, or the weights of squares."""
    if isinstance(value, Mapping):
        weights = {str(name): number(weight) for name, weight in value.items()}
        if not weights:
            raise ValueError("expected an expression or name: weight, found nothing")
        return weights
    return expression(value)


Cost = Annotated[str | dict[Name, Number], BeforeValidator(_cost)]


class Controller(Block):
    """Inputs that follow from the estimates: every observer drives a copy of the plant of its own."""

    law: dict[Name, ExpressionText] = Field(
        description="input: expression of the estimates (by the names of the states), other inputs, parameters and t"
    )
    saturation: dict[Name, Interval] = Field(
        default_factory=dict, description="input: [low, high], the bounds to which its law is clipped"
    )
    period: Positive | None = Field(
        default=None, description="the inputs are held between the times start, start + period, ...; else continuous"
    )
    integral: dict[Name, ExpressionText] = Field(
        default_factory=dict, description="name: its derivative, an expression as in a law, such as xi: r - x1"
    )
    anti_windup: Literal["conditional", "none"] = Field(
        default="conditional",
        description="conditional: an integral rests while an input that it moves is saturated and would go further",
    )
    truth: dict[Name, ExpressionText] = Field(
        default_factory=dict,
        description="name of an observer's own state that a law uses: what it estimates, for the run with the true "
        "state, an expression of states, other inputs, parameters and t",
    )
    cost: Cost | None = Field(
        default=None,
        description="what is integrated over a run: an expression of the true states, inputs, parameters and t, or "
        "name: weight of its square",
    )

    @model_validator(mode="after")
    def _fitting(self) -> Controller:
        if not self.law:
            raise Problem(("law",), "expected input: expression, found nothing")
        for name in self.saturation:
            if name not in self.law:
                raise Problem(("saturation", name), f"input {name!r} has no law.{nearest(name, self.law)}")
        return self

    @property
    def cost_text(self) -> str | None:
        """The cost as an expression."""
        if not isinstance(self.cost, dict):
            return self.cost
        return " + ".join(f"({weight!r})*({name})**2" for name, weight in self.cost.items())

    def names(self) -> frozenset[str]:
        """All names in its expressions."""
        return frozenset().union(*(parse(text).names for text in self._texts()))

    def seen(self) -> frozenset[str]:
        """The names in what is decided from the estimates."""
        texts = (*self.law.values(), *self.integral.values())
        return frozenset().union(*(parse(text).names for text in texts))

    def _texts(self) -> Iterator[str]:
        for block in (self.law, self.integral, self.truth):
            yield from block.values()
        if self.cost_text is not None:
            yield self.cost_text
