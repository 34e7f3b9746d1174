"""A gain theta that is a state of its own, after Praly."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field, field_validator

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.types import ExpressionText, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Role
from hgorun.observers.output_injection import OutputInjection
from hgorun.symbolic.lower_triangular import LowerTriangularForm, state_affine_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


class DynamicGain(OutputInjection):
    """The keys of the gain's dynamics: a, b, q of (9), and gamma of (6)."""

    form = staticmethod(state_affine_form)

    a: Positive = Field(description="a > 0: how fast theta falls back to 1; of the inequality (9)")
    b: Positive = Field(description="b > 0: how slowly theta moves; of the inequality (9)")
    q: Positive = Field(le=1, description="0 < q <= 1: lower bound q I <= Q in (9)")
    gamma: ExpressionText = Field(description="expression of y, >= 0: bounds the slopes of g at this output (6)")

    @field_validator("gamma")
    @classmethod
    def _of_y(cls, text: str) -> str:
        try:
            parse(text, names=("y",))
        except ExpressionError as error:
            raise ValueError(str(error)) from error
        return text

    def design(self, form: LowerTriangularForm) -> dict[str, np.ndarray]:
        start = self._start()
        if start < 1:
            raise Problem(("internal", "theta"), f"theta must start at 1 or above, found {start:g}: (8) keeps it there")
        return {
            "l": self.injection(form),
            "a": np.array(self.a),
            "b": np.array(self.b),
            "q": np.array(self.q),
        }

    def states(self, form: LowerTriangularForm) -> dict[str, np.ndarray | Symmetric]:
        return {"theta": np.array(1.0)}

    def roles(self, form: LowerTriangularForm) -> dict[str, Role]:
        return {"theta": "gain"}

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {"poles": -1, "a": 1.0, "b": 2.5, "q": 0.15, "gamma": "4*y"}

    def theta_rate(self, theta: ca.SX, decay: ca.SX, y: ca.SX, n: int, k: Symbols) -> ca.SX:
        """(8), with ``decay`` in the place of a."""
        growth = 2 * (n - 1) / ca.sqrt(k.q) * parse(self.gamma, names=("y",)).symbol({"y": y})
        return -theta / k.b * (decay / 3 * (theta - 1) - growth)

    def _start(self) -> float:
        """theta(0); 1 where what is given is not a number, which is reported elsewhere."""
        try:
            return float(np.min(np.asarray(self.internal.get("theta", 1.0), dtype=float)))
        except (TypeError, ValueError):
            return 1.0

    def fastest_rate(self, form: LowerTriangularForm) -> float:
        return self._start() * self._rate(form)
