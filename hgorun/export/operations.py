"""The operations of an observer with its numbers in them, as few as there have to be.

The instructions of CasADi's functions become statements in which what depends on parameters alone is a number. Sums,
products and quotients are arranged as :class:`hgorun.engine.emitter.Emitter` arranges them, so that the exported code
rounds where the engine rounds; a factor of one or a summand of zero changes no bit and is left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.instructions import CLOCK, MAIN, SETUP, Instruction, read
from hgorun.symbolic.interpreter import CALLS, value_of

FMA = -1  # a b + c, rounded once: CasADi has no such operation
INPUT = ca.OP_INPUT
_POWERS = (ca.OP_POW, ca.OP_CONSTPOW)
_LARGEST = 2.0  # exponent of a power that is the exponential of a logarithm


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """One operation.

    Attributes
    ----------
    op : int
        CasADi's, or :data:`FMA`.
    arguments : tuple of int
        The steps whose values it needs, by number.
    place : (int, int)
        Of an input: which vector (t, p, z, w), and which entry.
    number : float or None
        The value, where that is known.
    clocked : bool
        Whether it depends on time and numbers alone.
    """

    op: int
    arguments: tuple[int, ...] = ()
    place: tuple[int, int] = (0, 0)
    number: float | None = None
    clocked: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Operations:
    """All steps of some functions, and what the functions give.

    Attributes
    ----------
    steps : sequence of Step
        In an order in which they can be computed.
    outputs : mapping of str to tuple of int
        For each function the steps that are its values.
    """

    steps: Sequence[Step]
    outputs: Mapping[str, tuple[int, ...]]

    def needed(self, *names: str) -> list[int]:
        """The steps that some functions need, numbers left out, in their order."""
        waiting = [step for name in names for step in self.outputs[name]]
        found: set[int] = set()
        while waiting:
            k = waiting.pop()
            if k not in found and self.steps[k].number is None:
                found.add(k)
                waiting += self.steps[k].arguments
        return sorted(found)

    def inputs(self, vector: int, *names: str) -> set[int]:
        """Which entries of a vector some functions read."""
        places = (self.steps[k].place for k in self.needed(*names) if self.steps[k].op == INPUT)
        return {entry for of, entry in places if of == vector}

    @cached_property
    def clocked(self) -> tuple[int, ...]:
        """Values of time alone that something else needs: they are the same for all stages at one time."""
        wanted: set[int] = set()
        for name in self.outputs:
            for k in self.needed(name):
                if not self.steps[k].clocked:
                    wanted |= {a for a in self.steps[k].arguments if self._is_clocked(a)}
            wanted |= {k for k in self.outputs[name] if self._is_clocked(k)}
        return tuple(sorted(wanted))

    def _is_clocked(self, k: int) -> bool:
        step = self.steps[k]
        return step.clocked and step.number is None

    def count(self, steps: Sequence[int]) -> dict[str, int]:
        """How many operations some steps are: plain ones, divisions and roots, and functions of libm."""
        found = {"plain": 0, "divisions": 0, "functions": 0}
        for k in steps:
            op = self.steps[k].op
            if op in (INPUT, ca.OP_ASSIGN):
                continue
            if op in CALLS:
                found["functions"] += 1
            elif op in (ca.OP_DIV, ca.OP_INV, ca.OP_SQRT):
                found["divisions"] += 1
            else:
                found["plain"] += 2 if op == FMA else 1
        return found


def operations(function: ca.Function, parameters: Floats) -> Operations:
    """The operations of a function of (t, p, z, w) for values of p.

    Parameters
    ----------
    function : casadi.Function
        With as many dense vectors as outputs as it likes; their names are those of the result.
    parameters : ndarray
    """
    made = _Made(parameters)
    outputs: dict[str, dict[int, int]] = {function.name_out(k): {} for k in range(function.n_out())}
    names = list(outputs)
    for instruction in read(function):
        if instruction.op == ca.OP_OUTPUT:
            which, entry = instruction.place
            outputs[names[which]][entry] = made.of[instruction.arguments[0]]
        else:
            made.take(instruction)
    return Operations(made.steps, {name: tuple(of[i] for i in range(len(of))) for name, of in outputs.items()})


@dataclass(eq=False, repr=False)
class _Made:
    """The steps so far."""

    parameters: Floats
    steps: list[Step] = field(default_factory=list)
    level: list[int] = field(default_factory=list)  # of each step: SETUP, CLOCK or MAIN, as the engine has it
    of: dict[int, int] = field(default_factory=dict)  # CasADi's value -> the step that has it
    factors: dict[int, tuple[int, int]] = field(default_factory=dict)  # CasADi's value -> steps that it is a product of
    known: dict[tuple[object, ...], int] = field(default_factory=dict)

    def take(self, i: Instruction) -> None:
        """One more instruction."""
        if i.op == ca.OP_CONST:
            self.of[i.value] = self._constant(i.number)
        elif i.op == ca.OP_INPUT:
            vector, entry = i.place
            if vector == 1:
                self.of[i.value] = self._constant(float(self.parameters[entry]))
            else:
                level = CLOCK if vector == 0 else MAIN
                self.of[i.value] = self._add(Step(INPUT, place=i.place, clocked=level == CLOCK), level)
        else:
            self.of[i.value] = self._operation(i)

    def _add(self, step: Step, level: int) -> int:
        """A step, or an equal one that there is already."""
        key = step.op, step.arguments, step.place, None if step.number is None else step.number.hex(), level
        if key not in self.known:
            self.known[key] = len(self.steps)
            self.steps.append(step)
            self.level.append(level)
        return self.known[key]

    def _constant(self, number: float, level: int = SETUP) -> int:
        return self._add(Step(ca.OP_CONST, number=float(number)), level)

    def _number(self, k: int) -> float:
        """The number that a step is; NaN where it is none."""
        number = self.steps[k].number
        return np.nan if number is None else number

    def _operation(self, i: Instruction) -> int:
        """The step of an operation: with the engine's rounding, and without what changes nothing."""
        a = tuple(self.of[value] for value in i.arguments)
        level = max(self.level[k] for k in a)
        if level == MAIN and i.op == ca.OP_DIV:
            return self._product(i, a[0], self._reciprocal(a[1]))
        if level == MAIN and i.op in (ca.OP_MUL, ca.OP_SQ):
            return self._product(i, a[0], a[-1])
        if level == MAIN and i.op in (ca.OP_ADD, ca.OP_SUB):
            return self._sum(i, a[0], a[1])
        if level == MAIN and i.op in _POWERS and self._is_fraction(a[1]):
            return self._power(a[0], a[1])
        return self._plain(i.op, a, level)

    def _plain(self, op: int, a: tuple[int, ...], level: int) -> int:
        """An operation as it is written; a simpler one where an argument is zero or one."""
        if all(self.steps[k].number is not None for k in a):
            return self._constant(value_of(op, *map(self._number, a)), level)
        simple = self._simple(op, a, level)
        return self._add(Step(op, a, clocked=level == CLOCK), level) if simple is None else simple

    def _simple(self, op: int, a: tuple[int, ...], level: int) -> int | None:
        """The step that has the value of an operation, where it needs none or another one."""
        if op == ca.OP_ASSIGN:
            return a[0]
        if op == ca.OP_NEG and self.steps[a[0]].op == ca.OP_NEG:
            return self.steps[a[0]].arguments[0]
        if op not in (ca.OP_MUL, ca.OP_ADD, ca.OP_SUB):
            return None
        numbers = [self._number(k) for k in a]
        for number, other in zip(numbers, a[::-1], strict=True):
            if op == ca.OP_MUL and number in (0.0, 1.0):
                return other if number else self._constant(0.0, level)
            if op == ca.OP_MUL and number == -1.0:
                return self._plain(ca.OP_NEG, (other,), level)
            if op == ca.OP_ADD and number == 0.0:
                return other
        if op == ca.OP_SUB and numbers[1] == 0.0:
            return a[0]
        return self._plain(ca.OP_NEG, (a[1],), level) if op == ca.OP_SUB and numbers[0] == 0.0 else None

    def _product(self, i: Instruction, a: int, b: int) -> int:
        """A product, whose numbers are multiplied once; see ``Emitter._product``."""
        values = (i.arguments[0], i.arguments[-1] if i.op != ca.OP_DIV else None)
        for constant, value in ((a, values[1]), (b, values[0])):
            if self.level[constant] == SETUP and value in self.factors:
                for own, rest in (self.factors[value], self.factors[value][::-1]):
                    if self.level[own] == SETUP:
                        a, b = self._constant(self._number(constant) * self._number(own)), rest
        self.factors[i.value] = a, b
        return self._plain(ca.OP_MUL, (a, b), MAIN)

    def _is_fraction(self, k: int) -> bool:
        """Whether it is a number of the size of usual exponents, and no half of an integer."""
        number = self._number(k)
        return abs(number) <= _LARGEST and not (2 * number).is_integer()

    def _power(self, base: int, exponent: int) -> int:
        """x^y = exp(y log x), to |y log x| last places: all powers of a base share its logarithm.

        ``pow`` of a C library takes as long as three of these, since it gives the last place.
        """
        log = self._plain(ca.OP_LOG, (base,), MAIN)
        return self._plain(ca.OP_EXP, (self._plain(ca.OP_MUL, (exponent, log), MAIN),), MAIN)

    def _reciprocal(self, k: int) -> int:
        return self._plain(ca.OP_INV, (k,), self.level[k] if self.level[k] == SETUP else MAIN)

    def _sum(self, i: Instruction, a: int, b: int) -> int:
        """A sum; of a product and something else it is rounded once; see ``Emitter._fused``."""
        left, right = (self.factors.get(value) for value in i.arguments)
        if (left is None) == (right is None):
            return self._plain(i.op, (a, b), MAIN)
        x, y = left or right or (a, b)
        rest = b if left else a
        if self._exact(x, y) or self._number(rest) == 0.0:
            return self._plain(i.op, (a, b), MAIN)
        if i.op == ca.OP_SUB and left:
            rest = self._plain(ca.OP_NEG, (rest,), self.level[rest])
        elif i.op == ca.OP_SUB:
            x = self._plain(ca.OP_NEG, (x,), self.level[x])
        return self._add(Step(FMA, (x, y, rest)), MAIN)

    def _exact(self, x: int, y: int) -> bool:
        """Whether a product is not rounded, or is a number."""
        numbers = self._number(x), self._number(y)
        return any(number in (-1.0, 0.0, 1.0) for number in numbers) or not np.any(np.isnan(numbers))
