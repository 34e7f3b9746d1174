"""Draws of many generators in machine code, with the bits of :mod:`hgorun.noise.normal` and of NumPy.

The generator is PCG64 as NumPy has it: state <- a state + c modulo 2^128, and of each state 64 bits. What a draw from
the tail is takes a logarithm that is rounded correctly: here it is written down as an approximation together with the
argument of the logarithm. Decisions that are too close for an approximation are left to the caller as well.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hgorun.native import functions
from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function, hexadecimal
from hgorun.noise.normal import INSIDE, LAYERS, SURE, TAIL, WIDTHS

Words = NDArray[np.uint64]

_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645
_PART = hexadecimal(2.0**-53)
_FEWEST, _SHARE = 64, 1000  # places for draws from the tail: at least so many, or one in so many draws; 1 in 4,000 is


class Tails(NamedTuple):
    """Draws that the caller finishes.

    Attributes
    ----------
    place : ndarray of int64
        Where each is among all draws, one stream after the other.
    argument : ndarray
        Of the logarithm; zero where the whole stream is left to the caller.
    """

    place: NDArray[np.int64]
    argument: NDArray[np.float64]


def uniform(states: Words, count: int) -> tuple[NDArray[np.float64], Words]:
    """Draws from [0, 1), shape (N, count), and the states of the generators behind them.

    Parameters
    ----------
    states : ndarray of uint64, shape (N, 4)
        Of the generators: state and c, the low words first. They are not changed.
    """
    draws, after = np.empty((len(states), count)), states.copy()
    _code().uniform(address_of(after), len(states), count, address_of(draws))
    return draws, after


def normal(states: Words, count: int) -> tuple[NDArray[np.float64], Tails, Words]:
    """Normal draws, shape (N, count), those that are to be finished, and the states; else as :func:`uniform`."""
    draws = np.empty((len(states), count))
    room = _FEWEST + draws.size // _SHARE
    while True:
        place, argument, after = np.empty(room, dtype=np.int64), np.empty(room), states.copy()
        tables = [address_of(table) for table in (LAYERS, WIDTHS, INSIDE)]
        found = _code().normal(
            address_of(after),
            len(states),
            count,
            address_of(draws),
            *tables,
            room,
            *map(address_of, (place, argument)),
        )
        if found <= room:
            return draws, Tails(place[:found], argument[:found]), after
        room = found


class _Code:
    """The compiled functions."""

    def __init__(self) -> None:
        native = NativeModule(_ir(), ("uniform", "normal"))
        word, pointer = ctypes.c_int64, ctypes.c_void_p
        shape = [pointer, word, word, pointer]
        self.uniform = native.function("uniform", None, *shape)
        taken = [*shape, *[pointer] * 3, word, pointer, pointer]
        self.normal = native.function("normal", word, *taken)


_code = cache(_Code)


def _ir() -> str:
    declarations: set[str] = set()
    texts = [_uniform(declarations).text("dso_local"), _normal(declarations).text("dso_local")]
    return "\n".join([*sorted(declarations), *texts])


class _Generator:
    """The code for one generator, its state in registers."""

    def __init__(self, f: Function) -> None:
        self.f = f
        self.state, self.increment = f.slot("i128"), f.slot("i128")

    def start(self, states: str, member: str) -> None:
        """Take the state of a member."""
        f = self.f
        first = f.at(states, f.scalar("mul", member, "4"))
        for slot, place in ((self.state, 0), (self.increment, 2)):
            self._keep(self.f.load(f.at(first, place), "i128"), slot)

    def leave(self, states: str, member: str) -> None:
        """Leave the state where it was taken from."""
        f = self.f
        place = f.at(states, f.scalar("mul", member, "4"))
        self._keep(f.load(self.state, "i128"), place)

    def word(self) -> str:
        """The next 64 bits."""
        f = self.f
        state, increment = f.load(self.state, "i128"), f.load(self.increment, "i128")
        state = f.let(f"add i128 {f.let(f'mul i128 {state}, {_MULTIPLIER}')}, {increment}")
        self._keep(state, self.state)
        low = f.let(f"trunc i128 {state} to i64")
        high = f.let(f"trunc i128 {f.let(f'lshr i128 {state}, 64')} to i64")
        mixed, turn = f.scalar("xor", high, low), f.scalar("lshr", high, "58")
        f.declarations.add("declare i64 @llvm.fshr.i64(i64, i64, i64)")
        return f.let(f"call i64 @llvm.fshr.i64(i64 {mixed}, i64 {mixed}, i64 {turn})")

    def uniform(self) -> str:
        """The next draw from [0, 1)."""
        f = self.f
        return f.scalar("fmul", f.let(f"uitofp i64 {f.scalar('lshr', self.word(), '11')} to double"), _PART)

    def _keep(self, value: str, slot: str) -> None:
        self.f.do(f"store i128 {value}, ptr {slot}, align 8")


def _uniform(declarations: set[str]) -> Function:
    f = Function("uniform", "ptr %states, i64 %members, i64 %count, ptr %draws", 1, declarations)
    generator = _Generator(f)
    with f.count(0, "%members") as member:
        generator.start("%states", member)
        own = f.at("%draws", f.scalar("mul", member, "%count"))
        with f.count(0, "%count") as i:
            f.store(generator.uniform(), f.at(own, i))
        generator.leave("%states", member)
    f.do("ret void")
    return f


def _normal(declarations: set[str]) -> Function:
    """Draws as :func:`hgorun.noise.normal.normal_of` makes them, word for word."""
    arguments = "ptr %states, i64 %members, i64 %count, ptr %draws, ptr %layers, ptr %widths, ptr %inside"
    f = Function("normal", f"{arguments}, i64 %room, ptr %place, ptr %argument", 1, declarations, returns="i64")
    generator, tails, at = _Generator(f), f.slot("i64"), f.slot("i64")
    f.store("0", tails, "i64")
    with f.count(0, "%members") as member:
        generator.start("%states", member)
        base = f.scalar("mul", member, "%count")
        f.store("0", at, "i64")
        with f.loop() as finished:
            f.leave_if(f.test("sge", f.load(at, "i64"), "%count"), finished)
            word = generator.word()
            layer = f.scalar("and", word, "255")
            place = f.scalar("and", f.scalar("lshr", word, "9"), str(2**52 - 1))
            size = f.scalar("fmul", f.let(f"uitofp i64 {place} to double"), f.word("%widths", layer, "double"))
            negative = f.test("ne", f.scalar("and", word, "256"), "0")
            value = f.let(f"select i1 {negative}, double {f.neg(size)}, double {size}")
            outside = f.test("sge", place, f.word("%inside", layer))  # no place has 63 bits
            taken = f.slot("i64")
            f.store("1", taken, "i64")
            draw = f.slot("double")
            f.store(value, draw)
            with f.when(outside):
                behind = f.test("eq", layer, "0")
                note = _Note(f, tails, f.scalar("add", base, f.load(at, "i64")))
                with f.when(behind):
                    _behind(f, generator, place, draw, note)
                with f.when(f.let(f"xor i1 {behind}, true")):
                    f.store(_is_below(f, generator, layer, value, note), taken, "i64")
            here = f.load(at, "i64")
            f.store(f.load(draw), f.at("%draws", f.scalar("add", base, here)))
            f.store(f.scalar("add", here, f.load(taken, "i64")), at, "i64")
        generator.leave("%states", member)
    f.do(f"ret i64 {f.load(tails, 'i64')}")
    return f


class _Note:
    """The code that leaves a draw, at a place among all, to the caller."""

    def __init__(self, f: Function, tails: str, place: str) -> None:
        self.f, self.tails, self.place = f, tails, place

    def down(self, argument: str) -> None:
        """Write it down; what there is no room for is counted."""
        f = self.f
        number = f.load(self.tails, "i64")
        with f.when(f.test("slt", number, "%room")):
            f.store(self.place, f.at("%place", number), "i64")
            f.store(argument, f.at("%argument", number))
        f.store(f.scalar("add", number, "1"), self.tails, "i64")

    def doubtful(self, difference: str, sure: str) -> None:
        """Leave the stream to the caller where a difference is too small to be decided."""
        f = self.f
        with f.when(f.test("ole", f.intrinsic("fabs", difference), sure)):
            self.down(hexadecimal(0.0))


def _is_below(f: Function, generator: _Generator, layer: str, x: str, note: _Note) -> str:
    """Whether a point of a layer is below the curve, 1 or 0."""
    half = hexadecimal(-0.5)

    def curve(v: str) -> str:
        return functions.call("exp", f, f.scalar("fmul", f.scalar("fmul", v, v), half))

    u = generator.uniform()
    above = f.word("%layers", f.scalar("sub", layer, "1"), "double")
    high = f.let(f"select i1 {f.test('sgt', layer, '1')}, double {above}, double {hexadecimal(0.0)}")
    left, right = curve(f.word("%layers", layer, "double")), curve(x)
    left = f.scalar("fadd", left, f.scalar("fmul", u, f.scalar("fsub", curve(high), left)))
    note.doubtful(f.scalar("fsub", left, right), hexadecimal(SURE))
    return f.let(f"zext i1 {f.test('olt', left, right)} to i64")


def _behind(f: Function, generator: _Generator, place: str, draw: str, note: _Note) -> None:
    """A draw from the tail."""
    x, argument = f.slot("double"), f.slot("double")
    one, shrink = hexadecimal(1.0), hexadecimal(-(1 / TAIL))
    with f.loop() as finished:
        first = f.scalar("fsub", one, generator.uniform())
        second = f.scalar("fsub", one, generator.uniform())
        f.store(first, argument)
        size = f.scalar("fmul", functions.call("log", f, first), shrink)
        f.store(size, x)
        y = f.neg(functions.call("log", f, second))
        twice, square = f.scalar("fadd", y, y), f.scalar("fmul", size, size)
        sure = f.scalar("fmul", hexadecimal(SURE), f.scalar("fadd", one, square))
        note.doubtful(f.scalar("fsub", twice, square), sure)
        f.leave_if(f.test("ogt", twice, square), finished)
    note.down(f.load(argument))
    value = f.scalar("fadd", hexadecimal(TAIL), f.load(x))
    odd = f.test("ne", f.scalar("and", place, "256"), "0")
    f.store(f.let(f"select i1 {odd}, double {f.neg(value)}, double {value}"), draw)
