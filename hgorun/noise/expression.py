"""Noise as a formula."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.literals import template
from hgorun.config.types import ExpressionText
from hgorun.errors import Problem
from hgorun.noise.base import TimeFunction, noise
from hgorun.symbolic.evaluate import compiled, evaluate


@noise("expression")
class ExpressionNoise(TimeFunction):
    """Noise as an expression of time t and, for samples, of the sample's number k."""

    value: ExpressionText = Field(description="expression of t; for samples of t and k")

    def check(self, *, continuous: bool) -> None:
        try:
            expression = parse(self.value, names=("t",) if continuous else ("t", "k"))
            if not expression.names:
                expression.number()
        except ExpressionError as error:
            raise Problem(("value",), str(error)) from error

    def numbers(self) -> Mapping[str, Sequence[float]]:
        return {"value": template(parse(self.value, names=("t",)))[1]}

    def structure(self) -> Hashable:
        return template(parse(self.value, names=("t",)))[0]

    def symbol(self, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
        return ca.SX(template(parse(self.value, names=("t",)))[0].symbol({"t": t}, numbers["value"]))

    def at(self, times: np.ndarray, k: np.ndarray) -> np.ndarray:
        return evaluate(compiled(self.value, "t", "k"), times[:, None], k[:, None])[0].ravel()
