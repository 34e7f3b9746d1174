"""Units with a number: ``0.1 degC``, ``10^3 m3/h``, ``g/100mL`` are known units times a factor."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

from hgorun.patterns import Pattern

_DIGITS = r"(?:\d{1,3}(?:[ \u00a0\u2009\u202f]\d{3})+|\d{1,20}(?:[.,]\d{1,20})?|\.\d{1,20})(?:[eE][-+]?\d{1,2})?"
_HIGH = r"⁰¹²³⁴⁵⁶⁷⁸⁹"
_TEN = rf"10(?:\s?(?:\^|\*\*)\s?(?:\([-+−]?\d{{1,2}}\)|[-+−]?\d{{1,2}})|[⁻⁺]?[{_HIGH}]{{1,2}}|[-−][1-9](?![\d.,]))"
_NUMBER = rf"(?:(?:{_DIGITS}\s*[x×*·]\s*)?{_TEN}|{_DIGITS})(?![\d.,^{_HIGH}⁻]|[eE][-+]?\d)"
_UNIT = rf"(?=[^\W\d_{_HIGH}]|[°º˚Â%‰])"  # begins
_TIMES = r"\s*[x×*·]?\s*"

_WORDS = {"tsd": "1000", "thousand": "1000", "mio": "1e6", "mln": "1e6", "million": "1e6", "mrd": "1e9"}
_WORD = Pattern(rf"({'|'.join(_WORDS)})\.?\s+(?=\S)", re.IGNORECASE)  # Mio m3
_BEFORE = Pattern(rf"({_NUMBER}){_TIMES}(\(?{_UNIT}.*|/.*|1/\D.*)", re.DOTALL)
_PART = Pattern(rf"1\s*/\s*(\d{{1,6}}){_TIMES}({_UNIT}.*)")  # of a unit, or one per several: 1/10 K, 1/24 h
_PER = Pattern(rf"(/|\sper\s)\s*(\(?)\s*({_NUMBER}){_TIMES}{_UNIT}")
_OVER = Pattern(rf"(.*[^\W_])\s*/\s*({_NUMBER})")
_MULTIPLIED = (
    Pattern(rf"[xX×*·]\s*(?P<number>{_NUMBER}){_TIMES}(?P<unit>\(?{_UNIT}.*)"),
    Pattern(rf"(?P<unit>\D.*?)(?:\s+[xX]|\s*[×*·]|\s*\(\s*[xX×*·])\s*(?P<number>{_NUMBER})\s*\)?"),
    Pattern(rf"(?P<unit>\D.*?)\s+(?P<number>{_TEN}|[eE][-+]?\d{{1,2}})"),
)
_UNCLEAR = Pattern(r"10[3-9]|[1-9]\d{0,2}[.,]\d{3}")  # a power of ten or a number; digits in groups or a fraction
_BEGINS = Pattern(rf"(?:[-+~<>=≤≥±xX×*]\s*)*\d[\W\deE_{_HIGH}]*?{_TIMES}(\(?(?![eE][-+]?\d){_UNIT}.*)")
_UNREAD = Pattern(rf"(?<![\w^*.,⁻−-])\d[\d.,]*{_TIMES}(?=\D)")
_ALONE = Pattern(rf"[xX]\s*(?:{_TEN}|10+|0[.,]0*1)|[×*/]\s*{_NUMBER}|{_TEN}|\d{{1,20}}(?:[.,]\d+)?[eE][-+]?\d{{1,2}}")
_ORDINAL = Pattern(r"(?:st|nd|rd|th)(?!\w)")
_HAS_NUMBER = Pattern(r"(?<![\w^*.,⁻−-])(?!1\s*/\s*\D)[.,]?\d")
_LONGEST = 200  # letters of a unit
_LEAST = Fraction(1, 10**100)
_PLAIN_HIGH = str.maketrans(_HIGH + "⁻⁺−", "0123456789-+-")


def parted(text: str) -> tuple[Fraction, str]:
    """The number that a unit is multiplied by, and the unit without it; 1 and the text where no number can be read.

    A number behind a bar belongs to what follows: ``g/100 mL`` is a gram in 100 mL. One alone is no unit, and
    ``x10 degC`` leaves open what is ten times as large, see :func:`asked`.
    """
    if text.isalpha():  # as most are
        return Fraction(1), text
    factor, rest = Fraction(1), text.strip() if len(text) <= _LONGEST else ""
    if word := _WORD.match(rest):
        rest = f"{_WORDS[word[1].lower()]} {rest[word.end() :]}"
    if (match := _PART.fullmatch(rest)) and _is_power_of_ten(match[1]):
        return Fraction(1, int(match[1])), match[2]
    if match := _BEFORE.fullmatch(rest):
        number = _value(match[1])
        if number is None or _ORDINAL.match(match[2]):
            return Fraction(1), text
        if not (number == 1 and match[2][0] == "/"):  # 1/min
            factor, rest = number, f"1{match[2]}" if match[2][0] == "/" else match[2]
    while match := _PER.search(rest):
        number = _value(match[3])
        if number is None:
            return Fraction(1), text
        factor, rest = factor / number, f"{rest[: match.start()]}/{match[2]}{rest[match.end() :]}"
    if match := _OVER.fullmatch(rest):
        number = _value(match[2])
        if number is None:
            return Fraction(1), text
        factor, rest = factor / number, match[1]
    found = rest not in (text.strip(), "") and _LEAST < factor < 1 / _LEAST
    return (factor, rest) if found else (Fraction(1), text)


def has_factor(text: str) -> bool:
    """Whether a number can be read in a text that may be a unit."""
    return parted(text)[1] != text


def joined(factor: Fraction, unit: str) -> str:
    """A unit with a number as :func:`parted` reads it."""
    if factor == 1:
        return unit
    short = f"{float(factor):.12g}"
    return f"{short if Fraction(short) == factor else repr(float(factor))} {unit}"


def asked(text: str) -> Iterator[str]:
    """What may be meant by a unit that leaves open what is multiplied.

    ``x10 degC`` are tens of degrees, or numbers that are ten times as large. ``1/10 s``, read as a part of a second,
    may be once in ten seconds, and ``1/2 in`` the other way round.
    """
    text = text.strip()
    if match := _PART.fullmatch(text):
        of_unit = not _is_power_of_ten(match[1]) and int(match[1])
        yield joined(Fraction(1, of_unit), match[2]) if of_unit else f"1/({match[1]} {match[2]})"
        return
    for pattern in _MULTIPLIED:
        if match := pattern.fullmatch(text):
            number = match["number"]
            factor = _value(f"1{number}" if number[0] in "eE" else number)
            if factor is not None and factor != 1:
                yield from (joined(one, match["unit"]) for one in (factor, 1 / factor))
            return


def without_number(text: str) -> str:
    """A text without the numbers in it that may not be read as a factor; empty where none stands there."""
    match = _BEGINS.fullmatch(text.strip())
    found = _UNREAD.sub("", match[1] if match else text)
    return found if found != text else ""


def is_factor(text: str) -> bool:
    """Whether a text is a number alone that is no tag: ``1e-3``, ``10^3``, ``x10``."""
    return _ALONE.fullmatch(text) is not None


def has_number(text: str) -> bool:
    """Whether a number stands in a unit that is no power of it, nor the one of ``1/s``."""
    return _HAS_NUMBER.search(text) is not None


def _is_power_of_ten(text: str) -> bool:
    return text.strip("0") == "1"


def _value(text: str) -> Fraction | None:
    """The number that is written; None of 0, and where two numbers may be meant."""
    ten = re.search(rf"{_TEN}$", text)
    before = text[: ten.start()].rstrip(" x×*·") if ten else text
    if _UNCLEAR.fullmatch(before):
        return None
    value = Fraction(re.sub(r"\s", "", before.replace(",", "."))) if before else Fraction(1)
    if ten:
        power = int(re.sub(r"[^-\d]", "", ten[0][2:].translate(_PLAIN_HIGH)))
        value *= Fraction(10) ** power
    return value or None
