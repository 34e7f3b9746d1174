"""What an observer needs of a plant's structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import casadi as ca
import numpy as np

from hgorun.symbolic.plant import PlantModel

Bounds = Mapping[str, tuple[ca.SX, ca.SX]]


def saturate(x: ca.SX, names: Sequence[str], bounds: Bounds) -> ca.SX:
    """x with the named states clipped to their bounds."""
    parts = [x[i] for i in range(len(names))]
    for name, (low, high) in bounds.items():
        i = names.index(name)
        parts[i] = ca.fmax(low, ca.fmin(high, parts[i]))
    return ca.vertcat(*parts)


class Copy(Protocol):
    """The copy of the plant that an observer runs."""

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        ...

    def output(self, xhat: ca.SX) -> ca.SX:
        """C xhat, the outputs of the estimate, shape (q,)."""
        ...


class Form(Protocol):
    """A class of plants, and one member of it: built by a function that refuses what is not in the class."""

    @property
    def plant(self) -> PlantModel:
        """The plant."""
        ...

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        """Names of the states that can be saturated in the observer's coordinates."""
        ...

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        """The initial estimate in the observer's coordinates; ValueError says why there is none."""
        ...

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> Any:
        """The copy of the plant with these inputs and parameters."""
        ...


@runtime_checkable
class Redecided(Protocol):
    """A form that tells whether other numbers lead to the same equations, without symbolic work."""

    def again(self, at: np.ndarray, parameters: np.ndarray) -> Any:
        """The form for other numbers, of the same equations; None where they may lead to others, or to none.

        Parameters
        ----------
        at : ndarray, shape (n,)
            The plant's initial state.
        parameters : ndarray
            Values of the plant's parameters.
        """
        ...
