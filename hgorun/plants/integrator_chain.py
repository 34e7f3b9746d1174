"""A chain of integrators with an optional nonlinearity."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
from pydantic import Field

from hgorun.config.expressions import parse
from hgorun.config.types import ExpressionText
from hgorun.plants.base import Expressions, Plant, Start, plant
from hgorun.symbolic.symbols import Symbols


@plant("integrator_chain")
class IntegratorChain(Plant):
    """Chain of n integrators, the last one driven by phi.

        x_i' = x_(i+1), i < n,    x_n' = phi(t, x, u),    y = x_1

    phi is an expression of x1..xn, t, the inputs and the parameters that the block declares; zero when
    omitted.
    """

    reference = "Astolfi, Marconi, Praly, Teel 2016, (1)"
    valid = "everywhere"
    parameters_as_written = True
    first = Start(
        end=20,
        initial={"x1": 1, "x2": 0},
        estimate={"x1": 0, "x2": 0},
        period=0.05,
        noise=0.01,
        observers={"SHGO": {"type": "shgo", "theta": 3}, "FHGO": {"type": "fhgo2", "theta": 4, "r": 2}},
        keys={"n": 2, "phi": "-x1 + sin(2*t)"},
    )

    n: int = Field(default=2, ge=1, le=50, strict=True, description="number of integrators")
    phi: ExpressionText = Field(default="0", description="right-hand side of the last equation")

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(f"x{i + 1}" for i in range(self.n))

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("x1",)

    @property
    def input_names(self) -> tuple[str, ...]:
        return tuple(self.inputs)

    def expressions(self) -> Mapping[tuple[str, ...], str]:
        return {("phi",): self.phi}

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        values = {**vars(p), **vars(u), **vars(x), "t": t}
        phi = parse(self.phi, names=values).symbol(values)
        states = list(vars(x).values())
        return [*states[1:], phi], [states[0]]
