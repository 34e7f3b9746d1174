"""Units that stand in the names of columns, and what is told of a unit that is not the one taken."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass

import numpy as np
import yaml

from hgorun.data.recording import Note
from hgorun.data.units.factored_units import has_factor, is_factor, parted, without_number
from hgorun.data.units.meant_units import meant_by
from hgorun.data.units.turns import is_counted
from hgorun.data.units.units import (
    NO_UNIT,
    alike,
    are_usual,
    converted,
    foreign,
    is_time,
    is_unit,
    meant_for,
)
from hgorun.data.units.written_units import is_misread, with_temperatures, without_reference
from hgorun.errors import KeyPath, Problem

_IN_NAME = re.compile(
    r"\S\s*(?:\[([^\[\]]{1,60})\]|\(([^()]{1,60}(?:\([^()]{1,60}\))?)\)|\sin\s+(\S{1,60}(?:\s\S{1,20})?))\s*"
)
_TIMES = re.compile(r"(.+[\])])\s*([xX×*/]\s*[\d.,^⁻⁰¹²³⁴⁵⁶⁷⁸⁹-]{1,20})\s*")  # behind it: [degC] x10
_TAG = re.compile(r"\d{1,2}[A-Za-z]")  # in round brackets: valve (3A)
_TEMPERATURES = {"C": "degC", "F": "degF"}  # to pint coulomb and farad


def unit_in_name(name: str) -> str:
    """What the name of a column ends with as its unit: ``[unit]``, ``(unit)`` or `` in unit``; empty without one."""
    if (times := _TIMES.fullmatch(name)) and (said := unit_in_name(times[1])):
        return f"{said} {times[2]}"
    behind = name.rpartition(" in ")[2].strip()
    if behind != name.strip() and without_reference(behind) is not None:
        return behind  # p in mbar(a)
    end = _bracket(name) or name.rfind(" in ")
    match = _IN_NAME.fullmatch(name, max(len(name[:end].rstrip()) - 1, 0)) if end > 0 else None
    said = "" if match is None else next(part for part in match.groups() if part).strip()
    if match is not None and match[2] is not None and _TAG.fullmatch(said):
        return ""
    if match is None or match[3] is None or not re.search(r"\s", said):
        return said
    is_one = with_temperatures(said) != said or is_misread(said) or has_factor(said)
    return said if is_one else ""  # level in tank 3


def _bracket(name: str) -> int:
    """Where the bracket opens that a name ends with; 0 where it ends with none."""
    text = name.rstrip()
    if text.endswith("]"):
        return max(text.rfind("["), 0)
    depth = 0
    for place in range(len(text) - 1, 0, -1) if text.endswith(")") else ():
        depth += {")": 1, "(": -1}.get(text[place], 0)
        if not depth:
            return place
    return 0


def without_unit(name: str) -> str:
    """The name of a column without the unit in brackets behind it."""
    place = _bracket(name) or max(name.rfind("["), name.rfind("("))
    return name[:place].strip() if place > 0 else name.strip()


def without_any_unit(name: str) -> str:
    """The same without `` in unit``, too."""
    before, _, said = name.rpartition(" in ")
    return before.strip() if before and is_unit(said.strip()) else without_unit(name)


def convertible_in_name(name: str, wanted: str) -> str:
    """The unit in the name of a column, where numbers of it can be converted to a unit; else empty.

    What stands in brackets may as well be a tag, a place or a remark, and a letter that is a unit of something else.
    """
    return convertible(unit_in_name(name), wanted) or ""


def foreign_in_name(name: str, wanted: str) -> str:
    """The unit in the name of a column that is none that is converted, but of the kind of another; else empty."""
    said = unit_in_name(name)
    return said if said and foreign(said, wanted) else ""


def of_another_kind_in_name(name: str, wanted: str) -> str:
    """The unit in the name of a column whose numbers cannot be of the kind wanted; else empty.

    A letter in round brackets is a tag more often than a unit, and a number with a unit a place: ``wind (10 m)``.
    """
    said = unit_in_name(name)
    if not said or said.isdigit() or (_may_be_tag(said) and not name.rstrip().endswith("]")):
        return ""
    if (meant := meant_by(said)) and alike(meant, wanted):
        return ""  # U/min is no enzyme beside rpm
    return said if is_unit(said) and is_unit(wanted) and convertible(said, wanted) is None else ""


def _may_be_tag(said: str) -> bool:
    return len(said) == 1 or has_factor(said)


def said_in_name(name: str, wanted: str, stated: bool) -> str:
    """The unit in the name of a column that is compared with the one that is taken; empty without one.

    Parameters
    ----------
    wanted : str
        The unit that is taken.
    stated : bool
        Whether the configuration says it: then what is no unit to anybody is a remark.
    """
    said = convertible_in_name(name, wanted) or foreign_in_name(name, wanted)
    return said or ("" if stated else _unread_in_name(name, wanted))


def _unread_in_name(name: str, wanted: str) -> str:
    """What stands in the name of a column as its unit, with more than a unit behind it; else empty.

    ``[bar(a)]``, ``[mm below top]`` and ``[103 m3/h]`` are such, ``[raw]`` and ``[TI101]`` are remarks.
    """
    said = unit_in_name(name)
    if said in (*NO_UNIT, wanted) or is_unit(said):
        return ""
    first = re.split(r"[\s(,;]", parted(said)[1])[0]
    more = name.rstrip().endswith("]") and first != said and (has_factor(said) or not alike(first, wanted))
    units = [first] * more + [one for one in [without_number(said)] if one]
    is_one = is_misread(said) or any(convertible(one, wanted) for one in units)
    return said if is_one or is_factor(said) else ""


def convertible(said: str, wanted: str) -> str | None:
    """A unit as it is meant, where numbers of it can be converted to another; else None."""
    return next((unit for unit in (said, _TEMPERATURES.get(said, said)) if _same_kind(unit, wanted)), None)


def _same_kind(unit: str, other: str) -> bool:
    if unit == other or not (unit and other) or unit.isdigit():
        return unit == other
    if not are_usual(unit, other):
        return False
    try:
        converted(np.zeros(1), unit, other, ())
    except Problem:
        return False
    return True


def of_one_kind(unit: str, other: str) -> bool:
    """Whether numbers of a unit can be converted to another, both of which may be the letters of temperatures."""
    return any(convertible(unit, one) is not None for one in (other, _TEMPERATURES.get(other, other)))


def time_in_name(name: str) -> str:
    """The unit of time in the name of a column; empty without one."""
    said = unit_in_name(name)
    return said if is_time(said) else ""


@dataclass(frozen=True, kw_only=True)
class AnotherUnit:
    """A unit that a file says, beside the one that its numbers are taken in.

    Attributes
    ----------
    column, file : str
    source : str
        Where the unit stands that was found.
    found : str
    wanted : str
        That of the model or the run.
    said : str, optional
        The unit of the configuration.
    who : str
        Who has the unit ``wanted``: "the model has".
    beside : tuple of str, optional
        Where ``said`` is that of a log and the file is beside it: what is written before and behind the column and its
        unit in a key of this file alone.
    """

    column: str
    file: str
    source: str
    found: str
    wanted: str
    said: str | None
    who: str
    beside: tuple[str, str] | None = None

    def told(self) -> str:
        """What is told where the numbers are taken as the configuration says, or where nobody knows the unit.

        Raises
        ------
        ValueError
            Where the configuration does not say which of two units is right: one would be silently wrong.
        """
        found, wanted = self.found, self.wanted
        says = f"column {self.column!r}: {self.source} says {found}"
        if self.said is not None and self.beside is not None and is_unit(found):
            of_log = f"unit: {self.said} is that of the log; {self._key(wanted)} takes it here, too"
            raise ValueError(f"{says} in {self.file}: {self._key(found)} converts; {of_log}")
        if self.said is not None:
            return f"{says}, the configuration unit: {self.said}, which is taken; is it {found}?"
        key = f"unit: {_plain(wanted)}" if self.beside is None else self._key(wanted)
        as_they_are = f"{key} takes the numbers as they are"
        if foreign(found, wanted) and convertible(found, wanted) is None:
            none = f"{found} is not among the units that are converted; {as_they_are}.{meant_for(found, wanted)}"
            raise ValueError(f"{says} in {self.file}, {self.who} {wanted}: {none}")
        if not is_unit(found):
            return f"{says}, which is not a known unit, {self.who} {wanted}: taken as they are{self._counted}"
        meant = convertible(found, wanted)
        if not is_unit(wanted):
            converts = "which cannot be converted to a unit that is not known"
        elif meant is None or (is_time(found) and not is_time(wanted)):
            converts = "which is of another kind"
        else:
            converts = f"{self._key(meant)} converts"
        raise ValueError(f"{says} in {self.file}, {self.who} {wanted}: {converts}, {as_they_are}{self._counted}")

    @property
    def _counted(self) -> str:
        """How counts are converted; empty of others."""
        how = meant_for(self.found, self.wanted) if is_counted(self.found) else ""
        return how and f".{how}"

    def _key(self, unit: str) -> str:
        """What is written for numbers in a unit."""
        before, behind = self.beside or ("{", "}")
        return f"{before}column: {json.dumps(self.column, ensure_ascii=False)}, unit: {_plain(unit)}{behind}"


def note_of(another: AnotherUnit, kind: str, signal: str, path: KeyPath, otherwise: str = "") -> Note:
    """What is told of a unit that is not the one taken.

    Parameters
    ----------
    kind, signal : str
        Of the note.
    path : KeyPath
        What has the unit.
    otherwise : str
        What else would be right.

    Raises
    ------
    Problem
        At ``path``, where the configuration does not say which of the two is right.
    """
    try:
        told = another.told()
    except ValueError as error:
        raise Problem(path, f"{error}{otherwise}") from None
    return Note(kind=kind, signal=signal, file=another.file, message=told)


def _plain(unit: str) -> str:
    """A unit as YAML reads it."""
    plain = (unit[:1].isalpha() or unit[:1] == "°") and yaml.safe_load(unit) == unit
    return unit if plain or unit[:2] == "1/" else json.dumps(unit, ensure_ascii=False)
