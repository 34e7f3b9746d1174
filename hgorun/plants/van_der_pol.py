"""The Van der Pol oscillator."""

from __future__ import annotations

import casadi as ca

from hgorun.plants.base import Expressions, Parameter, Plant, Start, plant
from hgorun.symbolic.symbols import Symbols


@plant("van_der_pol")
class VanDerPol(Plant):
    """Van der Pol oscillator, a chain.

        x1' = x2,    x2' = stiffness x1 + mu (1 - x1^2) x2,    y = x1

    Katayama's (26) prints the stiffness term with a plus sign (stiffness = 1); then the state grows like
    2 sqrt(t), while the text calls it bounded: with stiffness = -1 it is.
    """

    reference = "Katayama, (26)"
    valid = "everywhere; bounded for stiffness < 0"
    known_parameters = {
        "mu": Parameter(0.5, "", "damping"),
        "stiffness": Parameter(-1.0, "", "factor of the stiffness term: -1 oscillates, +1 as printed"),
    }
    first = Start(
        end=20,
        initial={"x1": 1, "x2": 0},
        estimate={"x1": 1.5, "x2": -1},
        period=0.05,
        noise=0.02,
        observers={"SHGO": {"type": "shgo", "theta": 4}, "FHGO": {"type": "fhgo2", "theta": 5, "r": 2}},
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("x1", "x2")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("x1",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        return [x.x2, p.stiffness * x.x1 + p.mu * (1 - x.x1**2) * x.x2], [x.x1]
