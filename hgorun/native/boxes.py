"""Sums, products and quotients of intervals, rounded outwards, in one pass over arrays of their bounds.

A bound moves to its neighbour by its bits, as nextafter does: zero to the smallest number, and infinity stays where it
leads outwards. What is not a number gives the whole line. Zero times an infinite bound is zero: infinity is a bound
here, not a value.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, partial, reduce

import numpy as np
from numpy.typing import NDArray

from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Block, Function

Bounds = tuple[NDArray[np.float64], NDArray[np.float64]]
LEAST = 8
"""Boxes that an array has at least: the last group of lanes may begin in the one before."""
_ARGUMENTS = {"outward_1": 1, "outward_2": 1, "outward_4": 1, "inverse": 1, "add": 2, "subtract": 2, "multiply": 2}
_SMALLEST = 5e-324


def apply(name: str, *arguments: Bounds) -> Bounds:
    """An operation on intervals; their bounds are broadcast.

    Parameters
    ----------
    name : str
        ``outward_1``, ``outward_2`` or ``outward_4``, which move bounds by so many units in the last place,
        ``inverse``, ``add``, ``subtract`` or ``multiply``.
    """
    bounds = [bound for argument in arguments for bound in argument]
    shape = np.broadcast(*bounds).shape
    rows = [_whole(bound, shape) for bound in bounds]  # kept until the end: addresses keep nothing
    low, high = np.empty(shape), np.empty(shape)
    _compiled()[name](*map(address_of, (*rows, low, high)), low.size)
    return low, high


def _whole(bound: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """In one piece, and of a shape."""
    if bound.shape == shape and bound.flags.c_contiguous and bound.dtype == np.float64:
        return bound
    return np.ascontiguousarray(np.broadcast_to(bound, shape), dtype=np.float64)


@cache
def _compiled() -> dict[str, Callable[..., None]]:
    """By name, from addresses of bounds, those of the result last, and how many boxes there are."""
    native = NativeModule(_module(), tuple(_ARGUMENTS))
    return {
        name: native.function(name, None, *[ctypes.c_void_p] * (2 * count + 2), ctypes.c_int64)
        for name, count in _ARGUMENTS.items()
    }


def _module() -> str:
    declarations = {"declare i64 @llvm.smin.i64(i64, i64)"}
    functions = [_function(name, declarations) for name in _ARGUMENTS]
    return "\n".join([*sorted(declarations), *functions])


def _function(name: str, declarations: set[str]) -> str:
    pointers = [f"%x{i}" for i in range(2 * _ARGUMENTS[name])]
    head = ", ".join(f"ptr {x}" for x in [*pointers, "%low", "%high"]) + ", i64 %n"
    f = Function(name, head, LEAST, declarations)
    last = f.scalar("sub", "%n", str(LEAST))
    groups = f.scalar("sdiv", f.scalar("add", "%n", str(LEAST - 1)), str(LEAST))
    with f.count(0, groups) as group:
        place = f.let(f"call i64 @llvm.smin.i64(i64 {f.scalar('mul', group, str(LEAST))}, i64 {last})")
        low, high = OPERATIONS[name](f, *[f.load(f.at(x, place), f.real) for x in pointers])
        f.store(low, f.at("%low", place), f.real)
        f.store(high, f.at("%high", place), f.real)
    f.do("ret void")
    return f.text(linkage="")


def _outward(f: Block, low: str, high: str, units: int = 1) -> tuple[str, str]:
    lost = f.compare("uno", low, high)
    for _ in range(units):
        low, high = _moved(f, low, -1), _moved(f, high, 1)
    return f.select(lost, f.constant(-np.inf), low), f.select(lost, f.constant(np.inf), high)


def _moved(f: Block, value: str, sign: int) -> str:
    """The next number, upwards or downwards."""
    bits = f.bits(value)
    larger, smaller = (f.let(f"add {f.integer} {bits}, {f.integer_constant(step)}") for step in (1, -1))
    above = f.compare("ogt" if sign > 0 else "olt", value, f.constant(0.0))
    moved = f.select(above, f.from_bits(larger), f.from_bits(smaller))
    moved = f.select(f.compare("oeq", value, f.constant(0.0)), f.constant(sign * _SMALLEST), moved)
    return f.select(f.compare("oeq", value, f.constant(sign * np.inf)), value, moved)


def _add(f: Block, a: str, b: str, c: str, d: str) -> tuple[str, str]:
    return _outward(f, f.add(a, c), f.add(b, d))


def _subtract(f: Block, a: str, b: str, c: str, d: str) -> tuple[str, str]:
    return _outward(f, f.sub(a, d), f.sub(b, c))


def _multiply(f: Block, a: str, b: str, c: str, d: str) -> tuple[str, str]:
    products = [_product(f, p, q) for p in (a, b) for q in (c, d)]
    low, high = (reduce(partial(_chosen, f, predicate), products) for predicate in ("olt", "ogt"))
    low, high = _outward(f, low, high)
    for pair in (products[:2], products[2:]):
        lost = f.compare("uno", *pair)
        low, high = f.select(lost, f.constant(-np.inf), low), f.select(lost, f.constant(np.inf), high)
    return low, high


def _chosen(f: Block, predicate: str, p: str, q: str) -> str:
    return f.select(f.compare(predicate, p, q), p, q)


def _product(f: Block, p: str, q: str) -> str:
    zero = f.constant(0.0)
    product = f.select(f.compare("oeq", p, zero), zero, f.mul(p, q))
    return f.select(f.compare("oeq", q, zero), zero, product)


def _inverse(f: Block, a: str, b: str) -> tuple[str, str]:
    """Nothing is known of that of an interval with zero."""
    one, zero = f.constant(1.0), f.constant(0.0)
    low, high = _outward(f, f.div(one, b), f.div(one, a))
    sides = ((f.compare("ogt", a, zero), low, high), (f.compare("olt", b, zero), low, high))
    below, above = f.constant(-np.inf), f.constant(np.inf)
    for apart, found_low, found_high in sides:
        below, above = f.select(apart, found_low, below), f.select(apart, found_high, above)
    return below, above


OPERATIONS: dict[str, Callable[..., tuple[str, str]]] = {  # what they emit of the bounds of their arguments
    "outward_1": _outward,
    "outward_2": lambda f, low, high: _outward(f, low, high, 2),
    "outward_4": lambda f, low, high: _outward(f, low, high, 4),
    "inverse": _inverse,
    "add": _add,
    "subtract": _subtract,
    "multiply": _multiply,
}
