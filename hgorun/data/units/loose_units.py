"""Units with which the name of a column ends without brackets: they may be words as well, and are only told."""

from __future__ import annotations

import re

from hgorun.data.units.factored_units import has_factor
from hgorun.data.units.meant_units import meant_by
from hgorun.data.units.named_units import convertible, of_another_kind_in_name, unit_in_name
from hgorun.data.units.turns import is_counted
from hgorun.data.units.units import NO_UNIT, alike, are_usual, foreign, is_unit, meant_for
from hgorun.data.units.written_units import without_reference

_BETWEEN = re.compile(r"\s*[\s/,_]\s*")
_ALSO_WORDS = ("in", "min", "at")  # at the end of a name
# no unit beside one of another kind: a mean (x_bar), primary and secondary, full scale, calibrated, dynamic, ...
_LABELS = """
    AU MV acre acres atm bar bit byte cal carat cc cd cg cl count counts cycle cycles dl dyn fl foot fm fps fs grain
    ha hl hp hr kl knot kn ks lm lx mile mole nl ns pl pm point pound ps rad rem sec slug sr stone turn turns us var
    yard second minute hour day week fortnight month year
"""
_NO_UNITS = frozenset((*_ALSO_WORDS, *_LABELS.split()))
_SIGN = re.compile("[%‰°]")
_FACTORS = 4  # of a unit without brackets, with powers: kg/m^2/s


def remark_on_name(name: str, wanted: str) -> str:
    """What is told of a unit in the name of a column that may be none, or of something else; empty of others."""
    if counted := _counted_in_name(name, wanted):
        how = meant_for(counted, wanted)
        return f"column {name!r}: its name says {counted}, the model has {wanted}: taken as they are.{how}"
    if other := of_another_kind_in_name(name, wanted):
        return f"column {name!r}: its name says {other}, the model has {wanted}, of another kind: taken as they are"
    if other := loose_in_name(name, wanted):
        return f"column {name!r}: its name may say {other}, the model has {wanted}: taken as they are"
    if other := loose_of_another_kind(name, wanted):
        return f"column {name!r}: its name may say {other}, the model has {wanted}, of another kind: taken as they are"
    return ""


def _counted_in_name(name: str, wanted: str) -> str:
    """What the name of a column says is counted, beside a unit; ``[raw]`` is a remark but for angles, of encoders."""
    said = unit_in_name(name)
    if not is_counted(said) or wanted in NO_UNIT or not is_unit(wanted) or alike(said, wanted):
        return ""
    return said if said != "raw" or convertible("turn", wanted) else ""


def loose_in_name(name: str, wanted: str) -> str:
    """The unit with which a name ends without brackets, where numbers of it would be others; else empty.

    ``level_mm``, ``T / °C``, ``T, deg C`` and ``p_mbar(a)`` may be such names.
    """
    for between in list(_BETWEEN.finditer(name.rstrip(), 1))[-2:]:
        said = name[between.end() :].strip()
        if has_factor(said):
            continue  # T_5cm
        if without_reference(said) is not None and (foreign(said, wanted) or without_reference(said) == wanted):
            return said
        if unit_in_name(name):
            continue
        if len(said) > 1 and said not in _ALSO_WORDS and meant_by(said) and foreign(said, wanted):
            return said
        if len(said) > 1 and said not in _ALSO_WORDS and convertible(said, wanted) and not alike(said, wanted):
            return said
    return ""


def loose_of_another_kind(name: str, wanted: str) -> str:
    """The unit with which a name ends without brackets whose numbers cannot be of the kind wanted; else empty.

    ``cA mg/L``, ``cA_mg/L`` and ``level_mA`` may be such names, ``tank_A``, ``valve A/B``, ``c_bar`` and ``T_sec`` are
    none.
    """
    if unit_in_name(name):
        return ""
    for between in list(_BETWEEN.finditer(name.rstrip(), 1))[-_FACTORS:]:
        said = name[between.end() :].strip()
        if not has_factor(said) and are_usual(said):
            return said if _is_of_another_kind(said, wanted) else ""  # the longest: of mg/L it is not L
    return ""


def _is_of_another_kind(said: str, wanted: str) -> bool:
    is_label = said in _NO_UNITS or len(said) < 2 or said.upper() == said  # A/B, T/S
    if is_label and not _SIGN.search(said):
        return False
    if convertible(said, wanted) is not None or ((meant := meant_by(said)) and alike(meant, wanted)):
        return False
    return is_unit(said) and is_unit(wanted)
