"""The second-order example of Lee, Choi and Khalil."""

from __future__ import annotations

import casadi as ca

from hgorun.plants.base import Expressions, Plant, Start, plant
from hgorun.symbolic.symbols import Symbols


@plant("lee_second_order")
class LeeSecondOrder(Plant):
    """A damped spring that weakens with its elongation, a chain; the origin is asymptotically stable.

        x1' = x2,    x2' = -x1 / (1 + x1^2) - x2,    y = x1

    The paper steps it by forward differences at the samples, (23) and (41): ``discretise: euler``.
    """

    reference = "Lee, Choi, Khalil 2016, (38)"
    valid = "everywhere"
    parameters_as_written = True  # those of inputs and disturbances
    first = Start(
        end=20,
        initial={"x1": 10, "x2": 10},
        estimate={"x1": 9, "x2": 0},
        period=0.05,
        noise=0.1,
        observers={"SHGO": {"type": "shgo", "theta": 3}, "FHGO": {"type": "fhgo2", "theta": 4, "r": 2}},
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("x1", "x2")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("x1",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        return [x.x2, -x.x1 / (1 + x.x1**2) - x.x2], [x.x1]
