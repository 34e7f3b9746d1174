"""Means of a function along segments between boxes, enclosed: compiled, with the bits that intervals.py gives.

Operation by operation NumPy and small compiled loops take each array of bounds from memory and back: sixteen parts of
every segment. Here what is known of a segment stays in registers. Compiling takes a tenth of a second, once for all
functions that differ in their constants only, as those of a plant do whose parameters change.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.memo import Memo
from hgorun.native import functions
from hgorun.native.boxes import LEAST, OPERATIONS
from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Block, Function, hexadecimal
from hgorun.symbolic.instructions import Instruction
from hgorun.symbolic.interval_operations import INCREASING, whole_exponent

Pair = tuple[str, str]
Floats = np.ndarray
_CODE: Memo[Callable[..., None]] = Memo(128)  # by form


@dataclass(frozen=True, eq=False, repr=False)
class Form:
    """What code is made of: all of a function but the values of its constants.

    Parameters
    ----------
    instructions : sequence of Instruction
        Of a function of one vector with one column of values.
    ends, common, values : int
        Entries of the vector that change along a segment, those after them that do not, and how many values there are.
    parts : int
        A segment is cut into so many, each in a box: its mean is that of what is known of them.
    """

    instructions: Sequence[Instruction]
    ends: int
    common: int
    values: int
    parts: int

    @cached_property
    def digest(self) -> bytes:
        """Equal where the code is."""
        exponents = {i.arguments[1] for i in self.instructions if i.op in _POWERS}
        steps = [(i.value, i.op, i.arguments, i.place, i.number * (i.value in exponents)) for i in self.instructions]
        text = repr((steps, self.ends, self.common, self.values, self.parts))
        return hashlib.sha256(text.encode()).digest()

    @property
    def compiled(self) -> bool:
        """Whether there is code of it."""
        return self.digest in _CODE

    def code(self) -> Callable[..., None]:
        """Of addresses of rows, of what is found and of constants, and of the number of boxes; compiled once."""
        return _CODE.get(self.digest, self._made)

    def _made(self) -> Callable[..., None]:
        module = NativeModule(_module(self), ("means",))
        return module.function("means", None, *[ctypes.c_void_p] * 3, ctypes.c_int64)


class SegmentMeans:
    """Bounds of the means of a function's values over segments that lead from one box to another."""

    def __init__(self, form: Form) -> None:
        self._values, self._means = form.values, form.code()
        self._constants = np.array([i.number for i in form.instructions if i.op == ca.OP_CONST])

    def __call__(self, rows: Floats) -> tuple[Floats, Floats]:
        """Lower and upper bounds, shapes (N, values).

        Parameters
        ----------
        rows : ndarray, shape (4 ends + 2 common, N)
            Lower and upper bounds of the entries at first ends, at second ends, and of those that do not change; at
            least as many columns as there are boxes in a group.
        """
        rows, found = np.ascontiguousarray(rows), np.empty((2 * self._values, rows.shape[1]))
        self._means(address_of(rows), address_of(found), address_of(self._constants), rows.shape[1])
        low, high = (np.ascontiguousarray(half.T) for half in (found[: self._values], found[self._values :]))
        return low, high


def can_be_compiled(instructions: Sequence[Instruction]) -> bool:
    """Whether all operations are known here, too."""
    exponents = _numbers(instructions)
    for i in instructions:
        if i.op in _POWERS:
            known = whole_exponent(exponents.get(i.arguments[1], np.nan))
        else:
            known = i.op in _OPERATIONS or i.op in INCREASING or i.op in _NOT_COMPUTED
        if not known:
            return False
    return True


def _numbers(instructions: Sequence[Instruction]) -> Mapping[int, float]:
    """Constants by the numbers of their values."""
    return {i.value: i.number for i in instructions if i.op == ca.OP_CONST}


def _module(form: Form) -> str:
    instructions, ends, common, values, parts = form.instructions, form.ends, form.common, form.values, form.parts
    declarations = {"declare i64 @llvm.smin.i64(i64, i64)"}
    f = Function("means", "ptr %rows, ptr %found, ptr %constants, i64 %n", LEAST, declarations)
    last = f.scalar("sub", "%n", str(LEAST))
    groups = f.scalar("sdiv", f.scalar("add", "%n", str(LEAST - 1)), str(LEAST))
    sums = [f.slot(f.real) for _ in range(2 * values)]
    numbers, moving = _numbers(instructions), _moving(instructions, ends)
    known = {value: _constant(f, k) for k, value in enumerate(numbers)}
    with f.count(0, groups) as group:  # the last one may begin in the one before
        place = f.let(f"call i64 @llvm.smin.i64(i64 {f.scalar('mul', group, str(LEAST))}, i64 {last})")

        def address(pointer: str, row: int) -> str:
            return f.at(pointer, f.scalar("add", f.scalar("mul", "%n", str(row)), place))

        loaded = [f.load(address("%rows", row), f.real) for row in range(4 * ends + 2 * common)]
        first, second = (_pairs(loaded[k * 2 * ends : (k + 1) * 2 * ends]) for k in (0, 1))
        inputs = dict(enumerate(_pairs(loaded[4 * ends :]), ends))
        for i in instructions:
            if i.value not in moving and i.op not in (ca.OP_OUTPUT, ca.OP_CONST):
                known[i.value] = _value(f, i, inputs, known, numbers)
        for one in sums:
            f.store(f.constant(0.0), one, f.real)
        with f.count(0, parts) as part:
            along = [f.scalar("fdiv", _real(f, k), hexadecimal(parts)) for k in (part, f.scalar("add", part, "1"))]
            edges = [(f.splat(f.scalar("fsub", hexadecimal(1), s)), f.splat(s)) for s in along]
            inputs |= {j: _between(f, *pair, edges) for j, pair in enumerate(zip(first, second, strict=True))}
            own = dict(known)
            for i in instructions:
                if i.op == ca.OP_OUTPUT:
                    for side, bound in enumerate(own[i.arguments[0]]):
                        one = sums[side * values + i.place[1]]
                        f.store(f.add(f.load(one, f.real), f.div(bound, f.constant(parts))), one, f.real)
                elif i.value in moving:
                    own[i.value] = _value(f, i, inputs, own, numbers)
        for row, one in enumerate(sums):
            f.store(f.load(one, f.real), address("%found", row), f.real)
    f.do("ret void")
    return "\n".join([*sorted(declarations), f.text(linkage="")])


