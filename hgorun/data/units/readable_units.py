"""The library of units, and whether it may read a text, told from the words in its lists: to import it takes a second.

What stands in brackets behind the name of a column is often no unit at all: a tag, a place, a remark.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

_WORD = re.compile(r"[^\W\d]\w*")
_LISTS = ("default_en.txt", "constants_en.txt")
_BETWEEN = {"per", "square", "sq", "squared", "cubic", "cubed"}  # what it reads beside units
_DIFFERENCE = re.compile("delta_|Δ")  # before temperatures
DEFINED = (
    "gauss_in_tesla = 1e-4 tesla = G = gauss",
    "oersted_in_ampere_per_meter = 250 / pi * ampere / meter = Oe = oersted",
    "volt_ampere_reactive = watt = var",
    "thousand_cubic_feet = 1000 foot ** 3",
    "million_cubic_feet = 1e6 foot ** 3",
    "thousand_Btu = 1000 Btu",
    "million_Btu = 1e6 Btu",
    "part_per_billion = 1e-9 = ppb",
    "delta_neper = [difference_of_levels]",
    "delta_decibel = 0.1151292546497022842 * delta_neper",
    "delta_decibelmilliwatt = delta_decibel",
    "delta_decibelwatt = delta_decibel",
)
"""Units that it is given, for it has none of them, or in a system where they are of another kind.

Beside another factor it takes a level for a difference of levels, as a temperature, but has no such unit.
"""


@cache
def registry() -> pint.UnitRegistry[float]:
    """The library with all units."""
    import pint

    found: pint.UnitRegistry[float] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True, on_redefinition="ignore")
    for definition in DEFINED:
        found.define(definition)
    return found


def may_be_read(text: str) -> bool:
    """Whether the library may read a text as a unit; where this is false it does not."""
    listed = _listed()
    return listed is None or "°" in text or all(_is_made_of(word, listed) for word in _WORD.findall(text))


def _is_made_of(word: str, listed: frozenset[str]) -> bool:
    """Whether a word is a listed one, maybe with a prefix, which is listed, too, and as a plural."""
    word = _DIFFERENCE.sub("", word)
    ends = ((word[:k], word[k:]) for k in range(len(word)))
    return any(
        (not front or front in listed) and (end in listed or end.removesuffix("s") in listed) for front, end in ends
    )


@cache
def _listed() -> frozenset[str] | None:
    """All words of its lists of units, prefixes and constants; None where these are not found."""
    found = find_spec("pint")
    if found is None or found.origin is None:
        return None
    try:
        lists = [Path(found.origin).with_name(name).read_text(encoding="utf-8") for name in _LISTS]
    except OSError:
        return None
    lines = (line.partition("#")[0] for text in (*lists, *DEFINED) for line in text.splitlines())
    return frozenset(_BETWEEN.union(*(_WORD.findall(line) for line in lines)))
