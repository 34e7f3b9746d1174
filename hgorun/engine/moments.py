"""Arithmetic on times in native code: one time for all lanes, or one of each where they are loose."""

from __future__ import annotations

from hgorun.engine.module import Module
from hgorun.native.ir import Function

SNAP, ROUNDING = 1e-9, 1e-15  # of a step, and of the times: what an output point may lie before an event that it is at


class Moments:
    """What a loop over steps does with times and lengths of steps.

    Attributes
    ----------
    m : Module
    f : Function
        Where the instructions go.
    start, end : str
        When the segment starts and ends.
    """

    m: Module
    f: Function
    start: str
    end: str

    @property
    def _count(self) -> int:
        return self.m.lanes if self.m.loose else 1

    def moment(self, value: str | float) -> str:
        """A time, which may be a number."""
        if isinstance(value, str):
            return value
        with self.f.wide(self._count):
            return self.f.constant(value)

    def timed(self, operation: str, a: str | float, b: str | float) -> str:
        """Arithmetic: ``fadd``, ``fmul``, ..."""
        return self.f.let(f"{operation} {self.m.time} {self.moment(a)}, {self.moment(b)}")

    def absolute(self, time: str) -> str:
        """|t|."""
        with self.f.wide(self._count):
            return self.f.intrinsic("fabs", time)

    def compared(self, predicate: str, a: str | float, b: str | float) -> str:
        """Where a comparison holds: ``olt``, ``ugt``, ..."""
        return self.f.let(f"fcmp {predicate} {self.m.time} {self.moment(a)}, {self.moment(b)}")

    def either(self, a: str, b: str) -> str:
        """Where one of two conditions holds."""
        return self._logical("or", a, b)

    def both(self, a: str, b: str) -> str:
        """Where both hold."""
        return self._logical("and", a, b)

    def _logical(self, operation: str, a: str, b: str) -> str:
        with self.f.wide(self._count):
            return self.f.let(f"{operation} {self.f.mask} {a}, {b}")

    def chosen(self, condition: str, yes: str | float, no: str | float) -> str:
        """One time where a condition holds, another where it does not."""
        with self.f.wide(self._count):
            return self.f.select(condition, self.moment(yes), self.moment(no))

    def largest(self, first: str, *others: str) -> str:
        """The largest of some numbers."""
        for other in others:
            first = self.chosen(self.compared("ogt", other, first), other, first)
        return first

    def spread(self, time: str) -> str:
        """A time as a number of every lane."""
        return time if self.m.loose else self.f.splat(time)

    def snap(self, t1: str, h: str) -> str:
        """How far from an output point a time is its own, in a step that ends at t1."""
        largest = self.largest(self.absolute(t1), self.absolute(self.start))  # what times in between are rounded like
        return self.timed("fadd", self.timed("fmul", h, SNAP), self.timed("fmul", largest, ROUNDING))
