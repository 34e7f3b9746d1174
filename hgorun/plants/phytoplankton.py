"""Phytoplankton in a continuous culture: the Droop model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import casadi as ca

from hgorun.plants.base import Expressions, Input, Parameter, Plant, Start, TriangularCoordinates, plant
from hgorun.symbolic.symbols import Symbols


@plant("phytoplankton")
class Phytoplankton(TriangularCoordinates, Plant):
    """Biomass x1 that grows on its store x2 of a nutrient, taken up from the substrate x3 (Droop).

        x1' = a_2 (1 - 1/x2) x1 - u x1
        x2' = a_3 x3/(a_1 + x3) - a_2 (x2 - 1)
        x3' = u (1 - x3) - x1 x3/(a_1 + x3),    y = x1

    without dimensions: x1 = rho_m N/S_in, x2 = Q/K_Q, x3 = S/S_in of the biomass N, the cell quota Q and the
    substrate S; a_1 = K_rho/S_in, a_2 = mu_m, a_3 = rho_m/K_Q; u is the dilution rate. In

        z = (x1, 1/x2, 1/(a_1 + x3))

    the model is triangular: F_1 = -a_2 z1, F_2 = a_1 a_3 z2^2,
    phi = ((a_2 - u) z1, a_2 z2 - (a_2 + a_3) z2^2, -a_1 z1 z3^3 + z3^2 (z1 - u (1 + a_1)) + u z3). Observers
    with time-varying gain compute there; their saturation is named z1, z2, z3, and P is that of z.
    """

    reference = "Robles Magdaleno 2023, (2.86)-(2.90)"
    valid = "x1 > 0, x2 > 0, x3 > -a_1"
    known_parameters: ClassVar[Mapping[str, Parameter]] = {
        "a_1": Parameter(0.02, "g/g", "half-saturation constant of the uptake over the substrate in the feed"),
        "a_2": Parameter(4.18, "1/d", "maximal growth rate"),
        "a_3": Parameter(5.32, "1/d", "maximal uptake rate over the minimal quota"),
    }
    known_inputs: ClassVar[Mapping[str, Input]] = {"u": Input("1/d", "dilution rate")}
    first: ClassVar[Start | None] = Start(
        end=6,
        unit="d",
        initial={"x1": 3, "x2": 1.7, "x3": 0.03},
        estimate={"x1": 2.5, "x2": 1.6, "x3": 0.05},
        inputs={"u": "1.71*(1 + 0.6*sin(6*pi*t))"},
        period=0.02,
        noise=0.01,
        observers={
            "SHGO": {
                "type": "shgo_riccati",
                "theta": 5,
                "internal": {"P": 0.1},
                "saturation": {"z1": [0.5, 6], "z2": [0.2, 1], "z3": [1, 50]},
            },
            "FHGO": {
                "type": "fhgo1",
                "theta": 5,
                "delta": 7,
                "internal": {"P": 0.1},
                "saturation": {"z1": [0.5, 6], "z2": [0.2, 1], "z3": [1, 50]},
            },
        },
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("x1", "x2", "x3")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("x1",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        uptake = x.x3 / (p.a_1 + x.x3)
        return [
            p.a_2 * (1 - 1 / x.x2) * x.x1 - u.u * x.x1,
            p.a_3 * uptake - p.a_2 * (x.x2 - 1),
            u.u * (1 - x.x3) - x.x1 * uptake,
        ], [x.x1]

    def to_triangular(self, x: Symbols, p: Symbols) -> Expressions:
        return [x.x1, 1 / x.x2, 1 / (p.a_1 + x.x3)]

    def from_triangular(self, z: ca.SX, p: Symbols) -> Expressions:
        return [z[0], 1 / z[1], 1 / z[2] - p.a_1]
