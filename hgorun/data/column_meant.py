"""Which column of a file may be meant by a name that none of them has."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

from hgorun.config.nearest import COMPARED, nearest, nearest_name
from hgorun.data.units.named_units import without_any_unit

_NAMED = 3  # characters that a message names


def _as_printed(name: str) -> str:
    """A name with one spelling for what looks the same: letters with accents, and the signs of micro and ohm."""
    return unicodedata.normalize("NFKC", name)


def _only_in(name: str, other: str) -> list[str]:
    """The characters of a name that another one has not."""
    return [char for char in dict.fromkeys(name) if char not in other]


def column_meant(column: str, known: Sequence[str]) -> str:
    """The column whose name without its unit is most similar: units that are alike make no two columns so."""
    named: dict[str, list[str]] = {}
    for name in known[:COMPARED]:
        named.setdefault(without_any_unit(name).lower(), []).append(name)
    alike_in_print = next((name for name in known if _as_printed(name) == _as_printed(column)), "")
    if alike_in_print:
        codes = " and ".join(f"U+{ord(char):04X}" for char in _only_in(alike_in_print, column)[:_NAMED])
        return f" Did you mean `{alike_in_print}`? It looks the same, and has other characters ({codes}): copy it."
    near = nearest_name(without_any_unit(column), named)
    alike = named.get(near, [])
    found = nearest_name(column, alike) or next(iter(alike), "")
    return f" Did you mean `{found}`?" if found else nearest(column, known)
