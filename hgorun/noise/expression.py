"""Noise as a formula."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.types import ExpressionText
from hgorun.errors import Problem
from hgorun.noise.base import TimeFunction, noise


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

    def symbol(self, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
        return parse(self.value, names=("t",)).symbol({"t": t})

    def at(self, times: np.ndarray, k: np.ndarray) -> np.ndarray:
        t, number = ca.SX.sym("t"), ca.SX.sym("k")
        value = parse(self.value, names=("t", "k")).symbol({"t": t, "k": number})
        found = ca.Function("v", [t, number], [value])(ca.DM(times[None, :]), ca.DM(k[None, :]))
        return np.asarray(found.full()).ravel()
