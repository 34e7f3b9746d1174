"""What a Rosenbrock method needs of a right-hand side: its factored matrix, the solution with it, df/dt."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from hgorun.engine.elimination import factor
from hgorun.engine.layout import HybridSystem, Regime

_FINITE = 1e300  # a slope beyond it is left out of the matrix: the method allows that, at the price of its order


@dataclass(frozen=True)
class Linearised:
    """Functions of (t, p, z, w), as the engine emits them; z has more entries here.

    Attributes
    ----------
    factor : casadi.Function
        The entries of the factors of W = shift - df/dz, from z = (z, shift).
    solve : casadi.Function
        The solution, from z = (entries, right-hand side).
    drift : casadi.Function
        df/dt, with the slopes of what is delayed, from z = (z, shift, slopes).
    entries : int
    drifting : tuple of int
        The states whose df/dt is not zero.
    """

    factor: ca.Function
    solve: ca.Function
    drift: ca.Function
    entries: int
    drifting: tuple[int, ...]


def linearised(system: HybridSystem, regime: Regime) -> Linearised:
    """Derive a regime's right-hand side."""
    n = system.states
    t, p, z = ca.SX.sym("t"), ca.SX.sym("p", system.parameters), ca.SX.sym("z", n)
    w, shift = ca.SX.sym("w", system.held.size), ca.SX.sym("shift")
    rate = regime.flow(t, p, z, w)
    late = [system.held.output(i) + k for i in regime.delayed for k in range(system.width)]
    slopes = ca.SX.sym("slopes", len(late))
    matrix = shift * ca.SX.eye(n) - _finite(ca.jacobian(rate, z))
    factors = factor(matrix)
    entries = list(factors.entries())
    kept = [i for i, entry in enumerate(entries) if not entry.is_constant()]
    known, right = ca.SX.sym("known", len(kept)), ca.SX.sym("right", n)
    for k, i in enumerate(kept):
        entries[i] = known[k]
    solution = factors.with_entries(iter(entries)).solve(right)
    original = list(factors.entries())
    drift = ca.jacobian(rate, t) + (ca.jacobian(rate, w)[:, late] @ slopes if late else 0)
    drift = ca.densify(_finite(drift))
    return Linearised(
        _compiled("factor", ca.vertcat(*[original[i] for i in kept]), t, p, ca.vertcat(z, shift), w),
        _compiled("solve", solution, t, p, ca.vertcat(known, right), w),
        _compiled("drift", drift, t, p, ca.vertcat(z, shift, slopes), w),
        len(kept),
        tuple(i for i in range(n) if not drift[i].is_zero()),
    )


def _finite(matrix: ca.SX) -> ca.SX:
    """The same, with zero for what is not a number or beyond all bounds, as the slope of sqrt at 0."""

    def guarded() -> Iterator[ca.SX]:
        for value in matrix.nonzeros():
            yield value if value.is_constant() else ca.if_else(ca.fabs(value) <= _FINITE, value, 0)

    return ca.SX(matrix.sparsity(), ca.vertcat(*guarded()))


def _compiled(name: str, expression: ca.SX, *inputs: ca.SX) -> ca.Function:
    return ca.Function(name, inputs, [ca.densify(ca.cse(expression))])
