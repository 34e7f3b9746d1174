"""A plant as symbolic expressions of its state, inputs, parameters and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.symbolic.evaluate import evaluate


@dataclass(frozen=True)
class PlantModel:
    """x' = f(t, x, u, p), y = h(t, x, u, p), without the disturbance that observers do not know.

    Attributes
    ----------
    states, outputs, inputs, parameters : tuple of str
        Names, in the order of the vectors x (n), y (q), u (m) and p.
    t, x, u, p : casadi.SX
        The symbols that ``dynamics`` (n) and ``output`` (q) are written in.
    inverse : callable, optional
        ``inverse(z, p)`` gives x from the canonical coordinates z, where the plant knows it.
    transform, untransform : callable, optional
        ``transform(x, p)`` gives the coordinates where the plant is triangular, if not its own, and
        ``untransform(z, p)`` leads back.
    """

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    t: ca.SX
    x: ca.SX
    u: ca.SX
    p: ca.SX
    dynamics: ca.SX
    output: ca.SX
    inverse: Callable[[ca.SX, ca.SX], ca.SX] | None = None
    transform: Callable[[ca.SX, ca.SX], ca.SX] | None = None
    untransform: Callable[[ca.SX, ca.SX], ca.SX] | None = None

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.states)

    @cached_property
    def _f(self) -> ca.Function:
        return ca.Function("f", [self.t, self.x, self.u, self.p], [self.dynamics])

    @cached_property
    def _h(self) -> ca.Function:
        return ca.Function("h", [self.t, self.x, self.u, self.p], [self.output])

    @cached_property
    def _T(self) -> ca.Function:
        image = self.x if self.transform is None else self.transform(self.x, self.p)
        return ca.Function("T", [self.x, self.p], [ca.densify(image)])

    def image(self, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """States (N, n) in the coordinates where the plant is triangular: T(x), or x where there is no T."""
        return x if self.transform is None else evaluate(self._T, x, parameters)[0]

    def f(self, t: ca.SX, x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
        """The vector field at other arguments."""
        return self._f(t, x, u, p)

    def h(self, t: ca.SX, x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
        """The output at other arguments."""
        return self._h(t, x, u, p)
