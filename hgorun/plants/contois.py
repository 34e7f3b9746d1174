"""A continuous bioreactor with Contois growth."""

from __future__ import annotations

import casadi as ca

from hgorun.plants.base import Expressions, Input, Invertible, Parameter, Plant, Start, plant
from hgorun.symbolic.symbols import Symbols


@plant("contois")
class Contois(Invertible, Plant):
    """Biomass x1 growing on a substrate x2 at the Contois rate, in a continuous culture.

        x1' =  g - D x1
        x2' = -g + D (s_in - x2),    g = mu x1 x2 / (k_c x1 + x2),    y = x1

    Canonical coordinates: z = (x1, g), the growth without the dilution. The thesis prints k_c x2 + x2 in
    x1'; that is not the Contois law, and at the thesis's dilution rate the culture would be washed out.
    """

    reference = "Robles Magdaleno 2023, (3.138)-(3.140)"
    valid = "x1 > 0, x2 > 0"
    known_parameters = {
        "mu": Parameter(1.064, "1/h", "maximal growth rate"),
        "k_c": Parameter(4.39, "g/g", "Contois constant"),
        "s_in": Parameter(20.0, "g/L", "substrate in the feed"),
    }
    known_inputs = {"D": Input("1/h", "dilution rate")}
    units = {"x1": "g/L", "x2": "g/L"}
    first = Start(
        end=60,
        unit="h",
        initial={"x1": 1.5, "x2": 15},
        estimate={"x1": 1, "x2": 14},
        inputs={"D": "mu*(1 - abs(sin(t))/2)"},
        period=0.25,
        noise=0.05,
        observers={"SHGO": {"type": "shgo", "theta": 1}, "FHGO": {"type": "fhgo2", "theta": 2, "r": 2}},
        told={"kinetic_rate": {"yields": {"x1": [1], "x2": [-1]}, "dilution": "D", "feed": {"x2": "D*s_in"}}},
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("x1", "x2")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("x1",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        g = p.mu * x.x1 * x.x2 / (p.k_c * x.x1 + x.x2)
        return [g - u.D * x.x1, -g + u.D * (p.s_in - x.x2)], [x.x1]

    def inverse(self, z: ca.SX, p: Symbols) -> Expressions:
        return [z[0], p.k_c * z[0] * z[1] / (p.mu * z[0] - z[1])]
