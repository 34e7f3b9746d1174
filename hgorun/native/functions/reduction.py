"""Large arguments of sin, cos and tan, less a multiple of π/2 (Payne and Hanek)."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from hgorun.native.functions.arithmetic import SIGN, Pair, flip, integer, ordered_sum, product
from hgorun.native.functions.coefficients import PI
from hgorun.native.ir import Block

# 64 zeros, then the binary digits of 2/π: 1033 for the exponent of the largest double and 192 for the product
_DIGITS = (
    0x0000000000000000,
    0xA2F9836E4E441529,
    0xFC2757D1F534DDC0,
    0xDB6295993C439041,
    0xFE5163ABDEBBC561,
    0xB7246E3A424DD2E0,
    0x06492EEA09D1921C,
    0xFE1DEB1CB129A73E,
    0xE88235F52EBB4484,
    0xE99C7026B45F7E41,
    0x3991D639835339F4,
    0x9C845F8BBDF9283B,
    0x1FF897FFDE05980F,
    0xEF2F118B5A0A6D1F,
    0x6D367ECF27CB09B7,
    0x4F463F669E5FEA2D,
    0x7527BAC7EBE5F17B,
    0x3D0739F78A5292EA,
    0x6BFB5FB11F8D5D08,
    0x56033046FC7B6BAB,
    0xF0CFBC209AF4361D,
    0xA9E391615EE61B08,
)
_TABLE = (
    f"@hgorun_two_over_pi = internal constant [{len(_DIGITS)} x i64] [" + ", ".join(f"i64 {w}" for w in _DIGITS) + "]"
)


class Turns(NamedTuple):
    """A number modulo 4 in units of 2^-190, as the 64-bit words of an integer."""

    high: str
    middle: str
    low: str


def quarter_turns(block: Block, a: str) -> Turns:
    """a·2/π modulo 4 to 2^-137, for finite a >= 2^12 on one lane.

    a = m 2^e. Digits of 2/π whose product with a is a multiple of 4 do not count: it is m times the 192 digits
    that follow, modulo 2^192.
    """
    block.declarations.update({_TABLE, "declare i64 @llvm.fshl.i64(i64, i64, i64)"})
    bits = block.bits(a)
    m = integer(block, "or", integer(block, "and", bits, 2**52 - 1), 2**52)
    # the digit e - 1 is the first that counts, and bit e + 62 of the table
    first = integer(block, "sub", integer(block, "lshr", bits, 52), 1075 - 62)
    word, shift = integer(block, "lshr", first, 6), integer(block, "and", first, 63)
    entries = []
    for i in range(4):
        at = block.let(f"getelementptr i64, ptr @hgorun_two_over_pi, i64 {integer(block, 'add', word, i)}")
        entries.append(block.let(f"load i64, ptr {at}"))
    high, middle, low = (_shifted(block, a, b, shift) for a, b in pairwise(entries))
    carried, last = _product(block, m, low)
    top, second = _product(block, m, middle)
    middle = integer(block, "add", second, carried)
    carry = block.let(f"zext i1 {block.let(f'icmp ult i64 {middle}, {second}')} to i64")
    top = integer(block, "add", integer(block, "add", top, carry), integer(block, "mul", m, high))
    return Turns(top, middle, last)


def _product(block: Block, a: str, b: str) -> tuple[str, str]:
    """High and low word of the product of two words."""
    a, b = block.let(f"zext i64 {a} to i128"), block.let(f"zext i64 {b} to i128")
    whole = block.let(f"mul i128 {a}, {b}")
    high = block.let(f"lshr i128 {whole}, 64")
    return block.let(f"trunc i128 {high} to i64"), block.let(f"trunc i128 {whole} to i64")


def _shifted(block: Block, high: str, low: str, shift: str | int) -> str:
    """The high word, shifted up with the bits of the low one following."""
    return block.let(f"call i64 @llvm.fshl.i64(i64 {high}, i64 {low}, i64 {shift})")


def nearest(block: Block, turns: Turns, unit: int) -> tuple[str, Pair]:
    """k and r of a = (k unit + r) π/2, k the nearest integer modulo 4/unit, for a unit of 1 or 2; r is an angle."""
    whole = 3 - unit  # bits
    k = integer(block, "lshr", integer(block, "add", turns.high, 2 ** (63 - whole)), 64 - whole)
    # without the bits of k, and those of the rest shifted up, a signed number
    high, low = _shifted(block, turns.high, turns.middle, whole), _shifted(block, turns.middle, turns.low, whole)
    # its size: the bits turned over where it is negative; the 1 to add then does not count
    sign, turned = integer(block, "and", high, SIGN), integer(block, "ashr", high, 63)
    words = [integer(block, "xor", w, turned) for w in (high, low)]
    halves = [part for w in words for part in (integer(block, "lshr", w, 32), integer(block, "and", w, 2**32 - 1))]
    terms = [
        block.mul(block.let(f"sitofp i64 {w} to double"), block.constant(2.0 ** (-32 * (i + 1))))
        for i, w in enumerate(halves)
    ]
    upper, lower = ordered_sum(block, terms[0], terms[1]), ordered_sum(block, terms[2], terms[3])
    total = ordered_sum(block, upper.high, lower.high)
    total = ordered_sum(block, total.high, block.add(total.low, block.add(upper.low, lower.low)))
    r = product(block, total, Pair(block.constant(unit * PI[0] / 2), block.constant(unit * PI[1] / 2)))
    return k, Pair(flip(block, r.high, sign), flip(block, r.low, sign))
