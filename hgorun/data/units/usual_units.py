"""The units that are taken as such: those of engineering, by their symbols and by their names.

A library of units reads much more, by accident: ``Grad`` as a gigaradian, ``a`` as a year, ``mass`` as a
milliarcsecond, ``units`` as a millionth of a nit, ``k``, ``c``, ``e`` and ``R`` as constants of nature. Numbers would
be converted by what was meant as a remark or a label.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

_OF_ALL = "n u µ μ m k M G"
_SMALL = "n u µ μ m"
_PREFIXES = {
    "m": f"f p {_SMALL} c d k",
    "g": f"p {_SMALL} c d k M",
    "s": f"f p {_SMALL} k",
    "mol": f"a f p {_SMALL} c k",
    "L l": f"f p {_SMALL} c d h k",
    "M": f"f p {_SMALL}",
    "A V": f"f p {_SMALL} k",
    "V": "M",
    "C F": f"f p {_SMALL}",
    "H T Wb S": f"{_SMALL}",
    "K": _SMALL,
    "Hz Pa J N W bar cal eV Wh VA": _OF_ALL,
    "Pa W J": "h T",
    "Pa": "da",
    "Hz eV Wh": "T",
    "J": "P E",
    "N": "c d da",
    "N W J": "p",
    "bar": "c d",
    "torr atm": "u µ μ m",
    "var": "k M G",
    "G Oe": "u µ μ m k",
    "Gal rem": "u µ μ m",
    "Ci": f"p {_SMALL} k",
    "dyn": "k M",
    "ohm Ω Ω": f"{_SMALL} k M G T",
    "rad": _SMALL,
    "deg": "u µ μ m",
    "rpm": "k",
    "B bit": "k M G T",
    "Da": "k M",
    "t": "M",
    "P St": "c m",
    "cd lm lx": "m k",
    "Bq": "u µ μ m k M G T",
    "Sv Gy": _SMALL,
    "Gy": "c",
    "AU": "u µ μ m",
    "Ah U kat": f"{_SMALL} k",
}  # by symbols, which may stand before them
_ALONE = """
    min h hr sec d yr deg ° °C °F degC degF degR degK delta_degC delta_degF % percent ppm rpm rps turn cycle gon sr dB
    Np psi atm torr mmHg kgf lbf lb lbs oz ft inch in yd mile mi gal hp Btu BTU kn knot mph kph ha acre angstrom Å a
    arcmin arcsec mH2O cmH2O mmH2O inH2O ftH2O cmHg inHg nmi kts ksi kip dyn erg cc fps thou ft_lb dBm dBW ‰ ppb
    mins hrs secs msec usec msecs usecs
"""  # without a prefix
# g/L, m/s, L/h, ... in capitals: gauss per litre, molar per siemens and litre per henry are nobody's units
_IN_CAPITALS = frozenset(("G/L", "G/S", "G/H", "M/S", "M/H", "L/S", "L/H"))
_ONLY_BESIDE = {"a", "P", "G"}  # symbols that are labels more often where they stand alone
_NAMES = """
    meter metre gram second minute hour day week fortnight month year ampere kelvin mole molar liter litre hertz newton
    pascal joule watt volt coulomb farad siemens tesla weber henry ohm radian steradian degree arcminute arcsecond
    revolution turn cycle percent inch foot feet yard mile parsec light_year pound ounce gallon ton tonne metric_ton
    atmosphere bar poise stokes calorie electron_volt horsepower knot hectare acre byte bit decibel lux lumen candela
    katal enzyme_unit dalton count dimensionless celsius fahrenheit degree_Celsius degree_Fahrenheit becquerel sievert
    revolutions_per_minute revolutions_per_second standard_gravity g_0 g_n pound_force kilogram_force volt_ampere
    watt_hour ampere_hour nautical_mile micron thou fathom furlong slug dyne erg gauss oersted darcy curie rem permille
    foot_pound poundal grain carat oil_barrel metric_horsepower thousand_cubic_feet million_cubic_feet thousand_Btu
    million_Btu
"""
_WORDS = frozenset(_NAMES.split())
_LONG_PREFIXES = ("femto", "pico", "nano", "micro", "milli", "centi", "deci", "hecto", "kilo", "mega", "giga", "tera")
_NUMBER = re.compile(r"\d+")


def _symbols() -> Iterator[str]:
    for symbols, prefixes in _PREFIXES.items():
        for symbol in symbols.split():
            yield symbol
            yield from (prefix + symbol for prefix in prefixes.split())
    yield from _ALONE.split()


_SYMBOLS = frozenset(_symbols())


def is_usual(name: str) -> bool:
    """Whether a name, without powers and other factors, is a unit of engineering."""
    if name in _SYMBOLS:
        return True
    long = next((prefix for prefix in _LONG_PREFIXES if name.startswith(prefix)), "")
    word = name.removeprefix(long)
    return any(one in _WORDS for one in (name, word, word.removesuffix("s"), word.removesuffix("es")))


def in_other_letters(text: str) -> list[str]:
    """The units that differ from a text in small and capital letters alone: RPM, KPA.

    A prefix that stands there beside letters of the other size is meant: ``mBar`` is no megabar. ``MBAR`` may be one.
    """
    found = [one for one in sorted(_SYMBOLS | _WORDS) if one != text and one.lower() == text.lower()]
    with_prefix = [] if text in (text.lower(), text.upper()) else [one for one in found if one[0] == text[0]]
    return with_prefix or found


def unusual(text: str) -> str | None:
    """The first factor of a unit, as it is written, that is none; None where all are."""
    names = [one for one in re.split(r"[*/ ()^]+|\*\*", re.sub(r"(\*\*|\^)\s*-?\d+", " ", text)) if one]
    names = [one for one in names if not _NUMBER.fullmatch(one)]
    if text.replace(" ", "").replace("l", "L") in _IN_CAPITALS:
        return names[0]
    if len(names) == 1 and text.strip() == names[0] and names[0] in _ONLY_BESIDE:
        return names[0]
    return next((one for one in names if not is_usual(one)), None)
