"""Decimal digits in machine code, up to eight at once: a word of the text has them, the first in its lowest byte."""

from __future__ import annotations

from hgorun.data.csv.decimals import unless, unsigned
from hgorun.native.ir import Function

TENS = "@tens"
"""Where 10^0 to 10^8 stand."""
_SEEN = 16  # bytes among which the ends of a number are looked for
_DECLARED = {
    f"{TENS} = private constant [9 x i64] [{', '.join(f'i64 {10**k}' for k in range(9))}]",
    "declare i64 @llvm.cttz.i64(i64, i1)",
}


class Text:
    """The bytes that a function reads.

    Parameters
    ----------
    f : Function
    address, size : str
        Where they stand, and how many there are.
    """

    def __init__(self, f: Function, address: str, size: str) -> None:
        self._f, self._address, self.size = f, address, size
        f.declarations |= _DECLARED

    def _load(self, place: str, kind: str) -> str:
        f = self._f
        return f.let(f"load {kind}, ptr {f.let(f'getelementptr i8, ptr {self._address}, i64 {place}')}, align 1")

    def byte(self, place: str) -> str:
        """A byte."""
        return self._f.let(f"zext i8 {self._load(place, 'i8')} to i64")

    def word(self, place: str) -> str:
        """Eight bytes."""
        return self._load(place, "i64")

    def others(self, place: str) -> str:
        """Which of the next sixteen bytes are no digits, as bits."""
        f, kind = self._f, f"<{_SEEN} x i8>"
        zeros, nines = (f"<{', '.join([f'i8 {one}'] * _SEEN)}>" for one in (ord("0"), 9))
        digits = f.let(f"sub {kind} {self._load(place, kind)}, {zeros}")
        found = f.let(f"icmp ugt {kind} {digits}, {nines}")
        return f.let(f"zext i{_SEEN} {f.let(f'bitcast <{_SEEN} x i1> {found} to i{_SEEN}')} to i64")


def usual(f: Function, text: Text, place: str, signs: tuple[str, str], result: str, other: str) -> str:
    """Emit the bits of a number as most are into a slot; a jump to a label where it is another one.

    Such a number has up to eight digits on both sides of a decimal sign, and sixteen bytes hold it with what ends it.
    Its digits make an integer below 10^14, which is a double as 10^e is: one division rounds once.

    Parameters
    ----------
    f : Function
    text : Text
    place : str
        Where the number begins.
    signs : (str, str)
        The decimal sign, and what ends the cell.
    result, other : str
        The slot, and the label.

    Returns
    -------
    str
        Where the number ends.
    """
    unless(f, f.test("slt", place, "9"), other)  # digits are read with the bytes before them
    unless(f, f.test("sgt", place, f.scalar("sub", text.size, str(_SEEN))), other)
    others = text.others(place)
    signed = f.scalar("and", others, "1")
    minus = f.test("eq", text.byte(place), str(ord("-")))
    unless(f, f.test("ne", signed, f.let(f"zext i1 {minus} to i64")), other)
    others = f.scalar("and", others, "-2")
    point, end = _first_bit(f, others), _first_bit(f, f.scalar("and", others, f.scalar("sub", others, "1")))
    before, behind = f.scalar("sub", point, signed), f.scalar("sub", end, f.scalar("add", point, "1"))
    for count in (before, behind):
        unless(f, unsigned(f, "ugt", f.scalar("sub", count, "1"), "7"), other)
    point, end = f.scalar("add", place, point), f.scalar("add", place, end)
    for at, sign in zip((point, end), signs, strict=True):
        unless(f, f.test("ne", text.byte(at), sign), other)
    power, count, mantissa = f.word(TENS, behind), f.scalar("add", before, behind), f.slot("i64")
    together, apart, done = f.label(), f.label(), f.label()
    f.branch(f.test("sle", count, "8"), together, apart)
    f.place(together)  # those in front of the sign stand one byte before their place
    word, shifted = (text.word(f.scalar("sub", end, back)) for back in "89")
    different = f.scalar("and", f.scalar("xor", word, shifted), _last(f, behind))
    f.store(_number_of(f, f.scalar("xor", different, shifted), count), mantissa, "i64")
    f.jump(done)
    f.place(apart)
    words = [(text.word(f.scalar("sub", stop, "8")), of) for stop, of in ((point, before), (end, behind))]
    upper, lower = (_number_of(f, *one) for one in words)
    f.store(f.scalar("add", f.scalar("mul", upper, power), lower), mantissa, "i64")
    f.jump(done)
    f.place(done)
    size, scale = (f.let(f"sitofp i64 {one} to double") for one in (f.load(mantissa, "i64"), power))
    bits = f.let(f"bitcast double {f.scalar('fdiv', size, scale)} to i64")
    f.store(f.scalar("or", bits, f.scalar("shl", signed, "63")), result, "i64")
    return end


def _number_of(f: Function, word: str, count: str) -> str:
    """The number of the last digits in a word, of one to eight."""
    return of_eight(f, f.scalar("and", f.scalar("xor", word, every(ord("0"))), _last(f, count)))


def _last(f: Function, count: str) -> str:
    """A word whose last bytes are set, so many of them, from one to eight."""
    return f.scalar("shl", "-1", f.scalar("sub", "64", f.scalar("shl", count, "3")))


def every(byte: int) -> str:
    """A word of eight equal bytes."""
    return str(int.from_bytes(bytes([byte] * 8), "little", signed=True))


def first_byte(f: Function, word: str) -> str:
    """Which byte is the first that is not zero; 8 where all are."""
    return f.scalar("lshr", _first_bit(f, word), "3")


def _first_bit(f: Function, word: str) -> str:
    """Which bit is the first that is set; 64 where none is."""
    return f.let(f"call i64 @llvm.cttz.i64(i64 {word}, i1 false)")


def of_eight(f: Function, digits: str) -> str:
    """The number of eight digits, the first in the lowest byte: pairs, then pairs of pairs, then all."""
    pairs = f.scalar("add", f.scalar("mul", digits, "10"), f.scalar("lshr", digits, "8"))
    low = f.scalar("and", pairs, str(0x000000FF000000FF))
    high = f.scalar("and", f.scalar("lshr", pairs, "16"), str(0x000000FF000000FF))
    left = f.scalar("mul", low, str(100 + (10**6 << 32)))
    right = f.scalar("mul", high, str(1 + (10**4 << 32)))
    return f.scalar("lshr", f.scalar("add", left, right), "32")
