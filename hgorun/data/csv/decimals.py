"""Numbers from decimal digits, in machine code: correctly rounded, or left to the caller.

Up to 19 digits make an integer m, and the number is m 10^e. Where m and 10^|e| are doubles, one multiplication or
division rounds once. Else m is multiplied by the leading 128 bits of 10^e, which decides the rounding but for very rare
numbers (D. Lemire: Number parsing at a gigabyte per second. Software: Practice and Experience 51, 2021, algorithm of
M. Eisel).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from hgorun.native.ir import Function

LOWEST, HIGHEST = -340, 308
"""Exponents of ten that the tables have."""
_EXACT = 22  # the largest power of ten that is a double


@cache
def powers() -> np.ndarray:
    """Of every exponent the upper and the lower word of the leading 128 bits, and 10^|e| where that is a double."""
    table = np.zeros((HIGHEST - LOWEST + 1, 3), dtype=np.uint64)
    for row, exponent in enumerate(range(LOWEST, HIGHEST + 1)):
        leading = _leading(exponent)
        table[row, :2] = leading >> 64, leading & (2**64 - 1)
        if abs(exponent) <= _EXACT:
            table[row, 2] = np.float64(10.0 ** abs(exponent)).view(np.uint64)
    return table


def _leading(exponent: int) -> int:
    """The first 128 bits of 10^e, cut off behind them."""
    if exponent >= 0:
        power: int = 10**exponent
        shift = power.bit_length() - 128
        return power >> shift if shift >= 0 else power << -shift
    power = 10**-exponent
    return (1 << (127 + power.bit_length())) // power


def unsigned(f: Function, predicate: str, a: str, b: str) -> str:
    """Compare words without a sign: ``ult``, ``ugt``, ..."""
    return f.let(f"icmp {predicate} i64 {a}, {b}")


def chosen(f: Function, condition: str, yes: str, no: str) -> str:
    """One of two words."""
    return f.let(f"select i1 {condition}, i64 {yes}, i64 {no}")


def rounded(f: Function, mantissa: str, exponent: str, table: str, result: str, unknown: str) -> None:
    """Emit the bits of m 10^e into a slot; a jump to a label where they are not certain.

    Parameters
    ----------
    f : Function
    mantissa, exponent : str
        m, of 19 digits at most, and e.
    table : str
        Where :func:`powers` stand.
    result, unknown : str
        The slot, and the label.
    """
    mantissa, exponent = _without_zeros(f, mantissa, exponent)
    done, other, scaled, zero, nonzero = (f.label() for _ in range(5))
    f.branch(f.test("eq", mantissa, "0"), zero, nonzero)
    f.place(zero)
    f.store("0", result, "i64")
    f.jump(done)
    f.place(nonzero)
    unless(f, f.test("slt", exponent, str(LOWEST)), unknown)
    unless(f, f.test("sgt", exponent, str(HIGHEST)), unknown)
    row = f.at(table, f.scalar("mul", f.scalar("sub", exponent, str(LOWEST)), "3"))
    small = f.let(f"and i1 {unsigned(f, 'ult', mantissa, str(2**53))}, {_is_power(f, row)}")
    f.branch(small, scaled, other)
    f.place(scaled)
    power = f.word(row, 2, "double")
    number = f.let(f"uitofp i64 {mantissa} to double")
    product, quotient = f.scalar("fmul", number, power), f.scalar("fdiv", number, power)
    value = f.let(f"select i1 {f.test('slt', exponent, '0')}, double {quotient}, double {product}")
    f.store(f.let(f"bitcast double {value} to i64"), result, "i64")
    f.jump(done)
    f.place(other)
    _long(f, mantissa, exponent, row, result, unknown)
    f.jump(done)
    f.place(done)


def _without_zeros(f: Function, mantissa: str, exponent: str) -> tuple[str, str]:
    """Of a long m, without the zeros at its end: 5.000000000000000000e-01 is exact, which its product does not show."""
    m, e = f.slot("i64"), f.slot("i64")
    f.store(mantissa, m, "i64")
    f.store(exponent, e, "i64")
    with f.loop() as after:
        value = f.load(m, "i64")
        f.leave_if(unsigned(f, "ult", value, str(2**53)), after)
        tenth = f.scalar("udiv", value, "10")
        f.leave_if(f.test("ne", f.scalar("mul", tenth, "10"), value), after)
        f.store(tenth, m, "i64")
        f.store(f.scalar("add", f.load(e, "i64"), "1"), e, "i64")
    return f.load(m, "i64"), f.load(e, "i64")


def _is_power(f: Function, row: str) -> str:
    return f.test("ne", f.word(row, 2), "0")


def unless(f: Function, condition: str, label: str) -> None:
    """On, unless a condition leads to a label."""
    on = f.label()
    f.branch(condition, label, on)
    f.place(on)


def _long(f: Function, mantissa: str, exponent: str, row: str, result: str, unknown: str) -> None:
    """By the product of m with the leading bits of 10^e."""
    f.declarations.add("declare i64 @llvm.ctlz.i64(i64, i1)")
    zeros = f.let(f"call i64 @llvm.ctlz.i64(i64 {mantissa}, i1 true)")
    m = f.scalar("shl", mantissa, zeros)
    high, low = _product(f, m, f.word(row, 0))
    upper, lower = f.slot("i64"), f.slot("i64")
    f.store(high, upper, "i64")
    f.store(low, lower, "i64")
    # the bits behind the first 64 of the power may carry into those that decide
    with f.when(f.let(f"and i1 {_all_set(f, high)}, {unsigned(f, 'ult', f.scalar('add', low, m), m)}")):
        more, rest = _product(f, m, f.word(row, 1))
        wider = f.scalar("add", low, more)
        carried = f.let(f"zext i1 {unsigned(f, 'ult', wider, low)} to i64")
        merged = f.scalar("add", high, carried)
        full = f.let(f"and i1 {_all_set(f, merged)}, {f.test('eq', wider, '-1')}")
        open_ = f.let(f"and i1 {full}, {unsigned(f, 'ult', f.scalar('add', rest, m), m)}")
        unless(f, open_, unknown)
        f.store(merged, upper, "i64")
        f.store(wider, lower, "i64")
    high, low = f.load(upper, "i64"), f.load(lower, "i64")
    top = f.scalar("lshr", high, "63")
    cut = f.scalar("lshr", high, f.scalar("add", top, "9"))  # 54 bits
    exact = f.let(f"and i1 {f.test('eq', low, '0')}, {f.test('eq', f.scalar('and', high, '511'), '0')}")
    halfway = f.let(f"and i1 {exact}, {f.test('eq', f.scalar('and', cut, '3'), '1')}")
    unless(f, halfway, unknown)
    even = f.scalar("lshr", f.scalar("add", cut, f.scalar("and", cut, "1")), "1")
    over = f.scalar("lshr", even, "53")
    bits = f.scalar("lshr", even, over)
    # floor(e log2 10) + 64 + bias, less what m was shifted by
    power = f.scalar("add", f.scalar("ashr", f.scalar("mul", exponent, "217706"), "16"), "1087")
    power = f.scalar("sub", f.scalar("sub", power, zeros), f.scalar("xor", top, "1"))
    power = f.scalar("add", power, over)
    unless(f, f.test("slt", power, "1"), unknown)
    unless(f, f.test("sgt", power, "2046"), unknown)
    fraction = f.scalar("and", bits, str(2**52 - 1))
    f.store(f.scalar("or", f.scalar("shl", power, "52"), fraction), result, "i64")


def _all_set(f: Function, word: str) -> str:
    """Whether the nine bits that are cut off are all set."""
    return f.test("eq", f.scalar("and", word, "511"), "511")


def _product(f: Function, a: str, b: str) -> tuple[str, str]:
    """The upper and the lower word of a product."""
    wide = [f.let(f"zext i64 {word} to i128") for word in (a, b)]
    product = f.let(f"mul i128 {wide[0]}, {wide[1]}")
    upper = f.let(f"trunc i128 {f.let(f'lshr i128 {product}, 64')} to i64")
    return upper, f.let(f"trunc i128 {product} to i64")
