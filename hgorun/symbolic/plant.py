"""A plant as symbolic expressions of its state, inputs, parameters and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hgorun.symbolic.evaluate import evaluate

Wrapped = TypeVar("Wrapped", ca.SX, NDArray[np.float64])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
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
    periods : tuple of float or None
        Of the outputs that are known up to whole periods; empty where there are none.
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
    periods: tuple[float | None, ...] = ()

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.states)

    def depends_on_input(self, number: int) -> bool:
        """Whether an input appears in the equations."""
        return bool(ca.depends_on(ca.vertcat(self.dynamics, self.output), self.u[number]))

    @property
    def driven(self) -> bool:
        """Whether any input appears in the equations."""
        return any(self.depends_on_input(i) for i in range(len(self.inputs)))

    @cached_property
    def measured(self) -> tuple[int | None, ...]:
        """For each output the state that it is, its number; None where it is no state."""
        return tuple(
            next((k for k in range(self.n) if ca.is_equal(ca.SX(self.output[i]), self.x[k])), None)
            for i in range(len(self.outputs))
        )

    @cached_property
    def measures(self) -> dict[str, str]:
        """The outputs that are states, with the states that they are."""
        pairs = zip(self.outputs, self.measured, strict=True)
        return {output: self.states[k] for output, k in pairs if k is not None}

    def wrapped(self, output: int, difference: Wrapped) -> Wrapped:
        """A difference of an output without its whole periods, in [-period/2, period/2); itself where it has none."""
        period = self.periods[output] if self.periods else None
        if period is None:
            return difference
        turns = difference / period + 0.5
        return difference - period * (np.floor(turns) if isinstance(turns, np.ndarray) else ca.floor(turns))

    @cached_property
    def _f(self) -> ca.Function:
        return ca.Function("f", [self.t, self.x, self.u, self.p], [self.dynamics])

    @cached_property
    def output_function(self) -> ca.Function:
        """y from (t, x, u, p)."""
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
        return self.output_function(t, x, u, p)
