"""Operations as statements of C99."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from hgorun.export.operations import FMA, INPUT, Operations, Step
from hgorun.symbolic.interpreter import CALLS

_LONGEST = 72  # characters of an expression that stands where its value is needed
_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARED = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_LIBM = {ca.OP_SQRT: "sqrt", ca.OP_FABS: "fabs", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_COPYSIGN: "copysign"}
_LIBM |= CALLS
_NAMED = {*_COMPARED, ca.OP_FMIN, ca.OP_FMAX, ca.OP_SIGN, ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO}
LAST = "1e300"  # a time that is later is none
_TWICE = {*_NAMED, ca.OP_SQ, ca.OP_TWICE}  # arguments are written twice


@dataclass(frozen=True)
class Real:
    """The type of numbers: ``double`` or ``float``."""

    single: bool = False

    @property
    def name(self) -> str:
        """Of the type."""
        return "float" if self.single else "double"

    def number(self, value: float) -> str:
        """A constant with all its digits."""
        if not math.isfinite(value):
            sign, size = "-" if value < 0 else "", "NAN" if math.isnan(value) else "INFINITY"
            return f"({'' if self.single else '(double)'}{sign}{size})"
        if self.single:
            if value and not 1e-37 < abs(value) < 3e38:
                value = math.copysign(0.0 if abs(value) < 1 else 3.4e38, value)
            text = f"{value:.9g}"
        else:
            text = repr(float(value))
        if not re.search(r"[.en]", text):
            text += ".0"
        text += "F" if self.single else ""
        return f"({text})" if text.startswith("-") else text

    @property
    def largest(self) -> str:
        """What is larger is lost, or no measurement."""
        return self.number(1e37 if self.single else 1e300)

    def function(self, name: str) -> str:
        """A function of libm."""
        return f"{name}f" if self.single else name


@dataclass(frozen=True, eq=False, repr=False)
class Writer:
    """Writes some functions of an observer.

    Attributes
    ----------
    operations : Operations
    real : Real
    prefix : str
        Of names outside of the functions.
    places : sequence of (str, int)
        What the entries of w are: arrays and places in them.
    state : str
        What the array z is called.
    """

    operations: Operations
    real: Real
    prefix: str
    places: Sequence[tuple[str, int]]
    state: str = "z"

    def statements(self, outputs: Mapping[int, list[str]], *, clock: bool = False, cast: str = "") -> list[str]:
        """The statements that assign steps to targets.

        Parameters
        ----------
        outputs : mapping of int to list of str
            For each step the targets.
        clock : bool
            Whether these compute what depends on time alone; elsewhere that stands in ``tau``.
        cast : str
            What makes the targets' type of the values, where that is another.
        """
        known = {} if clock else {k: f"tau[{i}]" for i, k in enumerate(self.operations.clocked)}
        order, uses = self._order(outputs, known)
        text, lines = dict(known), []
        for k in order:
            if k in text:
                continue
            step = self.operations.steps[k]
            if step.op == INPUT:
                text[k] = self._input(step)
                continue
            expression = self._expression(step, text)
            named = uses[k] > 1 or len(expression) > _LONGEST or step.op in _NAMED
            if named and not (uses[k] == 1 and k in outputs):
                lines.append(f"const {self.real.name} v{k} = {_bare(expression)};")
                expression = f"v{k}"
            text[k] = expression
        for k, targets in outputs.items():
            value = self._value(k, text)
            lines += [f"{target} = {f'{cast}({_bare(value)})' if cast else _bare(value)};" for target in targets]
        return lines

    def _order(self, outputs: Mapping[int, list[str]], known: Mapping[int, str]) -> tuple[list[int], Counter[int]]:
        """The steps that are needed and not known, in their order, and how often each is."""
        steps, uses = self.operations.steps, Counter({k: len(targets) for k, targets in outputs.items()})
        waiting, found = list(outputs), set()
        while waiting:
            k = waiting.pop()
            if k in found or k in known or steps[k].number is not None:
                continue
            found.add(k)
            waiting += steps[k].arguments
            for argument in steps[k].arguments:
                uses[argument] += 2 if steps[k].op in _TWICE else 1
        return sorted(found), uses

    def _input(self, step: Step) -> str:
        vector, entry = step.place
        if vector == 0:
            return "t"
        name, place = (self.state, entry) if vector == 2 else self.places[entry]
        return f"{name}[{place}]"

    def _value(self, k: int, text: Mapping[int, str]) -> str:
        number = self.operations.steps[k].number
        return text[k] if number is None else self.real.number(number)

    def _expression(self, step: Step, text: Mapping[int, str]) -> str:
        a = [self._value(k, text) for k in step.arguments]
        op, zero, one = step.op, self.real.number(0.0), self.real.number(1.0)
        if op in _BINARY:
            return f"({a[0]} {_BINARY[op]} {a[1]})"
        if op == FMA:
            return f"{self.prefix}muladd({', '.join(map(_bare, a))})"
        if op in _LIBM:
            return f"{self.real.function(_LIBM[op])}({', '.join(map(_bare, a))})"
        if op in _COMPARED:
            return f"(({a[0]} {_COMPARED[op]} {a[1]}) ? {one} : {zero})"
        special = {
            ca.OP_ASSIGN: "{0}",
            ca.OP_NEG: "(-{0})",
            ca.OP_SQ: "({0} * {0})",
            ca.OP_TWICE: "({0} + {0})",
            ca.OP_INV: f"({one} / {{0}})",
            ca.OP_FMIN: "(({0} < {1}) ? {0} : {1})",
            ca.OP_FMAX: "(({0} > {1}) ? {0} : {1})",
            ca.OP_SIGN: f"(({{0}} > {zero}) ? {one} : (({{0}} < {zero}) ? {self.real.number(-1.0)} : {{0}}))",
            ca.OP_NOT: f"(({{0}} == {zero}) ? {one} : {zero})",
            ca.OP_AND: f"((({{0}} != {zero}) && ({{1}} != {zero})) ? {one} : {zero})",
            ca.OP_OR: f"((({{0}} != {zero}) || ({{1}} != {zero})) ? {one} : {zero})",
            ca.OP_IF_ELSE_ZERO: f"(({{0}} != {zero}) ? {{1}} : {zero})",
        }
        return special[op].format(*a)


def _bare(expression: str) -> str:
    """An expression without the brackets around all of it."""
    if not expression.startswith("(") or not expression.endswith(")"):
        return expression
    depth = 0
    for i, char in enumerate(expression):
        depth += (char == "(") - (char == ")")
        if not depth and i < len(expression) - 1:
            return expression
    return expression[1:-1]
