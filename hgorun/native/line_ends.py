"""How many lines a text has, and whether it is plain, in one pass."""

from __future__ import annotations

import numpy as np

from hgorun.native.ir import Function
from hgorun.native.passes import Passes

_TOGETHER = 64  # bytes
_NEWLINE = ord("\n")


def newlines_of(text: bytes) -> tuple[int, bool]:
    """How many newlines there are, and whether all is ASCII without zero bytes and carriage returns."""
    found = _passes("newlines", [np.frombuffer(text, dtype=np.uint8)], [len(text)])
    return (found, True) if found >= 0 else (-1 - found, False)


def _newlines(f: Function) -> None:
    """Their number; of a text that is not plain -1 less it."""
    text, size = f.word("%taken", 0, "ptr"), f.word("%taken", 1)
    pieces = f.scalar("lshr", size, str(_TOGETHER.bit_length() - 1))
    f.declarations.add("declare i64 @llvm.ctpop.i64(i64)")
    count, others = f.slot("i64"), f.slot("i64")
    f.store("0", count, "i64")
    f.store("0", others, "i64")

    def look(place: str, bytes_: int) -> None:
        """At some bytes from a place on."""
        kind = f"<{bytes_} x i8>"
        address = f.let(f"getelementptr i8, ptr {text}, i64 {place}")
        some = f.let(f"load {kind}, ptr {address}, align 1")

        def which(predicate: str, byte: int) -> str:
            of_each = f.let(f"icmp {predicate} {kind} {some}, <{', '.join([f'i8 {byte}'] * bytes_)}>")
            bits = f.let(f"bitcast <{bytes_} x i1> {of_each} to i{bytes_}")
            return bits if bytes_ == _TOGETHER else f.let(f"zext i{bytes_} {bits} to i64")

        newlines = f.let(f"call i64 @llvm.ctpop.i64(i64 {which('eq', _NEWLINE)})")
        f.store(f.scalar("add", f.load(count, "i64"), newlines), count, "i64")
        odd = f.scalar("or", which("sle", 0), which("eq", ord("\r")))  # bytes from 128 on have a sign
        f.store(f.scalar("or", f.load(others, "i64"), odd), others, "i64")

    with f.count(0, pieces) as k:
        look(f.scalar("mul", k, str(_TOGETHER)), _TOGETHER)
    with f.count(f.scalar("mul", pieces, str(_TOGETHER)), size) as k:
        look(k, 1)
    found = f.load(count, "i64")
    plain, negative = f.test("eq", f.load(others, "i64"), "0"), f.scalar("sub", "-1", found)
    f.do(f"ret i64 {f.let(f'select i1 {plain}, i64 {found}, i64 {negative}')}")


_passes = Passes({"newlines": _newlines})
