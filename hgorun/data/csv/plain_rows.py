"""Rows of a text in machine code: numbers between separators, where dates stand, and cells that nobody wants.

The code stops at the first row with a quote, a comment, another number of cells, or a cell that is neither a plain
number nor empty nor NaN. What it takes are words: addresses and numbers; the last one, the byte to begin with, it
changes to the one at which it has stopped.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from hgorun.data.csv.decimals import chosen, rounded, unsigned
from hgorun.data.csv.digits import TENS, Text, every, first_byte, of_eight, usual
from hgorun.native.compiler import NativeModule
from hgorun.native.ir import Function

WORDS = ("text", "size", "width", "separator", "decimal", "comment", "plan", "kinds", "powers", "position")
_NAN = str(np.float64(np.nan).view(np.int64))
_SIGN = str(-(2**63))
_DIGITS = 19  # that a word holds, whatever they are


class _Code:
    """The compiled function."""

    def __init__(self) -> None:
        native = NativeModule(_ir(), ("rows",))
        self.run = native.function("rows", ctypes.c_int64, ctypes.c_void_p)


code = cache(_Code)


def _ir() -> str:
    declarations: set[str] = set()
    f = Function("rows", "ptr %taken", 1, declarations, returns="i64")
    _Rows(f).emit()
    return "\n".join([*sorted(declarations), f.text("dso_local")])


class _Rows:
    """The function: rows, their cells, the number in a cell."""

    def __init__(self, f: Function) -> None:
        self.f = f
        pointers = ("text", "plan", "kinds", "powers")
        self.given = {name: f.word("%taken", i, "ptr" if name in pointers else "i64") for i, name in enumerate(WORDS)}
        self.place, self.row = f.slot("i64"), f.slot("i64")  # the next byte, and the number of the row
        self.stop = f.label()
        self.text = Text(f, self.given["text"], self.given["size"])

    def emit(self) -> None:
        """Rows until one is not plain."""
        f = self.f
        begin = f.slot("i64")
        f.store(self.given["position"], begin, "i64")
        f.store("0", self.row, "i64")
        with f.loop():
            place = f.load(begin, "i64")
            f.leave_if(f.test("sge", place, self.text.size), self.stop)
            first = self.text.byte(place)
            for sign in (ord("\n"), self.given["comment"], ord(" "), ord("\t")):
                f.leave_if(f.test("eq", first, str(sign)), self.stop)
            f.store(place, self.place, "i64")
            with f.count(0, self.given["width"]) as column:
                self.cell(column)
            f.store(f.load(self.place, "i64"), begin, "i64")
            f.store(f.scalar("add", f.load(self.row, "i64"), "1"), self.row, "i64")
        f.do("unreachable")  # a loop is left to where it stops
        f.place(self.stop)
        f.store(f.load(begin, "i64"), f.at("%taken", len(WORDS) - 1), "i64")
        f.do(f"ret i64 {f.load(self.row, 'i64')}")

    def here(self) -> str:
        """The next byte."""
        return self.text.byte(self.f.load(self.place, "i64"))

    def on(self) -> None:
        """To the byte behind it."""
        f = self.f
        f.store(f.scalar("add", f.load(self.place, "i64"), "1"), self.place, "i64")

    def cell(self, column: str) -> None:
        """A cell and what ends it: a separator, behind the last one a newline."""
        f = self.f
        skipped, wanted, any_, end, on = (f.label() for _ in range(5))
        last = f.test("eq", column, f.scalar("sub", self.given["width"], "1"))
        expected = chosen(f, last, str(ord("\n")), self.given["separator"])
        address = f.word(self.given["plan"], column)
        spans = f.test("ne", f.word(self.given["kinds"], column), "0")
        f.branch(f.let(f"or i1 {spans}, {f.test('eq', address, '0')}"), skipped, wanted)
        f.place(skipped)
        start = f.load(self.place, "i64")
        self.skip()
        with f.when(spans):  # where a date stands, and how long it is
            length = f.scalar("sub", f.load(self.place, "i64"), start)
            span = f.scalar("or", f.scalar("shl", start, "32"), length)
            f.store(span, f.at(f.let(f"inttoptr i64 {address} to ptr"), f.load(self.row, "i64")), "i64")
        f.jump(end)
        f.place(wanted)
        bits = f.slot("i64")
        end_of = usual(f, self.text, f.load(self.place, "i64"), (self.given["decimal"], expected), bits, any_)
        f.store(end_of, self.place, "i64")
        f.store(f.load(bits, "i64"), f.at(f.let(f"inttoptr i64 {address} to ptr"), f.load(self.row, "i64")), "i64")
        f.jump(on)
        f.place(any_)
        self.spaces()
        self.number(bits)
        self.spaces()
        f.store(f.load(bits, "i64"), f.at(f.let(f"inttoptr i64 {address} to ptr"), f.load(self.row, "i64")), "i64")
        f.jump(end)
        f.place(end)
        f.leave_if(f.test("ne", self.here(), expected), self.stop)
        f.jump(on)
        f.place(on)
        self.on()

    def skip(self) -> None:
        """Anything but quotes, which may hold separators."""
        f = self.f
        with f.loop() as after:
            found = self.here()
            f.leave_if(f.test("eq", found, self.given["separator"]), after)
            f.leave_if(f.test("eq", found, str(ord("\n"))), after)
            f.leave_if(f.test("eq", found, str(ord('"'))), self.stop)
            self.on()

    def spaces(self) -> None:
        """Spaces around a number."""
        f = self.f
        with f.loop() as after:
            f.leave_if(f.test("ne", self.here(), str(ord(" "))), after)
            self.on()

    def number(self, bits: str) -> None:
        """A number, or NaN for nothing and for NaN."""
        f = self.f
        done = f.label()
        f.store(_NAN, bits, "i64")
        first = self.here()
        for sign in (self.given["separator"], str(ord("\n"))):
            f.leave_if(f.test("eq", first, sign), done)
        self.nan(first, done)
        negative = self.minus(first)
        mantissa, digits = f.slot("i64"), f.slot("i64")
        f.store("0", mantissa, "i64")
        f.store("0", digits, "i64")
        before = self.digits(mantissa, digits)
        behind = f.slot("i64")
        f.store("0", behind, "i64")
        with f.when(f.test("eq", self.here(), self.given["decimal"])):
            self.on()
            f.store(self.digits(mantissa, digits), behind, "i64")
        fraction = f.load(behind, "i64")
        f.leave_if(f.test("eq", f.scalar("add", before, fraction), "0"), self.stop)
        f.leave_if(f.test("sgt", f.load(digits, "i64"), str(_DIGITS)), self.stop)
        exponent = f.scalar("sub", self.exponent(), fraction)
        rounded(f, f.load(mantissa, "i64"), exponent, self.given["powers"], bits, self.stop)
        sign = chosen(f, negative, _SIGN, "0")
        f.store(f.scalar("or", f.load(bits, "i64"), sign), bits, "i64")
        f.jump(done)
        f.place(done)

    def minus(self, sign: str) -> str:
        """Whether the next byte is a minus; on, if that or a plus stands there."""
        f = self.f
        negative = f.test("eq", sign, str(ord("-")))
        with f.when(f.let(f"or i1 {negative}, {f.test('eq', sign, str(ord('+')))}")):
            self.on()
        return negative

    def nan(self, first: str, done: str) -> None:
        """NaN in small or capital letters."""
        f = self.f
        with f.when(f.test("eq", f.scalar("or", first, "32"), str(ord("n")))):
            self.on()
            for letter in "an":
                f.leave_if(f.test("ne", f.scalar("or", self.here(), "32"), str(ord(letter))), self.stop)
                self.on()
            f.jump(done)
            f.place(f.label())  # nothing comes here

    def digits(self, mantissa: str, count: str) -> str:
        """Digits, as many as there are; their number. Zeros in front do not count."""
        f = self.f
        start, done = f.load(self.place, "i64"), f.label()
        self.eights(mantissa, count, done)
        with f.loop():  # at the end of a text
            digit = f.scalar("sub", self.here(), str(ord("0")))
            f.leave_if(unsigned(f, "ugt", digit, "9"), done)
            value = f.scalar("add", f.scalar("mul", f.load(mantissa, "i64"), "10"), digit)
            f.store(value, mantissa, "i64")
            counts = f.let(f"zext i1 {f.test('ne', value, '0')} to i64")
            f.store(f.scalar("add", f.load(count, "i64"), counts), count, "i64")
            self.on()
        f.do("unreachable")
        f.place(done)
        return f.scalar("sub", f.load(self.place, "i64"), start)

    def eights(self, mantissa: str, count: str, done: str) -> None:
        """Up to eight digits at once, while the text has so many bytes; to a label, where what follows is none."""
        f = self.f
        with f.loop() as after:
            place, before = f.load(self.place, "i64"), f.load(mantissa, "i64")
            f.leave_if(f.test("sgt", place, f.scalar("sub", self.text.size, "8")), after)
            word = self.text.word(place)
            above, below = f.scalar("add", word, every(0x46)), f.scalar("sub", word, every(0x30))
            outside = f.scalar("and", f.scalar("or", above, below), every(0x80))  # right up to the first that is
            some = first_byte(f, outside)
            f.leave_if(f.test("eq", some, "0"), done)
            digits = f.scalar("shl", below, f.scalar("sub", "64", f.scalar("shl", some, "3")))  # behind zeros
            value = f.scalar("add", f.scalar("mul", before, f.word(TENS, some)), of_eight(f, digits))
            f.store(value, mantissa, "i64")
            significant = f.scalar("sub", "8", first_byte(f, digits))
            counts = chosen(f, f.test("eq", before, "0"), significant, some)
            f.store(f.scalar("add", f.load(count, "i64"), counts), count, "i64")
            f.store(f.scalar("add", place, some), self.place, "i64")
            f.leave_if(f.test("ne", some, "8"), done)

    def exponent(self) -> str:
        """The number behind e; 0 without one."""
        f = self.f
        value = f.slot("i64")
        f.store("0", value, "i64")
        with f.when(f.test("eq", f.scalar("or", self.here(), "32"), str(ord("e")))):
            self.on()
            negative = self.minus(self.here())
            size, digits = f.slot("i64"), f.slot("i64")
            f.store("0", size, "i64")
            f.store("0", digits, "i64")
            there = self.digits(size, digits)
            f.leave_if(f.test("eq", there, "0"), self.stop)
            f.leave_if(f.test("sgt", f.load(digits, "i64"), "5"), self.stop)
            found = f.load(size, "i64")
            f.store(chosen(f, negative, f.scalar("sub", "0", found), found), value, "i64")
        return f.load(value, "i64")
