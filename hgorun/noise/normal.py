"""Normal draws that have the same bits on every machine: those of NumPy's ziggurat, without a C library.

Nearly every draw is a product of two numbers, which all machines round alike. The others need a logarithm or an
exponential, whose last bits depend on the library and on the processor. Here they are decimal numbers of many
digits, rounded once: draws behind 3.65 standard deviations, one in 4,000, may differ from NumPy's in the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from decimal import Context, Decimal

import numpy as np
from numpy.typing import NDArray

from hgorun.noise.ziggurat import EDGES

Words = NDArray[np.uint64]
LAYERS = np.array(EDGES)
WIDTHS = LAYERS * 2.0**-52
TAIL = EDGES[-1]
SURE = 1e-12  # by how much two numbers near 1 differ that no rounding can exchange
# for every layer the first place that is not inside the layer above; none is in the lowest but one
INSIDE: Words = (np.concatenate([LAYERS[-1:] / LAYERS[:1], [0.0], LAYERS[1:-1] / LAYERS[2:]]) * 2.0**52).astype(
    np.uint64
)
_DIGITS, _FEWER_DIGITS = Context(prec=50), Context(prec=25)
_BESIDE = Decimal("1.0000000000000000000001"), Decimal("0.9999999999999999999999")  # further than 25 digits err
_SPARE = 25  # one word in so many is for draws that take more than one


def standard_normal(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Normal draws of mean 0 and variance 1, shape (count,): the first ones are the same, whatever the count."""
    return normal_and_used(random, count)[0]


def normal_and_used(random: np.random.Generator, count: int) -> tuple[NDArray[np.float64], int]:
    """The same, and how many words of the generator they take; it has given more."""
    bits = random.bit_generator
    words: Words = bits.random_raw(count + count // _SPARE + 64)
    while True:
        try:
            return _normal(words, count)
        except IndexError:  # more of them were taken than expected
            words = np.concatenate([words, bits.random_raw(words.size)])


def _normal(words: Words, count: int) -> tuple[NDArray[np.float64], int]:
    """Draws from random words, and how many words they take.

    A word has 8 bits for the layer, one for the sign, and 52 for a place in the layer. Inside the layer above it is
    taken; else the words that follow decide.

    Raises
    ------
    IndexError
        Where there are too few words.
    """
    layer, place = words & np.uint64(255), (words >> np.uint64(9)) & np.uint64(2**52 - 1)
    values = place * WIDTHS[layer]
    values = np.where(words & np.uint64(256), -values, values)
    draws, made, at = np.empty(count), 0, 0
    for doubtful in np.flatnonzero(place >= INSIDE[layer]):
        if doubtful < at:  # it has decided another one
            continue
        taken = min(int(doubtful) - at, count - made)
        draws[made : made + taken] = values[at : at + taken]
        made, at = made + taken, at + taken
        if made == count:
            return draws, at
        uniform = _uniform(words, at + 1)
        if layer[at]:
            kept = _is_below(float(values[at]), int(layer[at]), next(uniform))
            if kept:
                draws[made] = values[at]
            at += 2
        else:
            kept, (size, used) = True, _behind(uniform)
            draws[made] = -size if place[at] >> np.uint64(8) & np.uint64(1) else size
            at += 1 + used
        made += kept
    if values.size - at < count - made:
        raise IndexError("too few words")
    draws[made:] = values[at : at + count - made]
    return draws, at + count - made


def _uniform(words: Words, at: int) -> Iterator[float]:
    """Uniform draws from [0, 1), a word each."""
    while True:
        yield int(words[at] >> np.uint64(11)) * 2.0**-53
        at += 1


def _is_below(x: float, layer: int, u: float) -> bool:
    """Whether f(b) + u (f(a) - f(b)) < f(x) with f(x) = exp(-x²/2), between the edges a, b of a layer."""
    low, high = EDGES[layer], EDGES[layer - 1] if layer > 1 else 0.0
    left, right = math.exp(-low * low / 2), math.exp(-x * x / 2)
    left += u * (math.exp(-high * high / 2) - left)
    if abs(left - right) > SURE:
        return left < right
    f = [_DIGITS.exp(_DIGITS.multiply(Decimal(v), Decimal(-v / 2))) for v in (low, high, x)]
    return _DIGITS.add(f[0], _DIGITS.multiply(Decimal(u), _DIGITS.subtract(f[1], f[0]))) < f[2]


def _behind(uniform: Iterator[float]) -> tuple[float, int]:
    """A draw from the tail, and how many uniform draws it takes."""
    used = 0
    while True:
        x, y = beyond(1 - next(uniform)), -_log(1 - next(uniform))
        used += 2
        if y + y > x * x:
            return TAIL + x, used


def beyond(u: float) -> float:
    """How far behind the tail's edge a uniform draw from (0, 1] leads."""
    return -(1 / TAIL) * _log(u)


def _log(x: float) -> float:
    """The logarithm, rounded correctly: half as many digits nearly always tell, in a third of the time."""
    value = _FEWER_DIGITS.ln(Decimal(x))
    ends = {float(_FEWER_DIGITS.multiply(value, factor)) for factor in _BESIDE}
    return ends.pop() if len(ends) == 1 else float(_DIGITS.ln(Decimal(x)))
