"""A smooth function of time: its values and slopes at times, and bounds of them between times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.symbolic.evaluate import Floats, evaluate
from hgorun.symbolic.instructions import Instruction, read
from hgorun.symbolic.interval_operations import Bounds
from hgorun.symbolic.intervals import enclose


@dataclass(frozen=True, eq=False, repr=False)
class Smooth:
    """A smooth function of time, with its slope.

    Parameters
    ----------
    function : casadi.Function
        The value, and value and slope, of (t, p, s): time, parameters, and what is constant on a piece of time.
    """

    value: ca.Function
    slope: ca.Function

    @classmethod
    def of(cls, expression: ca.SX, t: ca.SX, p: ca.SX, s: ca.SX) -> Smooth:
        """From an expression of symbols."""
        slope = ca.densify(ca.vertcat(expression, ca.jacobian(expression, t)))
        given = [t, p, s]
        return cls(ca.Function("g", given, [ca.densify(expression)]), ca.Function("dg", given, [slope]))

    def at(self, times: Floats, p: Floats, s: Floats) -> Floats:
        """Values (N,) at times (N,), with s (N, size)."""
        return evaluate(self.value, times[:, None], p, s)[0][:, 0] if times.size else times

    def both(self, times: Floats, p: Floats, s: Floats) -> tuple[Floats, Floats]:
        """Values and slopes (N,)."""
        found = evaluate(self.slope, times[:, None], p, s)[0]
        return found[:, 0], found[:, 1]

    def bounds(self, low: Floats, high: Floats, p: Floats, s: Floats) -> tuple[Bounds, Bounds]:
        """Bounds (N,) of value and slope for times between low and high (N,)."""
        value, slope = enclose(self.slope, _argument(low, high, p, s), instructions=self._both)[0]
        return _wide(value, low), _wide(slope, low)

    def bounds_at(self, times: Floats, p: Floats, s: Floats) -> Bounds:
        """Bounds (N,) of the value at times (N,), which rounding keeps apart."""
        return _wide(enclose(self.value, _argument(times, times, p, s), instructions=self._one)[0][0], times)

    @cached_property
    def _one(self) -> list[Instruction]:
        return read(self.value)  # once: a search asks for bounds thousands of times

    @cached_property
    def _both(self) -> list[Instruction]:
        return read(self.slope)


def _argument(low: Floats, high: Floats, p: Floats, s: Floats) -> Callable[[int, int], Bounds]:
    """Bounds of (t, p, s)."""

    def bounds(which: int, entry: int) -> Bounds:
        if which == 0:
            return low, high
        same = np.array(p[entry]) if which == 1 else s[:, entry]
        return same, same

    return bounds


def _wide(bounds: Bounds, like: Floats) -> Bounds:
    return np.broadcast_to(bounds[0], like.shape), np.broadcast_to(bounds[1], like.shape)