def _moving(instructions: Sequence[Instruction], ends: int) -> set[int]:
    """The values that change along a segment."""
    found: set[int] = set()
    for i in instructions:
        if i.op == ca.OP_INPUT:
            moves = i.place[1] < ends
        else:
            moves = i.op != ca.OP_OUTPUT and any(value in found for value in i.arguments)
        if moves:
            found.add(i.value)
    return found


def _pairs(rows: Sequence[str]) -> list[Pair]:
    """Lower with upper bounds: the former are the first half."""
    return list(zip(rows[: len(rows) // 2], rows[len(rows) // 2 :], strict=True))


def _constant(f: Function, place: int) -> Pair:
    """One of the function's, in all lanes."""
    return (f.splat(f.load(f.at("%constants", str(place)), "double")),) * 2


def _real(f: Function, whole: str) -> str:
    return f.let(f"sitofp i64 {whole} to double")


def _between(f: Function, first: Pair, second: Pair, edges: Sequence[Pair]) -> Pair:
    """A box around a part of a segment."""
    low, high = (
        [f.add(f.mul(rest, a), f.mul(share, b)) for rest, share in edges] for a, b in zip(first, second, strict=True)
    )
    return f.intrinsic("minimum", *low), f.intrinsic("maximum", *high)


def _value(
    f: Block, i: Instruction, inputs: Mapping[int, Pair], known: Mapping[int, Pair], numbers: Mapping[int, float]
) -> Pair:
    if i.op == ca.OP_INPUT:
        return inputs[i.place[1]]
    if i.op in _POWERS:
        return _power(f, known[i.arguments[0]], int(numbers[i.arguments[1]]))
    arguments = [bound for value in i.arguments for bound in known[value]]
    if i.op in INCREASING:
        return _increasing(f, *INCREASING[i.op], *arguments)
    return _OPERATIONS[i.op](f, *arguments)


def _negative(f: Block, a: str, b: str) -> Pair:
    return f.neg(b), f.neg(a)


def _quotient(f: Block, a: str, b: str, c: str, d: str) -> Pair:
    return OPERATIONS["multiply"](f, a, b, *OPERATIONS["inverse"](f, c, d))


def _absolute(f: Block, a: str, b: str) -> Pair:
    zero, sizes = f.constant(0.0), [f.intrinsic("fabs", bound) for bound in (a, b)]
    least = f.select(f.compare("ole", a, zero), zero, f.intrinsic("minimum", *sizes))
    apart = f.compare("olt", b, zero)
    return f.select(apart, f.intrinsic("minimum", *sizes), least), f.intrinsic("maximum", *sizes)


def _square(f: Block, a: str, b: str) -> Pair:
    low, high = OPERATIONS["outward_1"](f, *[f.mul(size, size) for size in _absolute(f, a, b)])
    return f.intrinsic("maximum", low, f.constant(0.0)), high


def _power(f: Block, a: Pair, exponent: int) -> Pair:
    base = OPERATIONS["inverse"](f, *a) if exponent < 0 else a
    result: Pair = (f.constant(1.0),) * 2
    for _ in range(abs(exponent) // 2):
        result = OPERATIONS["multiply"](f, *result, *_square(f, *base))
    return OPERATIONS["multiply"](f, *result, *base) if exponent % 2 else result


def _increasing(f: Block, name: str, least: float, most: float, a: str, b: str) -> Pair:
    low, high = OPERATIONS["outward_4"](f, *[functions.call(name, f, bound) for bound in (a, b)])
    return f.intrinsic("maximum", low, f.constant(least)), f.intrinsic("minimum", high, f.constant(most))


_OPERATIONS: dict[int, Callable[..., Pair]] = {
    ca.OP_ADD: OPERATIONS["add"],
    ca.OP_SUB: OPERATIONS["subtract"],
    ca.OP_MUL: OPERATIONS["multiply"],
    ca.OP_INV: OPERATIONS["inverse"],
    ca.OP_DIV: _quotient,
    ca.OP_NEG: _negative,
    ca.OP_TWICE: lambda f, a, b: (f.add(a, a), f.add(b, b)),
    ca.OP_SQ: _square,
    ca.OP_SQRT: lambda f, a, b: OPERATIONS["outward_1"](f, f.intrinsic("sqrt", a), f.intrinsic("sqrt", b)),
    ca.OP_FABS: _absolute,
    ca.OP_FMIN: lambda f, a, b, c, d: (f.intrinsic("minimum", a, c), f.intrinsic("minimum", b, d)),
    ca.OP_FMAX: lambda f, a, b, c, d: (f.intrinsic("maximum", a, c), f.intrinsic("maximum", b, d)),
}
_POWERS = ca.OP_POW, ca.OP_CONSTPOW
_NOT_COMPUTED = ca.OP_INPUT, ca.OP_CONST, ca.OP_OUTPUT
