"""Expressions in the block of an observer: checked with the design, evaluated at the observer's copy of the plant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import casadi as ca

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.nearest import among
from hgorun.errors import KeyPath, Problem
from hgorun.symbolic.canonical import PlantCopy
from hgorun.symbolic.smooth import SmoothCopy


def require_states(key: str, names: Iterable[str], states: Sequence[str]) -> None:
    """Refuse names that are not states of the plant.

    Raises
    ------
    Problem
        At the first of them, below ``key``.
    """
    for name in names:
        if name not in states:
            raise Problem((key, name), f"unknown state {name!r}; known here: {among(name, states)}")


def require_known(path: KeyPath, text: str, known: Sequence[str]) -> None:
    """Refuse an expression that is wrong, or has other names in it.

    Raises
    ------
    Problem
    """
    try:
        parse(text, names=known)
    except ExpressionError as error:
        raise Problem(path, str(error)) from error


def of_copy(plant: SmoothCopy | PlantCopy, text: str, more: Mapping[str, ca.SX] | None = None) -> ca.SX:
    """An expression at the time, inputs and parameters of a copy of the plant, and at ``more`` by name."""
    model = plant.form.plant
    known = {"t": plant.t, **dict(zip(model.inputs, ca.vertsplit(plant.u), strict=False))}
    known |= dict(zip(model.parameters, ca.vertsplit(plant.p), strict=False))
    known |= more or {}
    return parse(text, names=known).symbol(known)
