"""The bioreactor of Gauthier, Hammouri and Othman: Contois growth with the dilution as input."""

from __future__ import annotations

import casadi as ca

from hgorun.plants.base import Expressions, Input, Invertible, Parameter, Plant, Start, TriangularCoordinates, plant
from hgorun.symbolic.symbols import Symbols


@plant("bioreactor_gauthier")
class GauthierBioreactor(Invertible, TriangularCoordinates, Plant):
    """Micro-organisms eta1 growing on a substrate eta2, with dilution rate u.

        eta1' =  g - u eta1
        eta2' = -g + u (s_in - eta2),    g = mu eta1 eta2 / (k_c eta1 + eta2),    y = eta1

    Observers for triangular plants compute in x = (eta1, g), where x1' = x2 - u x1, x2' is (22), and
    eta2 = k_c x1 x2 / (mu x1 - x2). The paper has mu = 3, k_c = 1, s_in = 0.1. Its initial state
    (0.05, 0.05) lies on the border of the set X that it calls invariant, not in X: eta1 + eta2 = s_in
    stays so for all time. gamma(y) = 4y, said to bound the slope of (22) as (6) asks, does not.
    """

    reference = "Meiners, Adamy 2025, (21)-(22)"
    valid = "eta1 > 0, eta2 > 0, eta1 + eta2 <= s_in"
    known_parameters = {
        "mu": Parameter(3.0, "1/s", "maximal growth rate"),
        "k_c": Parameter(1.0, "", "Contois constant"),
        "s_in": Parameter(0.1, "", "substrate in the feed"),
    }
    known_inputs = {"u": Input("1/s", "dilution rate")}
    first = Start(
        end=10,
        initial={"eta1": 0.05, "eta2": 0.05},
        estimate={"eta1": 0.05, "eta2": 0.0036},
        inputs={"u": "0.08"},
        period=0.02,
        noise=0.001,
        observers={"SHGO": {"type": "shgo", "theta": 3}, "FHGO": {"type": "fhgo2", "theta": 5, "r": 2}},
        told={"kinetic_rate": {"yields": {"eta1": [1], "eta2": [-1]}, "dilution": "u", "feed": {"eta2": "u*s_in"}}},
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("eta1", "eta2")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("eta1",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        g = p.mu * x.eta1 * x.eta2 / (p.k_c * x.eta1 + x.eta2)
        return [g - u.u * x.eta1, -g + u.u * (p.s_in - x.eta2)], [x.eta1]

    def to_triangular(self, x: Symbols, p: Symbols) -> Expressions:
        return [x.eta1, p.mu * x.eta1 * x.eta2 / (p.k_c * x.eta1 + x.eta2)]

    def from_triangular(self, z: ca.SX, p: Symbols) -> Expressions:
        return [z[0], p.k_c * z[0] * z[1] / (p.mu * z[0] - z[1])]

    def inverse(self, z: ca.SX, p: Symbols) -> Expressions:
        return self.from_triangular(z, p)  # without the dilution the growth rate is the second of both
