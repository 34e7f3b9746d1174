"""The academic example of a plant that is observable under some inputs only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import casadi as ca

from hgorun.plants.base import Expressions, Parameter, Plant, Start, plant
from hgorun.symbolic.symbols import Symbols


@plant("academic")
class Academic(Plant):
    """Three states in a chain whose links pass through zero.

        x1' = f_1(t) x2 - a x1
        x2' = f_2(t) x3 - a x2 + tanh(x1 x2)
        x3' = -a x3 + tanh(x1 x2) + u(t) + eps(t),    y = x1
        f_1 = c_1 sin(omega_1 t),    f_2 = c_2 sin(omega_2 t),    u = c_u sin(omega_u t)

    x2 has no effect on y while f_1 = 0, nor x3 while f_2 = 0: the plant is not uniformly observable, but triangular,
    for observers with time-varying gain. eps = 0.1 sin(0.1 t) of the thesis is what the key ``disturbance`` is for.
    The thesis prints f_2 for f_2 x3 in x2'; then x3 would not reach the output.
    """

    reference = "Robles Magdaleno 2023, (2.84), (3.135)"
    valid = "everywhere; bounded for a > 0"
    known_parameters: ClassVar[Mapping[str, Parameter]] = {
        "a": Parameter(0.1, "1/s", "damping of each state"),
        "c_1": Parameter(1.0, "1/s", "amplitude of the link f_1 from x2 to x1"),
        "omega_1": Parameter(0.5, "rad/s", "its frequency"),
        "c_2": Parameter(1.0, "1/s", "amplitude of the link f_2 from x3 to x2"),
        "omega_2": Parameter(2.7, "rad/s", "its frequency"),
        "c_u": Parameter(5.0, "1/s", "amplitude of the input"),
        "omega_u": Parameter(0.5 * math.pi, "rad/s", "its frequency"),
    }
    first: ClassVar[Start | None] = Start(
        end=20,
        initial={"x1": 1, "x2": 1, "x3": 1},
        estimate={"x1": 0, "x2": 0, "x3": 0},
        period=0.02,
        noise=0.01,
        observers={
            "SHGO": {"type": "shgo_riccati", "theta": 5},
            "FHGO": {"type": "fhgo2_nuos", "theta": 5, "r": 2},
        },
    )

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("x1", "x2", "x3")

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("x1",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        f_1, f_2 = p.c_1 * ca.sin(p.omega_1 * t), p.c_2 * ca.sin(p.omega_2 * t)
        phi = ca.tanh(x.x1 * x.x2)
        return [
            f_1 * x.x2 - p.a * x.x1,
            f_2 * x.x3 - p.a * x.x2 + phi,
            -p.a * x.x3 + phi + p.c_u * ca.sin(p.omega_u * t),
        ], [x.x1]
