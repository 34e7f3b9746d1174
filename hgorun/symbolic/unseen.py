"""States that no measurement depends on, now or later."""

from __future__ import annotations

import casadi as ca

from hgorun.symbolic.plant import PlantModel


def unseen_states(plant: PlantModel) -> tuple[str, ...]:
    """States that appear neither in an output nor in the derivative of a state that outputs depend on.

    No observer can tell their values, whatever the inputs: that follows from which symbols an equation contains, so
    that the other states need not be observable.
    """
    seen = _states_in(plant.output, plant.x)
    while more := _states_in(ca.vertcat(*[plant.dynamics[k] for k in sorted(seen)]), plant.x) - seen:
        seen |= more
    return tuple(name for k, name in enumerate(plant.states) if k not in seen)


def _states_in(expressions: ca.SX, x: ca.SX) -> set[int]:
    """The states that expressions contain, by their numbers."""
    return set(ca.jacobian(expressions, x).sparsity().get_col()) if expressions.numel() else set()
